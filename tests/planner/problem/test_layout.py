"""The intervals of a task: their order, their times, and what the feet do in them."""

from __future__ import annotations

import pytest

from aloft.planner.problem.layout import layout
from aloft.planner.task.phase import Phase
from aloft.planner.task.task import JumpTaskError, make_task
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


def test_a_single_jump() -> None:
    task = make_task({"recipe": "paper", "name": "a", "rise": 0.1})
    squat, thrust, flight, landing = layout(task, ROBOT)
    assert [s.phase for s in (squat, thrust, flight, landing)] == [
        Phase.SQUAT, Phase.THRUST, Phase.FLIGHT, Phase.LANDING,
    ]  # fmt: skip
    assert landing.stop == task.knots.total
    assert [s.timed for s in (squat, thrust, flight, landing)] == [False, False, True, False]
    assert (flight.place, landing.place) == (0, 1)
    assert landing.lengths.mean() == pytest.approx(1.0)


def test_free_times_are_states_within_bounds() -> None:
    squat, thrust, _, landing = layout(
        make_task(
            {"recipe": "paper", "name": "a", "rise": 0.1, "squat_time": "free", "thrust_time": None}
        ),
        ROBOT,
    )
    assert (squat.piece, thrust.piece, landing.piece) == ("free_stance", "free_stance", "stance")
    low, high = thrust.bounds
    assert 0.0 < low * thrust.count < 0.1
    assert high * thrust.count > 0.4
    assert landing.bounds == (0.5 / 14, 0.5 / 14)


def test_every_touchdown_has_its_impact() -> None:
    found = layout(
        make_task({"recipe": "paper", "name": "a", "rise": 0.1, "impact": True, "repeat": 2}), ROBOT
    )
    assert [s.piece for s in found] == [
        "stance", "stance", "flight", "impact", "free_stance", "free_stance", "flight", "impact",
        "stance",
    ]  # fmt: skip
    assert [s.place for s in found] == [0, 0, 0, 1, 1, 1, 1, 2, 2]
    assert all(s.count == 1 and not s.timed for s in found if s.impact)


def test_points_that_are_not_there() -> None:
    phases = [
        {"phase": "thrust"}, {"phase": "thrust", "contacts": "claw"}, {"phase": "flight"},
        {"phase": "landing"},
    ]  # fmt: skip
    with pytest.raises(
        JumpTaskError, match="phase 2, thrust: no contact point of bruce is on the ground"
    ):
        layout(make_task({"recipe": "paper", "name": "a", "rise": 0.1, "phases": phases}), ROBOT)
