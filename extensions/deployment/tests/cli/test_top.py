"""``aloft top`` shows parts that run in other processes; ``aloft watch`` shows their signals."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.cli.conftest import run_elsewhere, run_for_json, run_here
from tests.cli.test_run_machines import BLOCKS, GRAPH, free_port
from tests.waiting import wait_for

from aloft.cli.shared.running_graphs import local_runs, registered, settings_of
from aloft.logs.recording.live_feed import WatchedPart
from aloft.logs.viewing.viewer import ViewerError, start_viewer
from aloft.runtime.language.errors import AloftError
from aloft.runtime.links.observer import Observer
from aloft.runtime.loading import checked_file
from aloft.runtime.placement.placed import split_over_machines


def write_graph(folder: Path) -> None:
    text = GRAPH.replace("300 ms", "1000 s").replace("200 Hz", "100 Hz")
    text = text.replace(":7450", f":{free_port()}").replace(":7451", f":{free_port()}")
    text += "clock: {kind: paced}\nlinks: {mode: free, max_age: 60 s, late: hold}\n"
    (folder / "graph.yaml").write_text(text)


@pytest.fixture
def running(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A graph of two machines, free-running for long."""
    (tmp_path / "pieces.py").write_text(BLOCKS)
    write_graph(tmp_path)
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


@pytest.mark.long
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
    placed = split_over_machines(checked_file("graph.yaml"))
    try:
        viewer = start_viewer("headless")
    except ViewerError as error:
        pytest.skip(str(error))
    try:
        with Observer(placed) as observer:
            watched = WatchedPart(observer, "onboard", viewer.source)
            assert wait_for(lambda: watched.taken > 5)
            watched.close()
            assert watched.problem == ""
    finally:
        viewer.stop()


def sockets_in(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not in the current folder: Python would take its ``aloft`` there for the package."""
    folder.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))


@pytest.mark.long
def test_the_parts_of_a_local_run_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At the ports that were free, with the settings that it was started with."""
    (tmp_path / "pieces.py").write_text(BLOCKS)
    write_graph(tmp_path)
    monkeypatch.chdir(tmp_path)
    sockets_in(tmp_path / "sockets", monkeypatch)
    run = run_elsewhere(
        "run", "graph.yaml", "--local", "--no-record", "--set", "controller.stop_at=99999"
    )
    try:
        assert wait_for(lambda: local_runs(Path("graph.yaml")) != [], 120.0), run.poll()
        found = run_for_json("top", "graph.yaml", "--once", "--wait", "120")
        assert found["success"] and list(found["machines"]) == ["onboard", "ground"]
        states = {machine["state"] for machine in found["machines"].values()}
        assert "another graph" not in states, "its settings count, too"
        number = str(run.pid)
        assert run_for_json("top", "graph.yaml", "--once", "--wait", "120", "--local", number)
        wrong = run_for_json("top", "graph.yaml", "--once", "--local", "1", code=2)["reason"]
        assert wrong.endswith(f"graph.yaml --local` has the process 1; there is {run.pid}")
    finally:
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=120)
    assert local_runs(Path("graph.yaml")) == []


def test_local_runs_end_with_their_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    sockets_in(tmp_path / "sockets", monkeypatch)
    graph = Path("graph.yaml")
    assert settings_of(graph) == ()
    with registered(graph, ["a.b=1"]):
        assert settings_of(tmp_path / "graph.yaml") == ("a.b=1",)
        assert settings_of(graph, os.getpid()) == ("a.b=1",)
        assert local_runs(Path("other.yaml")) == []
        code = (
            "import os, signal\nfrom pathlib import Path\nfrom aloft.cli.shared.running_graphs import *\n"
            "with registered(Path('graph.yaml'), ['a.b=2']):\n"
            "    print(flush=True)\n    input()\n    os.kill(os.getpid(), signal.SIGKILL)\n"
        )
        with subprocess.Popen(
            [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as other:
            assert other.stdout is not None
            other.stdout.readline()
            runs = local_runs(graph)
            assert {run.settings for run in runs} == {("a.b=1",), ("a.b=2",)}
            with pytest.raises(AloftError, match="runs here 2 times with --local, as the proc"):
                settings_of(graph)
            assert settings_of(graph, other.pid) == ("a.b=2",)
            other.communicate("\n", timeout=120)
        assert [run.process for run in local_runs(graph)] == [os.getpid()], "it was killed"
    assert local_runs(graph) == [] and not list((tmp_path / "sockets").rglob("*.local"))
    with pytest.raises(AloftError, match="has the process 7; there is none"):
        settings_of(graph, 7)


def test_who_is_not_there_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "pieces.py").write_text(BLOCKS)
    (tmp_path / "graph.yaml").write_text(GRAPH.replace("745", "1"))
    monkeypatch.chdir(tmp_path)
    found = run_for_json("top", "graph.yaml", "--once", "--wait", "0.2", code=1)
    assert found["reason"] == (
        "onboard: no connection to tcp/127.0.0.1:10: Connection refused; "
        "ground: no connection to tcp/127.0.0.1:11: Connection refused"
    )
    assert found["machines"]["ground"] == {"state": "silent", "silent_s": None}
    shown = run_here("top", "graph.yaml", "--once", "--wait", "0.2", code=1)
    assert "silent" in shown.stdout and "ground: no connection to tcp/" in shown.stderr
    assert "--json is for --once" in run_for_json("top", "graph.yaml", code=2)["reason"]


def test_tls_endpoints_without_keys_are_refused_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pieces.py").write_text(BLOCKS)
    (tmp_path / "graph.yaml").write_text(GRAPH.replace("tcp/", "tls/"))
    monkeypatch.chdir(tmp_path)
    assert run_for_json("top", "graph.yaml", "--once", code=2)["reason"] == (
        "links over TLS need certificates: `aloft keys GRAPH` makes them, and --keys FOLDER takes them"
    )
