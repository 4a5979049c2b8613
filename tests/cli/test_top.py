"""``aloft top`` shows parts that run in other processes; ``aloft watch`` shows their signals."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from aloft.logs.recording.watched_part import WatchedPart
from aloft.logs.viewing.viewer import ViewerError, start_viewer
from aloft.runtime.links.observer import Observer
from aloft.runtime.loading import load
from aloft.runtime.placement.place import place

from ..runtime.links.test_zenoh_transport import wait_for
from .conftest import run_for_json, run_here
from .test_run_local import BLOCKS, GRAPH, free_port


@pytest.fixture
def running(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A graph of two machines, free-running for long."""
    (tmp_path / "pieces.py").write_text(BLOCKS)
    text = GRAPH.replace("300 ms", "1000 s").replace("200 Hz", "100 Hz")
    text = text.replace(":7450", f":{free_port()}").replace(":7451", f":{free_port()}")
    text += "clock: {kind: paced}\nlinks: {mode: free, max_age: 60 s, late: hold}\n"
    (tmp_path / "graph.yaml").write_text(text)
    monkeypatch.chdir(tmp_path)
    command = [sys.executable, "-m", "aloft", "run", "graph.yaml", "--no-record", "--machine"]
    parts = [
        subprocess.Popen([*command, m], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for m in ("onboard", "ground")
    ]
    yield tmp_path
    for part in parts:
        part.kill()
        part.communicate()


def test_machines_and_links_are_shown(running: Path) -> None:
    found = run_for_json("top", "graph.yaml", "--once", "--wait", "60")
    assert found["success"] and list(found["machines"]) == ["onboard", "ground"]
    ground = found["machines"]["ground"]
    assert ground["base_rate_hz"] == 100.0 and ground["overruns"] >= 0
    assert [link["name"] for link in ground["links"]] == ["robot@onboard -> ground"]
    shown = run_here("top", "graph.yaml", "--once", "--wait", "60").stdout
    for text in (
        "machine",
        "onboard",
        "of 100",
        "controller@ground -> onboard",
        "age [ms]",
        "lost",
    ):
        assert text in shown
    # a live view of the other machine's signals, from here
    placed = place(load("graph.yaml"))
    try:
        viewer = start_viewer("headless")
    except ViewerError as error:
        pytest.skip(str(error))
    try:
        with Observer(placed) as observer:
            watched = WatchedPart(observer, "onboard", viewer.source)
            assert wait_for(lambda: watched.taken > 5, 30.0)
            watched.close()
            assert watched.problem == ""
    finally:
        viewer.stop()


def test_who_is_not_there_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pieces.py").write_text(BLOCKS)
    (tmp_path / "graph.yaml").write_text(GRAPH.replace("745", "1"))
    monkeypatch.chdir(tmp_path)
    found = run_for_json("top", "graph.yaml", "--once", "--wait", "0.2", code=1)
    assert found["reason"] == "nothing was heard of onboard, ground"
    assert found["machines"]["ground"] == {"state": "silent", "silent_s": None}
    assert "silent" in run_here("top", "graph.yaml", "--once", "--wait", "0.2", code=1).stdout
    assert "--json is for --once" in run_for_json("top", "graph.yaml", code=2)["reason"]
