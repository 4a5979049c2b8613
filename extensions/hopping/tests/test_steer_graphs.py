"""BRUCE hops where commands tell it, in closed loop; the run repeats and replays to the byte."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

import aloft
from aloft.lab.benchmarks.courses import course
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.replay import replay
from aloft.mathematics.rotations import to_matrix
from aloft.planner.library.library import shipped_folder
from aloft.runtime.loading import checked_file
from aloft.runtime.loading.reading.files import graph_path
from aloft.runtime.placement.placed import spread
from aloft.runtime.running.executor import run
from aloft.runtime.testing.spread import run_spread
from aloft.studies.batch.jobs import job_results
from aloft.studies.expansion import load_cell

GRAPH = graph_path("aloft:hopping/steer")


@pytest.mark.long
def test_it_lands_where_it_is_told() -> None:
    run = aloft.load(GRAPH, {"robot.seed": 3}).run(log=False)
    assert run.success, run.reason
    assert run.metrics["jumps"] == 3
    assert run.metrics["plans_planned"] == 3
    assert run.metrics["worst_place_error_m"] < 0.03


@pytest.mark.long
def test_a_target_that_changes_shortly_before_lift_off_is_reached() -> None:
    """The first jump lifts off at 1.39 s; without the change it lands at 15 cm."""
    commands = [{"ahead": 0.15}, {"ahead": 0.19, "aside": -0.04, "replaces": True, "at": 1.26}]
    sets = {"robot.seed": 3, "commands.commands": commands, "score.jumps": 1}
    run = aloft.load(GRAPH, sets).run()
    assert run.success, run.reason
    assert run.signal("plan.goal.position")[-1] == pytest.approx([0.19, -0.04], abs=1e-6)
    assert run.metrics["jumps"] == 1 and run.metrics["plans_planned"] == 1
    assert run.metrics["worst_place_error_m"] < 0.02


@pytest.mark.long
def test_the_estimated_tilt_does_not_drift_from_jump_to_jump() -> None:
    """An estimator that corrects the tilt only while the robot stands still was 10 mrad off before the fifth jump."""
    graphs, seed = shipped_folder(), 35102
    sets = {"robot.seed": seed, "commands.commands": course(seed)[:4], "duration": 7.2}
    graph = load_cell(GRAPH, [graphs / "trials/robust.yaml"], sets, graphs / "bench.yaml")
    with graph.open() as stepped:
        while not stepped.reason:
            stepped.step()
        true, estimated = np.zeros((3, 3)), np.zeros((3, 3))
        to_matrix(stepped["robot.truth.base_orientation"], true)
        to_matrix(stepped["estimator.base.orientation"], estimated)
        assert int(stepped["plan.goal.number"]) == 4
    assert np.linalg.norm(np.cross(estimated[2], true[2])) < 0.006


@pytest.mark.long
def test_a_recording_replays_exactly(tmp_path: Path) -> None:
    file = tmp_path / "steer.rrd"
    graph = aloft.load(GRAPH, {"commands.commands": [{"ahead": 0.1, "turn": 0.3}]})
    done = graph.run()
    assert done.metrics["jumps"] == 1, done.reason
    aloft.write_recording(file, done)
    again = replay(OpenedRun.of(file))
    assert again.identical, again


TICKS = 450
"""Enough for the first plan to be asked for, made in the background and received."""


def hash_of(seed: int) -> str:
    """The run hash of the beginning of a course."""
    graph = checked_file(GRAPH, overrides={"robot.seed": seed})
    result = run(graph, TICKS)
    assert result.signal("planner.segment.number")[-1] == 1
    return result.run_hash


@pytest.mark.long
def test_bytes_are_equal_in_workers() -> None:
    expected = [hash_of(seed) for seed in (1, 2)]
    with closing(job_results(hash_of, [1, 2], workers=2)) as results:
        found = {result.index: result.value or result.error for result in results}
    assert [found[k] for k in range(2)] == expected


@pytest.mark.long
def test_bytes_are_equal_on_two_machines_in_lockstep() -> None:
    graph = checked_file(GRAPH, overrides={"robot.seed": 1})
    machines = {"onboard": "tcp/127.0.0.1:7470", "desk": "tcp/127.0.0.1:7471"}
    placed = spread(graph, machines, {"planner": "desk", "commands": "desk"})
    spread_out = run_spread(placed, TICKS, timeout=60.0, wall_time=300.0)
    assert spread_out.ticks == TICKS
    assert spread_out.run_hash == hash_of(1)


def test_the_keyboards_graph_has_no_problems() -> None:
    checked = aloft.load(GRAPH.parent / "steer_by_keys.yaml").checked
    assert checked.clock.kind == "paced"
