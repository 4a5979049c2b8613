"""``aloft graph --live`` finds every part of a graph, wherever it answers."""

import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.cli.conftest import run_elsewhere

from aloft.cli.shared.running_graphs import local_runs
from aloft.extensions.studio.cli.live import RemoteRunAddress, open_live_run
from aloft.extensions.studio.live.live_server import WatchedRun
from aloft.extensions.studio.live.spread_run import SpreadRun
from aloft.runtime.language.errors import AloftError

from ....deployment.tests.cli.test_top import sockets_in

GRAPH = """\
rate: 100 Hz
clock: {kind: paced}
machines: {near: tcp/127.0.0.1:7450, far: tcp/127.0.0.1:7451}
blocks:
  wave: {use: blocks.SineWave}
  twice: {use: blocks.Gain, with: {gain: 2}, in: {u: wave.y}, on: far}
  last: {use: blocks.UnitDelay, in: {u: twice.y}}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "waves.yaml").write_text(GRAPH)
    monkeypatch.chdir(tmp_path)
    sockets_in(tmp_path / "s", monkeypatch)
    return Path("waves.yaml")


def wait_for(run: WatchedRun, holds: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    end = time.monotonic() + 120.0
    while not holds(found := run.now()):
        assert time.monotonic() < end, found
        time.sleep(0.05)
    return found


def test_a_graph_of_one_process_is_not_looked_for_elsewhere(here: Path) -> None:
    here.write_text("rate: 1 Hz\nblocks: {one: {use: blocks.SineWave}}\n")
    with pytest.raises(AloftError, match="no graph is running"):
        open_live_run("", RemoteRunAddress(here))


def test_parts_that_nobody_hears_are_named(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aloft.extensions.studio.cli.live.TIMEOUT", 0.2)
    with pytest.raises(AloftError, match=r"nothing was heard of near, far for 0\.2 s: do they run"):
        open_live_run("", RemoteRunAddress(here, ["machines.near=tcp/127.0.0.1:9"]))


@pytest.mark.long
def test_both_parts_of_a_local_run_are_shown_tuned_and_followed(here: Path) -> None:
    def start() -> Any:
        return run_elsewhere("run", "waves.yaml", "--local", "--no-record", "--plain")

    first = start()
    second = None
    try:
        wait_until(lambda: local_runs(here))
        run = open_live_run("", RemoteRunAddress(here))
        assert isinstance(run, SpreadRun)
        wait_for(run, lambda f: f["state"] == "running" and "twice" in f["times"])
        run.close()
        for _ in range(80):  # until a part answers here
            run = open_live_run("", RemoteRunAddress(here))
            assert isinstance(run, SpreadRun)
            if run.has_parameters:
                break
            run.close()
            time.sleep(0.25)
        assert run.has_parameters
        run.close()
        run = open_live_run("waves-near")
        assert isinstance(run, SpreadRun) and run.has_parameters
        rows = {row["path"] for row in run.parameters()}
        assert {"wave.frequency", "twice.gain"} <= rows, "also those of the other part"
        before = wait_for(run, lambda f: f["state"] == "running")
        run.set(["twice.gain=0"])
        found = wait_for(run, lambda f: f["values"]["twice.y.value"] in ("0", "-0"))
        assert found["changes"] == before["changes"] + 1
        first.send_signal(signal.SIGINT)
        ended = wait_for(run, lambda f: f["state"] in ("ended", "gone"))
        assert "near has ended: " in ended["said"]
        first.communicate(timeout=120)
        second = start()
        found = wait_for(run, lambda f: f["state"] == "running")
        assert found["tick"] < ended["tick"] or found["changes"] == 0, "it is the new run"
        run.close()
    finally:
        for process in (first, second):
            if process is not None and process.poll() is None:
                process.send_signal(signal.SIGINT)
                process.communicate(timeout=120)


def wait_until(holds: Callable[[], Any]) -> None:
    end = time.monotonic() + 120.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)
