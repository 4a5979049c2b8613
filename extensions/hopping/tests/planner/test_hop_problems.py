"""A hop's problem that shares with its kind is the problem that is made from nothing, to the last bit."""

from __future__ import annotations

import pytest

from aloft.extensions.hopping.planner.hop_problems import HopProblems, kind_of
from aloft.extensions.hopping.planner.hop_request import HopRequest, coarse, task_of
from aloft.planner.solving.solve import make_problem
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
ARRAYS = ("lower", "upper", "row_lower", "row_upper", "parameters", "steps")


def resolved(wanted: HopRequest):
    return coarse(task_of(wanted, "bruce", 0.09).resolved(ROBOT))


@pytest.mark.long
@pytest.mark.parametrize(
    ("first", "second", "coordinates"),
    [
        (HopRequest(0.10, 0.0, 0.0), HopRequest(0.23, 0.0, 0.0), "sagittal"),
        (HopRequest(0.05, 0.10, 0.1), HopRequest(0.06, -0.08, -0.1), "full"),
        (HopRequest(0.20, 0.02, 0.1, 0.04), HopRequest(0.22, -0.03, 0.1, 0.041), "full"),
        (HopRequest(0.20, 0.02, 0.1, -0.04), HopRequest(0.21, 0.05, -0.05, -0.041), "full"),
    ],
)
def test_a_problem_of_a_kind_is_the_one_that_is_made_anew(first, second, coordinates) -> None:
    problems = HopProblems(ROBOT)
    tasks = [resolved(first), resolved(second)]
    assert kind_of(tasks[0]) == kind_of(tasks[1])
    shared = [problems.problem(task, coordinates) for task in (*tasks, tasks[0])]
    assert shared[1].assembly is shared[0].assembly
    for task, found in zip((*tasks, tasks[0]), shared, strict=True):
        anew = make_problem(task, ROBOT, coordinates=coordinates)
        for name in ARRAYS:
            assert getattr(found, name).tobytes() == getattr(anew, name).tobytes(), name
        assert found.families == anew.families
        assert found.task == anew.task
        assert found.assembly.signature == anew.assembly.signature
        for mine, other in zip(found.stances, anew.stances, strict=True):
            assert mine.coordinates.tobytes() == other.coordinates.tobytes()


def test_jumps_of_other_structure_are_of_another_kind() -> None:
    ahead, back, up, down = (
        kind_of(resolved(HopRequest(*wanted)))
        for wanted in ((0.1, 0, 0), (-0.05, 0, 0), (0.2, 0, 0, 0.04), (0.2, 0, 0, -0.04))
    )
    assert len({ahead, back, up, down}) == 4
