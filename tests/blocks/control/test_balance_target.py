"""The target follows the plan with the feet, then brings the robot to rest over them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.control.balance_target import BalanceTarget
from aloft.blocks.signals import Phase
from aloft.mathematics.interpolation import lengthen
from aloft.mathematics.rotations import to_matrix
from aloft.runtime.testing import BlockBench

from ...robots.limbed_robots import quadruped

FEET = np.array([[0.0, -0.08, 0.0], [0.0, 0.08, 0.0]])
LEVEL = [0.0, 0.0, 0.0, 1.0]
STANDING = 0.33


def about(axis, angle):
    out = np.zeros(4)
    out[axis], out[3] = math.sin(angle / 2), math.cos(angle / 2)
    return out


def matrix(quaternion):
    out = np.zeros((3, 3))
    to_matrix(np.array(quaternion), out)
    return out


def make(**params):
    """Standing in the first tick, exactly as planned."""
    bench = BlockBench(BalanceTarget, params, robot="bruce")
    bench.set("reference", com=[0.0, 0.0, STANDING], orientation=LEVEL, foot_position=FEET)
    bench.set("terms", foot_position=FEET, base_rotation=np.eye(3))
    bench.set("terms", foot_rotation=np.stack([np.eye(3)] * 2))
    bench.step()
    return bench


def test_before_lift_off_it_is_the_plan():
    bench = make()
    values = {
        "com": [0.01, 0.0, 0.25], "com_velocity": [0.1, 0.2, 1.0],
        "com_acceleration": [1.0, 2.0, 20.0], "angular_velocity": [0.0, -9.0, 0.0],
        "angular_acceleration": [0.0, 50.0, 1.0],
        "angular_momentum": [0.0, 0.02, 0.0], "angular_momentum_rate": [0.0, 0.3, 0.0],
        "joint_position": np.arange(10.0), "joint_velocity": -np.arange(10.0),
        "joint_acceleration": 3.0 * np.arange(10.0),
    }  # fmt: skip
    bench.set("phase", phase=Phase.THRUST)
    bench.set("reference", orientation=about(1, 0.4), **values)
    bench.step()
    target = bench.get("target")
    for name, value in values.items():
        assert getattr(target, name) == pytest.approx(value, abs=1e-12)
    assert target.orientation == pytest.approx(about(1, 0.4), abs=1e-12)


def test_the_plan_moves_and_turns_with_the_measured_feet():
    """Feet drifted by (0.3, -0.2, 0.01) and turned left by 0.5 rad carry the whole plan along."""
    bench, turn = make(), matrix(about(2, 0.5))
    feet = FEET @ turn.T + [0.3, -0.2, 0.01]
    bench.set("terms", foot_position=feet, foot_rotation=np.stack([turn] * 2))
    bench.set("phase", phase=Phase.SQUAT)
    bench.set("reference", com=[0.02, 0.01, 0.3], com_velocity=[0.1, 0.0, 0.5])
    bench.set("reference", orientation=about(1, 0.4))
    bench.step()
    target = bench.get("target")
    assert target.com == pytest.approx(turn @ [0.02, 0.01, 0.3] + [0.3, -0.2, 0.01], abs=1e-12)
    assert target.com_velocity == pytest.approx(turn @ [0.1, 0.0, 0.5], abs=1e-12)
    assert matrix(target.orientation) == pytest.approx(turn @ matrix(about(1, 0.4)), abs=1e-12)


def test_after_touchdown_it_holds_low_over_the_middle_of_the_feet():
    bench = make(landing_depth=0.06, trim_rate=0.0)
    turn = matrix(about(2, -0.3))
    feet = np.array([[0.11, -0.06, 0.002], [0.09, 0.1, 0.0]])
    bench.set("terms", foot_position=feet, foot_rotation=np.stack([turn] * 2))
    bench.set("phase", phase=Phase.LANDING, time_in_phase=0.1)
    bench.step()
    target = bench.get("target")
    assert target.com == pytest.approx([0.1, 0.02, 0.001 + STANDING - 0.06], abs=1e-12)
    assert (target.com_velocity == 0.0).all()
    assert target.orientation == pytest.approx(about(2, -0.3), abs=1e-12)
    for name in (
        "angular_velocity", "angular_acceleration", "angular_momentum", "angular_momentum_rate",
    ):  # fmt: skip
        assert (getattr(target, name) == 0.0).all()


def test_recovery_rises_to_standing_height_with_consistent_derivatives():
    bench, heights = make(landing_depth=0.06, rise_time=0.6), {}
    for time in (0.0, 0.2 - 1e-4, 0.2, 0.2 + 1e-4, 0.6, 2.0):
        bench.set("phase", phase=Phase.RECOVER, time_in_phase=time)
        bench.step()
        target = bench.get("target")
        heights[time] = [
            float(x[2]) for x in (target.com, target.com_velocity, target.com_acceleration)
        ]
    assert heights[0.0] == pytest.approx([STANDING - 0.06, 0.0, 0.0], abs=1e-12)
    assert heights[0.6] == heights[2.0] == pytest.approx([STANDING, 0.0, 0.0], abs=1e-12)
    below, here, above = (heights[t][0] for t in (0.2 - 1e-4, 0.2, 0.2 + 1e-4))
    assert heights[0.2][1] == pytest.approx((above - below) / 2e-4, rel=1e-5)
    assert heights[0.2][2] == pytest.approx((above - 2 * here + below) / 1e-8, rel=1e-2)


def test_trim_integrates_a_steady_tilt_away_and_stops_at_its_limit():
    bench = make(trim_rate=1.0, trim_limit=0.05)
    bench.set("terms", base_rotation=matrix(about(1, 0.02)))
    bench.set("phase", phase=Phase.RECOVER)
    bench.step(250)
    # Half a second of 0.02 rad/s, against the tilt.
    assert bench.get("memory").trim == pytest.approx([0.0, -0.01, 0.0], abs=1e-9)
    assert bench.get("target").orientation == pytest.approx(about(1, -0.01), abs=1e-9)
    bench.step(2500)
    assert bench.get("memory").trim == pytest.approx([0.0, -0.05, 0.0], abs=1e-12)


def test_trim_leaves_the_heading_alone():
    bench = make(trim_rate=5.0)
    bench.set("terms", base_rotation=matrix(about(2, 0.1)))
    bench.set("phase", phase=Phase.RECOVER)
    bench.step(100)
    assert bench.get("memory").trim == pytest.approx(np.zeros(3), abs=1e-12)
    assert bench.get("target").orientation == pytest.approx(LEVEL, abs=1e-12)


@pytest.mark.parametrize(("lift_off", "height"), [(0.9, 0.3), (0.5, STANDING - 0.06)])
def test_between_two_flights_it_is_the_plan_too(lift_off, height):
    bench = make(landing_depth=0.06)
    bench.set("phase", phase=Phase.LANDING)
    bench.set("reference", time=0.8, lift_off_time=lift_off, com=[0.0, 0.0, 0.3])
    bench.step()
    assert float(bench.get("target").com[2]) == pytest.approx(height)


def thrust(share, turn=0.0, **params):
    """The target at that share of a thrust of 0.25 s, of a plan that is all zero."""
    bench, rotation = make(**params), matrix(about(2, turn))
    bench.set("terms", foot_position=FEET, foot_rotation=np.stack([rotation] * 2))
    bench.set("phase", phase=Phase.THRUST, time_in_phase=0.25 * share)
    bench.set("reference", time=1.0 + 0.25 * share, lift_off_time=1.25, com=np.zeros(3))
    bench.step()
    return bench.get("target")


def test_corrections_grow_through_the_thrust_with_consistent_derivatives():
    velocity, momentum, step = [0.04, -0.02, 0.01], [0.03, -0.01, 0.02], 1e-4
    corrections = {"velocity_correction": velocity, "momentum_correction": momentum}
    below, here, above = (thrust(share, **corrections) for share in (0.6 - step, 0.6, 0.6 + step))
    for value, rate in (
        ("com", "com_velocity"), ("com_velocity", "com_acceleration"),
        ("angular_momentum", "angular_momentum_rate"),
    ):  # fmt: skip
        found = (getattr(above, value) - getattr(below, value)) / (0.25 * 2.0 * step)
        assert getattr(here, rate) == pytest.approx(found, rel=1e-6)
    start, end = thrust(0.0, **corrections), thrust(1.0, **corrections)
    assert start.com_velocity == pytest.approx(np.zeros(3))
    assert start.angular_momentum == pytest.approx(np.zeros(3))
    assert end.com_velocity == pytest.approx(velocity)
    assert end.angular_momentum == pytest.approx(momentum)


def test_corrections_turn_with_the_feet():
    ahead = thrust(1.0, turn=math.pi / 2, velocity_correction=[0.04, 0.0, 0.0])
    assert ahead.com_velocity == pytest.approx([0.0, 0.04, 0.0], abs=1e-12)
    pitch = thrust(1.0, turn=math.pi / 2, momentum_correction=[0.0, -0.01, 0.0])
    assert pitch.angular_momentum == pytest.approx([0.01, 0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("phase", [Phase.SQUAT, Phase.FLIGHT])
def test_nothing_is_corrected_outside_the_thrust(phase):
    bench = make(velocity_correction=[0.04, 0.0, 0.0], momentum_correction=[0.0, -0.01, 0.0])
    bench.set("phase", phase=phase, time_in_phase=0.1)
    bench.set("reference", lift_off_time=1.0, com_velocity=np.zeros(3))
    bench.step()
    assert (bench.get("target").com_velocity == 0.0).all()
    assert (bench.get("target").angular_momentum == 0.0).all()


def before_lift_off(bench, time, place):
    """A tick of a thrust that lifts off at 1 s for 0.25 s, the feet at ``place`` and turned a bit."""
    bench.set("phase", phase=Phase.THRUST)
    bench.set("reference", time=time, lift_off_time=1.0, touchdown_time=1.25)
    bench.set("reference", com=[0.0, 0.0, 0.3], com_velocity=[0.1, 0.0, 0.8])
    bench.set("terms", foot_position=np.add(FEET, [*place, 0.0]))
    bench.step()
    return bench.get("target")


@pytest.mark.parametrize("time", [0.5, 0.85, 0.95, 1.0])
def test_feet_in_their_place_leave_the_plan_as_it_is(time):
    plain, fed_back = (
        before_lift_off(make(place_gain=gain), time, (0.0, 0.0)) for gain in (0.0, 1.0)
    )
    for name in type(fed_back).fields:
        assert getattr(fed_back, name).tobytes() == getattr(plain, name).tobytes(), name


@pytest.mark.parametrize(("place", "limit"), [((0.01, -0.02), 0.1), ((-0.2, 0.1), 0.03)])
def test_a_jump_is_lengthened_by_what_the_feet_are_off_their_place(place, limit):
    """At touchdown, after the change of place and velocity at lift-off, by the gain or the limit."""
    bench = make(place_gain=0.5, place_limit=limit, place_time=0.2)
    before_lift_off(bench, 0.7, place)
    target = before_lift_off(bench, 1.0, place)
    moved = target.com[:2] - place + 0.25 * (target.com_velocity[:2] - [0.1, 0.0])
    size = min(0.5 * math.hypot(*place), limit)
    assert moved == pytest.approx(-size * np.array(place) / math.hypot(*place), abs=1e-12)
    assert target.com[2] == 0.3
    assert target.com_velocity[2] == 0.8


def test_what_is_made_up_for_is_settled_when_it_begins():
    bench = make(place_gain=0.5, place_time=0.2)
    before_lift_off(bench, 0.7, (0.01, 0.0))
    speed = float(before_lift_off(bench, 1.0, (0.01, 0.0)).com_velocity[0])
    assert float(before_lift_off(bench, 1.0, (0.02, 0.0)).com_velocity[0]) == speed


def test_the_place_is_the_plans_in_the_world_of_the_first_tick():
    """A start turned and away from the origin; a plan that has come ahead of it by 0.1 m."""
    turn, start = matrix(about(2, 0.5)), np.array([0.3, -0.2, 0.0])
    bench = BlockBench(BalanceTarget, {"place_gain": 1.0, "place_time": 0.2}, robot="bruce")
    bench.set("reference", com=[0.0, 0.0, STANDING], orientation=LEVEL, foot_position=FEET)
    feet = FEET @ turn.T + start
    bench.set("terms", foot_position=feet, base_rotation=turn, foot_rotation=np.stack([turn] * 2))
    bench.step()
    ahead = turn @ [0.1, 0.0, 0.0]
    bench.set("reference", foot_position=np.add(FEET, [0.1, 0.0, 0.0]))
    bench.set("terms", foot_position=feet + ahead)
    bench.set("reference", time=0.7, lift_off_time=1.0, touchdown_time=1.25)
    bench.set("phase", phase=Phase.THRUST)
    bench.step()
    assert bench.get("memory").off_place == pytest.approx(np.zeros(3), abs=1e-12)
    bench.set("terms", foot_position=feet + ahead + [0.01, 0.02, 0.0])
    bench.step()
    assert bench.get("memory").off_place == pytest.approx([0.01, 0.02, 0.0], abs=1e-12)


@given(
    share=st.floats(0.01, 0.99),
    x=st.floats(-0.5, 0.5),
    y=st.floats(-0.5, 0.5),
    gain=st.floats(0.0, 1.0),
)
def test_the_lengthening_is_one_motion_and_bounded(share, x, y, gain):
    """Velocity and acceleration are the derivatives of the place; no way is beyond the limit."""
    step, flight, duration, limit = 1e-5, 0.25, 0.2, 0.03

    def added(u):
        motion = np.zeros((3, 3))
        lengthen(np.array([x, y, 0.0]), gain, limit, flight, duration, u, *motion)
        return motion

    before, now, after = (added(share + k * step / duration) for k in (-1, 0, 1))
    for k in range(2):
        assert now[k + 1] == pytest.approx((after[k] - before[k]) / (2 * step), abs=1e-4)
    place, velocity, _ = added(1.0)
    assert math.hypot(*(place + flight * velocity)) <= limit + 1e-12


SQUARE = np.array([[0.2, 0.15, 0.0], [0.2, -0.15, 0.0], [-0.2, 0.15, 0.0], [-0.2, -0.15, 0.0]])


def turned(points, angle):
    cosine, sine = math.cos(angle), math.sin(angle)
    return points @ np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def make_quadruped(calves):
    """Four point feet whose links head anywhere; standing in the first tick as planned."""
    bench = BlockBench(BalanceTarget, robot=quadruped())
    bench.set("reference", com=[0.0, 0.0, 0.3], orientation=LEVEL, foot_position=SQUARE)
    bench.set("terms", foot_position=SQUARE, base_rotation=np.eye(3), foot_rotation=calves)
    bench.step()
    return bench


def test_point_feet_head_as_their_pattern_does():
    calves = np.stack([matrix(about(2, 0.7 * k)) @ matrix(about(1, 1.9)) for k in range(4)])
    bench = make_quadruped(calves)
    where = turned(SQUARE, 0.3) + np.array([0.5, -0.2, 0.0])
    bench.set("terms", foot_position=where)
    bench.set("reference", com=[0.02, 0.0, 0.3], com_velocity=[1.0, 0.0, 0.0])
    bench.step()
    target = bench.get("target")
    lean = np.array([0.02 * math.cos(0.3), 0.02 * math.sin(0.3), 0.3])
    assert target.com == pytest.approx(np.array([0.5, -0.2, 0.0]) + lean, abs=1e-12)
    assert target.com_velocity == pytest.approx([math.cos(0.3), math.sin(0.3), 0.0], abs=1e-12)
    assert target.orientation == pytest.approx(about(2, 0.3), abs=1e-12)


def test_after_touchdown_four_feet_carry_the_body_over_their_middle():
    bench = make_quadruped(np.stack([np.eye(3)] * 4))
    where = turned(SQUARE, -0.2) + np.array([0.1, 0.3, 0.02])
    where[0] += [0.02, 0.0, 0.0]
    bench.set("terms", foot_position=where, base_rotation=matrix(about(2, -0.2)))
    bench.set("phase", phase=Phase.LANDING)
    bench.step()
    target = bench.get("target")
    assert target.com == pytest.approx([0.105, 0.3, 0.02 + 0.3 - 0.06], abs=1e-12)
    assert 2.0 * math.asin(target.orientation[2]) == pytest.approx(-0.2, abs=0.03)


def test_a_single_point_foot_heads_as_its_base_does():
    robot = quadruped()
    hopper = robot.model_copy(update={"feet": robot.feet[:1], "contacts": robot.contacts[:1]})
    bench = BlockBench(BalanceTarget, robot=hopper)
    bench.set("reference", com=[0.0, 0.0, 0.3], orientation=LEVEL, foot_position=SQUARE[:1])
    turn = matrix(about(2, 0.4))
    bench.set("terms", foot_position=SQUARE[:1], base_rotation=turn, foot_rotation=np.eye(3)[None])
    bench.step()
    assert bench.get("target").orientation == pytest.approx(about(2, 0.4), abs=1e-12)
