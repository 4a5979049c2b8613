"""What is recorded of a robot on its feet: falls, slides, steps, peaks, and how it rests."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aloft.blocks.scoring.footing import Footing
from aloft.blocks.scoring.standing import (
    NEVER,
    StandConstants,
    StandCriteria,
    StandRecord,
    largest_magnitude,
    largest_of,
    record_fall,
    record_feet,
    record_rest,
    record_robot,
)
from aloft.blocks.signals import RobotTruth, WholeBodyCommand
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
FOOTING = Footing(ROBOT)
PERIOD, SETTLING = 0.01, 0.15
POINTS = np.array([[0.05, -0.1, 0.0], [-0.03, -0.1, 0.0], [0.05, 0.1, 0.0], [-0.03, 0.1, 0.0]])
ALL = np.ones(4, bool)


def given(**changes: Any) -> Any:
    """The tolerances as a kernel gets them."""
    values = {"fall_tilt": 1.2, "step_time": 0.02, "steps": 0, **changes}
    return SimpleNamespace(**{name: np.array(value) for name, value in values.items()})


def constants() -> StandConstants:
    written = StandConstants.allocate(ROBOT.dimensions)
    written.fill(FOOTING, StandCriteria().for_robot(FOOTING), SETTLING, PERIOD)
    return written


def truth(**fields: Any) -> RobotTruth:
    """A robot that stands on its four points."""
    seen = RobotTruth.allocate(ROBOT.dimensions)
    upright = {
        "base_position": [0.0, 0.0, 0.38], "base_orientation": [0.0, 0.0, 0.0, 1.0],
        "com": [0.01, 0.0, 0.33], "contact_position": POINTS, "contact_touched": ALL,
        "contact_force": np.tile([0.0, 0.0, FOOTING.weight / 4.0], (4, 1)),
    }  # fmt: skip
    for name, value in {**upright, **fields}.items():
        getattr(seen, name)[...] = value
    return seen


def tick(record: StandRecord, time: float, seen: RobotTruth, failures: int = 0) -> StandRecord:
    wbc = WholeBodyCommand.allocate(ROBOT.dimensions)
    wbc.failures = failures
    record_robot(time, seen, wbc, record, FOOTING.ball_feet(), constants())
    return record


def begun() -> StandRecord:
    return tick(StandRecord.allocate(ROBOT.dimensions), 0.0, truth())


def test_the_largest_value_may_stand_anywhere() -> None:
    for values in ([3.0, 1.0, 2.0], [1.0, 3.0, 2.0], [1.0, 2.0, 3.0], [3.0]):
        assert largest_of(np.array(values)) == 3.0
        assert largest_magnitude(-np.array(values)) == 3.0
    assert largest_of(np.array([-2.0, -1.0])) == -1.0


def test_tolerances_that_are_not_given_follow_from_the_robot() -> None:
    criteria = StandCriteria().for_robot(FOOTING)
    assert criteria.load_share == pytest.approx(0.2)
    assert criteria.fall_height == FOOTING.fall_height == pytest.approx(0.12, abs=0.002)
    own = StandCriteria(load_share=0.3, fall_height=0.2)
    assert own.for_robot(FOOTING) == own


def test_the_first_tick_begins_the_record_and_peaks_stay() -> None:
    record = begun()
    assert [record.fall_time, record.judged_time, record.forbidden_time] == [NEVER] * 3
    assert record.standing_height == 0.33 and record.ticks == 1
    assert record.foot == pytest.approx(np.array([[0.01, -0.1], [0.01, 0.1]]))
    busy = truth(
        com=[0.0, 0.0, 0.2], forbidden_contacts=2, saturated_share=0.25, joint_limit_violation=0.01,
        motor_overload=0.3, motor_torque=np.linspace(-4.0, 2.0, 10), motor_speed=np.full(10, 5.0),
    )  # fmt: skip
    tick(record, 0.01, busy, failures=2)
    tick(record, 0.02, busy, failures=2)
    tick(record, 0.03, truth(), failures=3)
    assert record.standing_height == 0.33 and record.ticks == 4 and record.now == 0.03
    assert record.forbidden == 4 and record.forbidden_time == 0.01
    assert record.saturated == 0.5 and record.failures == 3
    assert record.violation == 0.01 and record.overload == 0.3
    assert record.peak_torque == 4.0 and record.peak_speed == 5.0


@pytest.mark.parametrize(
    ("fields", "falls"),
    [
        ({}, False),
        ({"base_orientation": [math.sin(0.59), 0.0, 0.0, math.cos(0.59)]}, False),
        ({"base_orientation": [math.sin(0.61), 0.0, 0.0, math.cos(0.61)]}, True),
        ({"base_position": [0.0, 0.0, FOOTING.fall_height + 0.001]}, False),
        ({"base_position": [0.0, 0.0, FOOTING.fall_height - 0.001]}, True),
        ({"ground_height": [0.0, 0.3, 0.0, 0.0]}, True),
    ],
)
def test_it_falls_once_by_its_tilt_or_its_height(fields: dict[str, Any], falls: bool) -> None:
    record, seen = begun(), truth(**fields)
    tick(record, 0.5, seen)
    assert record_fall(seen, record, given(), constants()) is falls
    assert record.fall_time == (0.5 if falls else NEVER)
    if falls:
        height = seen.base_position[2] - seen.ground_height.max()
        assert record.fall_height == pytest.approx(height)
        tick(record, 0.51, seen)
        assert not record_fall(seen, record, given(), constants())
        assert record.fall_time == 0.5


def stand(
    record: StandRecord, time: float, shift: tuple[float, float] = (0.0, 0.0), touched: Any = ALL,
    stay: bool = True, **changes: Any,
) -> None:  # fmt: skip
    seen = truth(contact_position=np.add(POINTS, (*shift, 0.0)), contact_touched=touched)
    tick(record, time, seen)
    record_feet(seen, record, given(**changes), constants(), stay)


def test_feet_slide_from_where_they_are_when_they_should_stay() -> None:
    record = begun()
    stand(record, 0.01, (0.2, 0.0), stay=False)
    assert record.foot_slip == 0.0
    stand(record, 0.02, (0.203, -0.004))
    assert record.foot_slip == pytest.approx(0.005)
    stand(record, 0.03, (0.2, 0.0))
    assert record.foot_slip == pytest.approx(0.005), "the farthest counts"


@pytest.mark.parametrize(("clearance", "height", "lifted"), [
    (-1.0, 0.0, 0.01), (0.01, 0.009, 0.0), (0.01, 0.011, 0.01),
])  # fmt: skip
def test_on_uneven_ground_a_foot_near_it_may_stand_between_its_points(
    clearance: float, height: float, lifted: float
) -> None:
    record, known = begun(), constants()
    known.clearance[()] = clearance
    above = np.array([height, 0.05, 0.0, 0.0])
    seen = truth(
        contact_position=np.add(POINTS, np.outer(above, [0.0, 0.0, 1.0])),
        contact_touched=[False, False, True, True],
    )
    tick(record, 0.01, seen)
    record_feet(seen, record, given(), known, True)
    assert record.lifted_time.tolist() == pytest.approx([lifted, 0.0])


RIGHT_UP = np.array([False, False, True, True])
HEEL_UP = np.array([True, False, True, True])


def test_a_foot_is_off_the_ground_where_none_of_its_points_is_loaded() -> None:
    record = begun()
    stand(record, 0.01, stay=False)
    for k, touched in enumerate((RIGHT_UP, RIGHT_UP, RIGHT_UP, HEEL_UP, RIGHT_UP)):
        stand(record, 0.02 + 0.01 * k, touched=touched)
    assert record.longest_lift == pytest.approx(0.03)
    assert record.lifted_time == pytest.approx(np.array([0.01, 0.0]))
    assert record.steps == 0


def test_a_step_that_is_allowed_moves_the_foot_and_no_other_one_does() -> None:
    record = begun()
    stand(record, 0.01, stay=False, steps=1)
    for k in range(6):
        stand(record, 0.02 + 0.01 * k, (0.02 * k, 0.0), touched=RIGHT_UP, steps=1)
    assert record.steps == 1 and record.step_end[0] == pytest.approx(0.07)
    assert record.step_end[1] == 0.0
    assert record.longest_lift == pytest.approx(0.02), "the rest of it was the step"
    landed = record.foot_slip.item()
    assert landed == pytest.approx(0.1), "the left foot slid along"
    stand(record, 0.21, (0.3, 0.0), steps=1)
    assert record.landed_foot[0, 0] == pytest.approx(0.31), "it settles"
    assert record.landed_foot[1, 0] == pytest.approx(0.01)
    for k in range(4):
        stand(record, 0.3 + 0.01 * k, (0.3, 0.0), touched=RIGHT_UP, steps=1)
    assert record.steps == 1
    assert record.longest_lift == pytest.approx(0.04)


def test_how_it_rests() -> None:
    record = begun()
    force = np.array([[0.0, 0.0, load] for load in (2.0, 3.0, 20.0, 25.0)])
    seen = truth(
        base_orientation=[0.0, math.sin(0.02), 0.0, math.cos(0.02)], com_velocity=[0.01, -0.02, 0.02],
        base_angular_velocity=[0.2, 0.1, -0.2], contact_force=force, contact_touched=HEEL_UP,
        com=[0.03, 0.02, 0.3],
    )  # fmt: skip
    tick(record, 1.5, seen)
    record_rest(seen, record, constants())
    assert record.judged_time == 1.5
    assert record.tilt == pytest.approx(0.04)
    assert record.com_speed == pytest.approx(0.03)
    assert record.angular_speed == pytest.approx(0.3)
    assert record.points_unloaded == 1
    assert record.load_share == pytest.approx(5.0 / FOOTING.weight)
    assert record.margin == pytest.approx(0.02)
