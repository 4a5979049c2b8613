"""The rows of robots as a bench finds them are complete, and a robot that learns has its lessons."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

from aloft.lab.benchmarks.jumps import real_robot
from aloft.lab.benchmarks.jumps.real_robot import RobotJob, graph_of, jumps_of
from aloft.lab.benchmarks.jumps.real_tasks import (
    ASKED,
    EFFORT,
    EVERY,
    PUSH,
    RANDOM,
    SEEN,
    TEN,
    asked_of,
)
from aloft.planner.library.learnt import read_learnt
from aloft.runtime.language.errors import AloftError
from aloft.studies.batch.jobs import JobResult

LEARNING = "told within the calibration's goals, learning"
IN_PLACE = "in place 12 cm"


def alone(function: Callable[[Any], Any], jobs: Iterable[Any], workers: int) -> Iterator[JobResult]:
    """All jobs in this process, where what is replaced here is seen."""
    for index, job in enumerate(jobs):
        yield JobResult(index, function(job))


def test_what_is_told_changes_the_controller_and_not_the_robot() -> None:
    asked = ASKED[IN_PLACE]
    untold, told = (graph_of(97000, told, asked, asked.task, 1).checked for told in ("nothing", "draws"))  # fmt: skip
    for block in ("timing", "weight", "wbc"):
        assert untold.block(block).params != told.block(block).params
    for field in ("sensors", "actuators", "body", "ground", "seed", "noise_seed"):
        a, b = (getattr(each.block("robot").params, field) for each in (untold, told))
        assert a == b


def test_each_robot_has_a_random_task_and_a_push_of_its_own_and_a_margin() -> None:
    first, second = asked_of(97000), asked_of(97001)
    assert list(first) == list(EVERY)
    assert first[RANDOM].task != second[RANDOM].task
    assert first[PUSH].sets != second[PUSH].sets
    assert asked_of(97000) == first
    graph = graph_of(97000, "nothing", first[TEN], first[TEN].task, 1)
    assert graph.checked.block("plan").params.task["effort"] == EFFORT
    assert graph.checked.block("score").params.jumps == 10
    wires = graph.checked.block("ahead").wires
    assert wires["measured_base"].source == "estimator.base"


def test_a_row_whose_place_is_measured_is_that_row_with_a_sensor() -> None:
    asked = asked_of(97000)
    assert asked[SEEN].task == asked[TEN].task and asked[SEEN].graph == asked[TEN].graph
    graph = graph_of(97000, "draws", asked[SEEN], asked[SEEN].task, 1)
    wires = graph.checked.block("ahead").wires
    assert wires["measured_base"].source == "pose.base"
    assert wires["measured_joints"].source == "timing.joints", "late sensors are as without it"
    assert graph.checked.block("capture").block_type.__name__ == "MotionCapture"


def test_other_robots_have_their_own_jumps_and_the_same_margin() -> None:
    in_place, ahead = asked_of(97000, "go2").values()
    checked = graph_of(97000, "nothing", ahead, ahead.task, 1).checked
    assert checked.robot is not None
    assert checked.robot.name == "go2"
    assert checked.block("plan").params.task == {"effort": EFFORT, "rise": 0.1, "distance_x": 0.2}
    assert in_place.alone
    assert ahead.before(first=False) == [{"rise": 0.1, "distance_x": 0.1}]
    with pytest.raises(AloftError, match="there is no robot 'a1'; there is 'bruce', 'go2'"):
        real_robot.real_robot(range(97000, 97001), robot="a1")


def test_smaller_jumps_come_first_and_later_only_half_as_far() -> None:
    ahead = ASKED["ahead 20 cm"]
    assert [task["rise"] for task in ahead.before(first=True)] == [0.02, 0.05, 0.08, 0.12, 0.12]
    assert ahead.before(first=False) == [{"rise": 0.12, "distance_x": 0.1}]
    assert ASKED[IN_PLACE].before(first=False) == []
    assert asked_of(97000)[TEN].before(first=False) == []


@pytest.mark.parametrize(("arms", "asked"), [(["guessed"], []), ([], ["a handstand"])])
def test_what_there_is_not_is_said(arms: list[str], asked: list[str]) -> None:
    with pytest.raises(
        AloftError, match=r"there is no (arm 'guessed'|jump 'a handstand'); there is"
    ):
        real_robot.real_robot(range(97000, 97001), arms, asked)


@pytest.mark.long
def test_the_rows_are_complete(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(real_robot, "job_results", alone)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(real_robot, "FOLDER", tmp_path)
    rows = real_robot.real_robot(range(97000, 97001), ["calibrated", LEARNING], [IN_PLACE])
    assert len(rows) == 2
    assert all(row.value in (0.0, 1.0) for row in rows)
    assert "jumps 1 to 5: " in rows[-1].note
    (robot,) = json.loads((tmp_path / "results.json").read_text())["robots"]
    assert [len(robot["arms"][arm][IN_PLACE]) for arm in ("calibrated", LEARNING)] == [1, 5]
    (learnt,) = tmp_path.glob("robot_97000_*.json")
    assert len(read_learnt(learnt, "bruce").lessons) >= 5
    again = jumps_of(RobotJob(97000, (LEARNING,), (IN_PLACE,)))
    assert again[LEARNING] == robot["arms"][LEARNING], "the same robot makes the same jumps"
