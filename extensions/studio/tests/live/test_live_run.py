"""A running graph from outside: what is seen while it runs, stands still, ends and starts again."""

import json
import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.runtime.live.conftest import Running, start

from aloft.extensions.studio.live import live_run
from aloft.extensions.studio.live.live_run import LiveRun
from aloft.extensions.studio.live.texts import ValueTexts
from aloft.runtime.language.errors import AloftError
from aloft.runtime.links.part import part_graph
from aloft.runtime.live.parameter_endpoint import EndpointError, ask_to_watch
from aloft.runtime.live.window import digest
from aloft.runtime.loading import checked_text
from aloft.runtime.placement.placed import split_over_machines
from aloft.runtime.running.memory import Memory

MACHINES = """\
rate: 100 Hz
machines: {onboard: tcp/127.0.0.1:7450, ground: tcp/127.0.0.1:7451}
blocks:
  wave: {use: blocks.SineWave}
  twice: {use: blocks.Gain, in: {u: wave.y}, on: ground}
  last: {use: blocks.Gain, in: {u: twice.y}}
"""


def wait_for(run: LiveRun, state: str, tick: int = 0) -> dict[str, Any]:
    """What the run says once it has that state."""
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        found = run.now()
        if found["state"] == state and found.get("tick", tick) >= tick:
            return found
        time.sleep(0.02)
    raise AssertionError(f"never {state!r}: {found}")


def test_values_times_and_ticks_go_on(running: Running, live: LiveRun) -> None:
    first = wait_for(live, "running", 10)
    second = wait_for(live, "running", first["tick"] + 20)
    assert second["values"]["wave.y.value"] != first["values"]["wave.y.value"]
    assert second["values"].keys() >= {"inner/twice.y.value", "pid.u.value"}
    assert second["brief"]["wave.y"].count(",") == 1
    assert second["times"].keys() == {"wave", "inner/twice", "pid"}
    assert second["line"].startswith(f"tick {second['tick']}, {second['tick'] / 200:.3f} s; a tick")
    assert "ticks began late" in second["line"]
    assert json.dumps(second)
    assert live.graph.block("wave").where.line == 4, "the graph of the file, with its places"


def test_the_end_and_the_next_run(running: Running, live: LiveRun, graph_file: Path) -> None:
    wait_for(live, "running", 10)
    running.stop("the battery is empty")
    found = wait_for(live, "ended")
    assert found["said"] == "the run has ended: the battery is empty"
    assert found["tick"] == running.bound.clock.tick - 1
    with pytest.raises(EndpointError, match="no running graph answers at"):
        live.parameters()
    # the same graph again: it is taken for another run by its process
    again = start(graph_file, running.path)
    try:
        assert live.now()["state"] == "ended", "a run of the same process is not taken for new"
        live._about["process"] = -1
        assert wait_for(live, "running")["tick"] < found["tick"] + 1000
    finally:
        again.stop()


def test_another_graph_at_the_same_place(running: Running, live: LiveRun, graph_file: Path) -> None:
    running.stop()
    graph_file.write_text(graph_file.read_text().replace("n: 2\n", "n: 2\n      phase: 1 rad\n", 1))
    again = start(graph_file, running.path)
    live._about["process"] = -1
    try:
        assert wait_for(live, "other")["said"] == "another graph runs there now"
        live.refresh()
        assert live.graph.block("wave").params.phase == 1.0  # type: ignore[attr-defined]
        wait_for(live, "running")
    finally:
        again.stop()


def test_it_stands_still_and_is_gone(
    running: Running, live: LiveRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    wait_for(live, "running", 10)
    assert live._reader is not None
    last = live._reader.look()
    monkeypatch.setattr(live._reader, "look", lambda: last)
    monkeypatch.setattr(live_run, "STALLED_AFTER", 0.05)
    found = wait_for(live, "still")
    assert "no tick has come for" in found["said"] and found["tick"] == last.tick  # type: ignore[union-attr]
    monkeypatch.setattr(live_run, "answers", lambda path: False)
    assert wait_for(live, "gone")["said"] == "the process has gone, and did not say why"
    monkeypatch.setattr(live._reader, "look", lambda: None)
    assert live.now()["said"] == "the process was stopped in the midst of a tick"


def test_a_file_that_has_changed_since(running: Running, graph_file: Path) -> None:
    graph_file.write_text(graph_file.read_text().replace("2 Hz", "3 Hz"))
    run = LiveRun(running.path)
    assert run.graph.block("wave").params.frequency == 2.0  # type: ignore[attr-defined]
    run.close()


def test_blocks_that_have_changed_since(running: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[int] = []
    closed: list[int] = []

    def kept(path: Path) -> tuple[dict[str, Any], int]:
        answer = ask_to_watch(path)
        given.append(answer[1])
        return answer

    monkeypatch.setattr(live_run, "ask_to_watch", kept)
    monkeypatch.setattr(live_run, "digest", lambda layout, graph: "another")
    monkeypatch.setattr(live_run.os, "close", closed.append)
    with pytest.raises(AloftError, match="its blocks have changed since the run began"):
        LiveRun(running.path)
    monkeypatch.undo()
    assert given[0] in closed, "nothing is left open"
    os.close(given[0])


def test_of_a_part_only_what_it_knows_is_shown() -> None:
    graph = checked_text(MACHINES, "spread.yaml")
    placed = split_over_machines(graph)
    known = {"onboard": ["last", "twice", "wave"], "ground": ["twice", "wave"]}
    for machine, expected in known.items():
        part = part_graph(placed, machine)
        layout = Memory(part.blocks, part.robot).bus.layout
        found, where, paths = live_run._bus_of(graph, digest(layout, part))
        assert (where, sorted(paths)) == (machine, expected)
        texts = ValueTexts(graph, found, paths)
        bus = np.zeros(found.size, np.uint8)
        assert texts.brief(bus).keys() == {f"{path}.y" for path in paths}
    layout = Memory(graph.blocks, graph.robot).bus.layout
    assert live_run._bus_of(graph, digest(layout, graph))[1] == ""


def test_parameters_are_changed_through_the_same_door(running: Running, live: LiveRun) -> None:
    wait_for(live, "running", 1)
    assert {entry["path"] for entry in live.parameters()} >= {"wave.frequency", "pid.kp"}
    (change,) = live.set(["wave.frequency=0.005 kHz"])
    assert (change["old"], change["new"]) == (2.0, 5.0)
    assert wait_for(live, "running", change["tick"] + 20)["changes"] == 1
    with pytest.raises(EndpointError, match=r"wave\.frequency cannot be -1"):
        live.set(["wave.frequency=-1"])


def test_nobody_answers(tmp_path: Path) -> None:
    with pytest.raises(EndpointError, match="no running graph answers at"):
        ask_to_watch(tmp_path / "no.sock")
