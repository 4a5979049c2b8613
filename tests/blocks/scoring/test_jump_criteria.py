"""How far feet have turned, also around half a turn, where left and right are the same."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.scoring.jump_criteria import (
    JumpCriteria,
    JumpRecord,
    feet_moved,
    feet_turned,
    first_failure,
    mean_turn,
)
from aloft.blocks.scoring.standing import NEVER


def directions(*angles: float) -> np.ndarray:
    return np.array([[math.cos(angle), math.sin(angle)] for angle in angles])


@pytest.mark.parametrize("turn", [0.0, 1.0, -2.0, math.pi - 0.001, math.pi, -math.pi + 0.001])
@pytest.mark.parametrize("apart", [0.0, 0.02, -0.02])
def test_the_mean_is_between_the_feet(turn: float, apart: float) -> None:
    found = mean_turn(directions(0.3, 0.4), directions(0.3 + turn - apart, 0.4 + turn + apart))
    assert math.remainder(found - turn, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(-math.pi, math.pi), st.floats(-1.5, 1.5), st.floats(-math.pi, math.pi))
def test_where_the_feet_started_from_does_not_count(
    turn: float, apart: float, start: float
) -> None:
    found = mean_turn(directions(start, start), directions(start + turn, start + turn + apart))
    assert math.remainder(found - turn - apart / 2.0, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)


LIMITS = JumpCriteria(load_share=0.2, fall_height=0.1)


def good_jump() -> JumpRecord:
    """A record in which every criterion holds: 0.2 m ahead, 0.1 m to the left, turned by half a radian."""
    record = JumpRecord.allocate({"n_feet": 2})
    for name in ("fall_time", "forbidden_time"):
        getattr(record, name)[()] = NEVER
    values: dict[str, object] = {
        "now": 4.0, "standing_height": 0.4, "apex_height": 0.5, "lift_off_time": 1.0,
        "touchdown_time": 1.3, "lift_off_speed": 1.5, "judged_time": 2.8, "load_share": 0.45,
        "margin": 0.02, "planned_flight": 0.3, "planned_speed": 1.5, "planned_speed_time": 1.0,
        "planned_standing": 0.41, "planned_apex": 0.51, "planned_yaw_start": 0.1, "planned_yaw": 0.6,
        "start_foot": [[0.0, 0.1], [0.0, -0.1]], "foot": [[0.2, 0.2], [0.2, 0.0]],
        "start_direction": directions(0.2, 0.2), "direction": directions(0.7, 0.7),
        "planned_start": [[0.5, 0.1], [0.5, -0.1]], "planned_foot": [[0.7, 0.2], [0.7, 0.0]],
    }  # fmt: skip
    for name, value in values.items():
        getattr(record, name)[...] = value
    return record


def test_a_jump_in_which_all_is_well_has_no_failure() -> None:
    record = good_jump()
    assert feet_moved(record) == pytest.approx((0.2, 0.1))
    assert feet_turned(record) == pytest.approx(0.5)
    assert first_failure(record, LIMITS, planned=True) is None
    assert first_failure(record, LIMITS, planned=False) is None


BOUNDS: list[tuple[str, float, float, str]] = [
    ("fall_time", NEVER, 0.5, "fell at"),
    ("forbidden", 0, 1, "other than the contact points"),
    ("lift_off_time", 1.0, NEVER, "never left the ground"),
    ("touchdown_time", 1.3, NEVER, "no touchdown"),
    ("planned_speed_time", 1.0, NEVER, "no lift-off"),
    ("touchdown_time", 1.271, 1.269, "is below 90% of the planned"),
    ("lift_off_speed", 1.36, 1.34, "is not within 10% of the planned"),
    ("lift_off_speed", 1.64, 1.66, "is not within 10% of the planned"),
    ("violation", 0.0, 1e-6, "over its limit"),
    ("overload", 1e-9, 2e-9, "more than its speed allows"),
    ("judged_time", 2.8, NEVER, "the run ended"),
    ("peak_tilt", math.radians(14.9), math.radians(15.1), "after touchdown, limit 15 deg"),
    ("tilt", math.radians(4.9), math.radians(5.1), "tilt at rest"),
    ("com_speed", 0.049, 0.051, "moves at"),
    ("angular_speed", 0.19, 0.21, "turns at"),
    ("points_unloaded", 0, 1, "carry no load"),
    ("load_share", 0.21, 0.19, "of the weight at rest"),
    ("margin", 0.0101, 0.0099, "inside the support"),
    ("longest_lift", 0.02, 0.021, "stepped"),
    ("foot_slip", 0.0049, 0.0051, "feet slid"),
    ("apex_height", 0.509, 0.511, "rose"),
    ("apex_height", 0.491, 0.489, "rose"),
    ("planned_yaw", 0.6 + math.radians(4.9), 0.6 + math.radians(5.1), "turned"),
    ("planned_yaw", 0.6 - math.radians(4.9), 0.6 - math.radians(5.1), "turned"),
    ("planned_yaw", 0.6 + math.tau, 0.6 + math.tau + 0.1, "turned"),
    ("ground_low", -0.9e-6, -1.1e-6, "above ground"),
    ("ground_high", 0.9e-6, 1.1e-6, "above ground"),
]


@pytest.mark.parametrize(("name", "good", "bad", "text"), BOUNDS)
def test_every_criterion_fails_by_itself_at_its_bound(
    name: str, good: float, bad: float, text: str
) -> None:
    record = good_jump()
    getattr(record, name)[()] = good
    assert first_failure(record, LIMITS, planned=True) is None
    getattr(record, name)[()] = bad
    assert text in (first_failure(record, LIMITS, planned=True) or "nothing")


@pytest.mark.parametrize(("axis", "away"), [(0, 0.019), (1, 0.019), (0, -0.019), (1, -0.019)])
def test_feet_may_land_within_a_tolerance_of_their_goal(axis: int, away: float) -> None:
    for factor, near in ((1.0, True), (1.1, False)):
        planned, asked = good_jump(), [0.2, 0.1]
        planned.planned_foot[:, axis] += factor * away
        asked[axis] += factor * away
        limits = LIMITS.model_copy(update={"distance": asked})
        for failure in (
            first_failure(planned, LIMITS, planned=True),
            first_failure(good_jump(), limits, planned=False),
        ):
            assert (failure is None) == near
            assert near or "jumped (200.0, 100.0) mm" in str(failure)


def test_targets_that_are_given_count_before_those_of_the_plan() -> None:
    for update, fails in (
        ({"rise": 0.1, "yaw": 0.5}, False), ({"rise": 0.12}, True), ({"yaw": -0.5}, True),
        ({"landing_height": 0.05}, True),
    ):  # fmt: skip
        limits = LIMITS.model_copy(update=update)
        for planned in (True, False):
            assert (first_failure(good_jump(), limits, planned) is not None) == fails
