"""What a run has measured is held against the ages that the graph allows on paths."""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from aloft.logs.file.reader import read
from aloft.logs.recording.merged_run import merged_outcome, path_metrics, read_parts
from aloft.logs.recording.recorder import Recorder
from aloft.runtime.graph import Graph
from aloft.runtime.language.errors import ExitCode
from aloft.runtime.language.stages import CheckedGraph, LinkPolicy
from aloft.runtime.links.path_ages import NAME, check_path_ages, path_sinks, timeline_of
from aloft.runtime.loading import checked_text
from aloft.runtime.placement.placed import split_over_machines
from aloft.runtime.running.executor import run
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.spread import run_parts_of, run_spread
from aloft.runtime.transports.hub import Hub

from .test_free_running import Quiet, free

GRAPH = """
rate: 100 Hz
duration: 300 ms
clock: {kind: paced}
links: {paths: {sensor.y -> b.u: 10 ms}}
blocks:
  sensor: {use: blocks.Constant, with: {value: [1.0]}}
  b: {use: blocks.Gain, in: {u: sensor.y}}
"""
PATH = "sensor.y -> b.u"


class Late:
    """A time source in which nothing takes time, but for one tick, after which it jumps [ns]."""

    def __init__(self, jump: int) -> None:
        self.time, self.jump, self.sleeps = 10**12, jump, 0

    def now(self) -> int:
        self.time += 10
        return self.time

    def sleep(self, seconds: float) -> None:
        self.sleeps += 1
        self.time += int(seconds * 1e9) + (self.jump if self.sleeps == 12 else 0)


def checked(text: str = GRAPH) -> CheckedGraph:
    return checked_text(text, Path("graph.yaml"))


def test_a_pause_is_no_age() -> None:
    def oldest(*, told: bool) -> Any:
        graph = checked()
        (ages,) = path_sinks(graph)
        bound = BoundGraph(graph)
        ages.open(bound)
        for tick in range(20):
            bound.clock.began = (tick + 500 * (tick >= 10) + 1) * 10_000_000
            if tick == 10 and told:
                ages.resume(tick)
            ages.record(tick)
        return ages.metrics()[f"age_max_ms {PATH}"]

    assert (oldest(told=False), oldest(told=True)) == pytest.approx((5010.0, 10.0))


def test_a_run_in_time_is_praised_with_the_ages() -> None:
    graph = checked()
    result = run(graph, sinks=path_sinks(graph), time_source=Late(0))
    assert result.success, result.reason
    assert result.metrics[f"age_max_ms {PATH}"] == pytest.approx(10.0, abs=0.02)
    assert result.metrics[f"age_p50_ms {PATH}"] == pytest.approx(10.0, abs=0.02)


def test_a_run_that_was_late_is_no_success() -> None:
    graph = checked()
    result = run(graph, sinks=path_sinks(graph), time_source=Late(3_000_000))
    assert not result.success and result.exit_code is ExitCode.NOT_SUCCESSFUL
    assert result.reason.startswith(
        "sensor.y at b.u was up to 12.8 ms old, "
    )  # it slept 3 ms too long, less the spin
    assert "at most 10 ms are allowed; it was older 1 times of 29" in result.reason


def test_in_virtual_time_nothing_is_measured() -> None:
    graph = checked(GRAPH.replace("{kind: paced}", "{kind: free}"))
    assert path_sinks(graph) == [] and path_sinks(checked(), "free") == []
    assert path_sinks(checked(GRAPH.replace("paths:", "of: {}, paths:"))) != []
    result = Graph(graph).run()
    assert result.success and not any("age" in name for name in result.metrics)


def test_a_graph_that_is_run_measures() -> None:
    metrics = Graph(checked(GRAPH.replace("10 ms}", "9 s}"))).run().metrics
    assert float(metrics[f"age_max_ms {PATH}"]) >= 9.0


def free_with_path(limit: float, ticks: int = 120) -> CheckedGraph:
    graph = free(LinkPolicy(60.0, "hold"), ticks=ticks)
    return replace(graph, links=replace(graph.links, paths={"robot.y -> robot.u": limit}))


def test_parts_that_run_free_are_followed_through_their_links() -> None:
    run_ = run_spread(free_with_path(60.0))
    timelines: dict[str, Any] = {}
    for machine, result in run_.results.items():
        log = result.log
        assert log is not None and log.layout is not None
        view = partial(log.layout.view, log.rows())
        timelines[machine] = timeline_of(run_.placed, machine, result.time * 100.0, view)
        timelines[machine] = replace(timelines[machine], ticks=list(log.ticks))
    found = check_path_ages(run_.placed.graph, timelines)
    # once round through two other machines, and held for a tick
    assert "success" not in found, found
    assert 10.0 < float(found["age_p50_ms robot.y -> robot.u"]) < 60_000.0  # type: ignore[arg-type]


def made(folder: Path, limit: float, interfere: Any = None) -> tuple[Any, Any]:
    placed = split_over_machines(free_with_path(limit, ticks=240))
    hub = Hub()
    hub.interfere = interfere
    files = {machine.name: folder / f"{machine.name}.rrd" for machine in placed.machines}
    run_parts_of(placed, hub, {name: [Recorder(path)] for name, path in files.items()})
    return placed, read_parts(placed, files)


@pytest.mark.long
def test_recordings_of_parts_are_judged_when_they_are_merged(tmp_path: Path) -> None:
    # Half of the run, because on a busy machine parts begin some tenths of a second apart.
    quiet: Iterable[Any] = Quiet("data/far/onboard/last", 120)  # type: ignore[assignment]
    placed, parts = made(tmp_path, 0.15, quiet)
    found = path_metrics(placed, parts)
    assert found["success"] is False
    assert "robot.y at robot.u was up to " in found["reason"]
    assert float(found["age_max_ms robot.y -> robot.u"]) > 200.0
    outcome = merged_outcome(placed, parts, "", 0)
    assert outcome["exit_code"] == ExitCode.NOT_SUCCESSFUL and not outcome["success"]
    assert outcome["reason"] == found["reason"] and "success" not in outcome["metrics"]
    assert outcome["metrics"]["age_max_ms robot.y -> robot.u"] > 200.0
    assert read(tmp_path / "far.rrd")["~tick.began.time"].min() > 0
    assert NAME == "links.paths"
