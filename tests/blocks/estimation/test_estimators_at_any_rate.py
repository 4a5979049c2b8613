"""Estimators whose gains are per second, that begin in a step, and that learn nothing from a few ticks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from aloft.blocks.estimation.complementary_filter import ComplementaryFilter
from aloft.blocks.estimation.invariant_kalman_filter import InvariantKalmanFilter
from aloft.blocks.estimation.state_estimator import StateEstimator
from aloft.mathematics.constants import GRAVITY
from aloft.robots.description import find_robot
from aloft.runtime.testing import BlockBench

from ...turns import quaternion_of, turn_between

ROBOT = find_robot("bruce")
FOOT = np.asarray(ROBOT.foot_of_contact())
RATES = [100.0, 250.0, 500.0, 1000.0, 2000.0]


def standing(kind, rate=500.0, active=True, **params):
    bench = BlockBench(kind, params, robot="bruce", rate=rate)
    bench.set("joints", position=ROBOT.standing_position)
    bench.set("imu", specific_force=[0.0, 0.0, GRAVITY])
    bench.set("contacts", active=active)
    bench.step()
    return bench


def tilt_of(bench):
    return float(
        np.abs(turn_between(bench.get("base").orientation, quaternion_of(np.zeros(3)))).max()
    )


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("kind", [StateEstimator, ComplementaryFilter])
def test_a_wrong_velocity_fades_in_the_same_time_at_any_rate(kind, rate):
    bench = standing(kind, rate)
    bench.set("estimate", velocity=[0.02, 0.0, 0.0])
    bench.step(round(0.1 * rate))
    assert bench.get("base").linear_velocity[0] == pytest.approx(0.02 * math.exp(-1.5), rel=0.1)


@pytest.mark.parametrize("rate", RATES)
def test_the_velocity_corrects_the_tilt_on_one_foot_at_any_rate(rate):
    """The accelerometer is not asked, for a robot on one foot may be accelerated."""
    bench = standing(StateEstimator, rate)
    bench.set("contacts", active=FOOT == 0)
    bench.step()
    start = quaternion_of(np.array([0.03, -0.02, 0.0]))
    bench.set("estimate", orientation=start)
    before = tilt_of_estimate(start)
    bench.step(round(1.0 * rate))
    assert 0.2 * before < tilt_of(bench) < 0.6 * before
    bench.step(round(4.0 * rate))
    assert tilt_of(bench) < 0.05 * before


def tilt_of_estimate(orientation):
    return float(np.abs(turn_between(orientation, quaternion_of(np.zeros(3)))).max())


@pytest.mark.parametrize("rate", RATES)
def test_no_bias_is_believed_after_a_few_ticks(rate):
    """A log of a walk had 26 ms of double support, from which 2.1 rad/s were learnt."""
    bench = standing(StateEstimator, rate)
    bench.set("imu", angular_velocity=[0.6, -0.4, 1.0])
    bench.step(max(round(0.026 * rate), 1))
    bench.set("contacts", active=FOOT == 0)
    bench.set("imu", angular_velocity=[0.0, 0.0, 0.0])
    bench.step(round(0.5 * rate))
    assert np.abs(bench.get("estimate").gyro_bias).max() < 0.031


@pytest.mark.parametrize("rate", RATES)
def test_a_bias_is_learnt_from_a_second_of_standing(rate):
    bench = standing(StateEstimator, rate)
    bench.set("imu", angular_velocity=[0.01, -0.008, 0.006])
    bench.step(round(2.0 * rate))
    assert bench.get("estimate").gyro_bias == pytest.approx([0.01, -0.008, 0.006], abs=1e-3)


@pytest.mark.parametrize("rate", RATES)
def test_after_a_step_the_heading_is_that_of_the_new_stance(rate):
    """A walk in a curve is not pulled back to the heading of the first stance."""
    bench = standing(StateEstimator, rate)
    bench.step(round(0.5 * rate))
    bench.set("contacts", active=FOOT == 0)
    bench.set("imu", angular_velocity=[0.0, 0.0, 0.5])
    bench.step(round(0.4 * rate))
    bench.set("contacts", active=True)
    bench.set("imu", angular_velocity=[0.0, 0.0, 0.0])
    bench.step(round(3.0 * rate))
    assert turn_between(
        bench.get("base").orientation, quaternion_of(np.array([0.0, 0.0, 0.2]))
    ) == pytest.approx(np.zeros(3), abs=0.01)


@pytest.mark.parametrize("kind", [StateEstimator, ComplementaryFilter, InvariantKalmanFilter])
def test_a_log_may_begin_in_a_step(kind):
    """One foot is in the air, half a foot above the ground: the tilt is not taken from it."""
    bench = BlockBench(kind, robot="bruce")
    joints = np.array(ROBOT.standing_position)
    knee = [k for k, joint in enumerate(ROBOT.joints) if "left_knee" in joint.name]
    joints[knee] -= 0.6
    speed = np.zeros(len(joints))
    speed[knee] = 2.0
    bench.set("joints", position=joints, velocity=speed)
    bench.set("imu", specific_force=[0.0, 0.0, GRAVITY])
    right = np.array([ROBOT.feet[foot].name.startswith("right") for foot in FOOT])
    bench.set("contacts", active=right)
    bench.step()
    assert tilt_of(bench) < 0.02
    lowest = bench.get("base").position[2]
    assert lowest == pytest.approx(0.38, abs=0.01), "the foot that stands is on the ground"


def test_a_start_in_a_step_is_told_and_a_start_at_rest_is_not():
    bench = BlockBench(StateEstimator, robot="bruce")
    bench.set("joints", position=ROBOT.standing_position, velocity=1.0)
    bench.set("imu", specific_force=[0.0, 0.0, GRAVITY])
    bench.set("contacts", active=FOOT == 0)
    assert not bench.block.warnings()
    bench.step()
    assert "began while the robot was stepping" in bench.block.warnings()[0]
    assert not standing(StateEstimator).block.warnings()


def test_a_robot_that_moves_on_both_feet_does_not_stand_at_the_start():
    bench = BlockBench(StateEstimator, robot="bruce")
    speed = [-0.6 if "knee" in joint.name else 0.0 for joint in ROBOT.joints]
    bench.set("joints", position=ROBOT.standing_position, velocity=speed)
    bench.set("imu", specific_force=[0.0, 0.0, GRAVITY])
    bench.set("contacts", active=True)
    bench.step()
    assert "began while the robot was stepping" in bench.block.warnings()[0]
    assert np.abs(bench.get("base").linear_velocity).max() > 0.01, "the legs give the velocity"


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("rests", [False, True])
def test_a_slow_start_in_a_step_is_noticed_when_a_foot_leaves(rate, rests):
    """A robot shifts its weight before a step, more slowly than sensors shake at rest."""
    bench = BlockBench(StateEstimator, robot="bruce", rate=rate)
    bench.set("joints", position=ROBOT.standing_position, velocity=0.3)
    bench.set("imu", specific_force=[0.0, 0.0, GRAVITY])
    bench.set("contacts", active=True)
    bench.step()
    bench.set("joints", velocity=0.0 if rests else 0.3)
    bench.step(round(0.15 * rate))
    assert not bench.block.warnings()
    bench.set("contacts", active=FOOT == 0)
    bench.step()
    assert bool(bench.block.warnings()) == (not rests)
    assert (bench.get("trust").age < 0.1) == (not rests)


def test_feet_that_roll_open_the_gate_and_feet_that_stand_do_not():
    bench = standing(StateEstimator)
    bench.step(500)
    assert bench.get("trust").gate == pytest.approx(0.08, rel=0.01)
    bench.set("joints", velocity=[0.2 * (-1) ** k for k in range(len(ROBOT.joints))])
    bench.step(500)
    assert bench.get("trust").gate > 0.1


FLAT = find_robot("g1")
"""A robot whose soles have four points."""
HIP, ANKLE = (
    next(k for k, joint in enumerate(FLAT.joints) if f"right_{name}_pitch" in joint.name)
    for name in ("hip", "ankle")
)


RIGHT = np.array([FLAT.feet[foot].name == "right" for foot in FLAT.foot_of_contact()])


def stepping(rate=500.0, begin_speed=1.0, **params):
    """A robot that has begun on its right foot, in a step if it moves at ``begin_speed``."""
    bench = BlockBench(StateEstimator, params, robot="g1", rate=rate)
    speed = np.zeros(len(FLAT.joints))
    speed[0] = begin_speed
    bench.set("joints", position=FLAT.standing_position, velocity=speed)
    bench.set("imu", specific_force=[0.0, 0.0, GRAVITY])
    bench.set("contacts", active=RIGHT)
    bench.step()
    bench.set("joints", velocity=0.0)
    return bench


def shift_when_a_joint_yields(joint, angle, begin_speed=1.0, **params):
    """Distance [m] by which a base at rest seems to move while a joint of its stance leg yields in 0.4 s."""
    bench = stepping(begin_speed=begin_speed, **params)
    position, still = np.array(FLAT.standing_position), np.zeros(len(FLAT.joints))
    if begin_speed == 0.0:  # it stood on both feet, and lifts one
        bench.set("contacts", active=True)
        bench.step(100)
        bench.set("contacts", active=RIGHT)
    bench.step(250)
    before = np.array(bench.get("base").position)
    for tick in range(1, 201):
        phase = math.pi * tick / 400
        position[joint] = FLAT.standing_position[joint] + angle * math.sin(phase)
        speed = still.copy()
        speed[joint] = angle * math.pi / 0.8 * math.cos(phase)
        bench.set("joints", position=position, velocity=speed)
        bench.step()
    return float(np.linalg.norm(np.array(bench.get("base").position) - before))


def test_a_hip_that_yields_moves_a_base_that_began_in_a_step_by_less():
    """The sole seems to tilt by what no motor did, and the base to move by this times the leg's length."""
    rigid = shift_when_a_joint_yields(HIP, 0.02, flexion=0.0)
    assert rigid > 0.01
    assert shift_when_a_joint_yields(HIP, 0.02) < 0.65 * rigid
    assert shift_when_a_joint_yields(HIP, 0.02, flexion=1.0) < 0.45 * rigid


def test_an_ankle_that_yields_costs_less_than_a_hip_did():
    """Which joint has yielded is not known, so the share is a compromise."""
    rigid = shift_when_a_joint_yields(HIP, 0.02, flexion=0.0)
    assert shift_when_a_joint_yields(ANKLE, 0.02) < 0.7 * rigid


def test_a_sole_that_tilts_far_rolls_and_its_leg_has_not_yielded():
    far = shift_when_a_joint_yields(ANKLE, 0.5, flexion=0.0)
    assert shift_when_a_joint_yields(ANKLE, 0.5) == pytest.approx(far, abs=0.01)


def test_a_robot_that_stood_at_the_start_keeps_its_bits():
    stood = {"begin_speed": 0.0}
    assert shift_when_a_joint_yields(HIP, 0.02, flexion=1.0, **stood) == (
        shift_when_a_joint_yields(HIP, 0.02, flexion=0.0, **stood)
    )


def test_soles_may_be_kept_after_a_start_at_rest_too():
    stood = {"begin_speed": 0.0}
    without = shift_when_a_joint_yields(HIP, 0.02, **stood)
    assert without > 0.01
    assert shift_when_a_joint_yields(HIP, 0.02, keep_soles=True, **stood) < 0.65 * without


BIAS = np.array([0.01, -0.008, 0.006])


@pytest.mark.parametrize("rate", RATES)
def test_a_sole_that_stands_gives_the_gyroscopes_bias_after_a_start_in_a_step(rate):
    """Of all three axes: the sole keeps its heading, too. Without it the heading is off by 18 mrad."""
    bench = stepping(rate)
    moving = np.zeros(len(FLAT.joints))
    moving[-1] = 0.5  # an arm swings: the robot is not at rest
    bench.set("joints", velocity=moving)
    bench.set("imu", angular_velocity=BIAS)
    bench.step(round(3.0 * rate))
    assert bench.get("estimate").gyro_bias == pytest.approx(BIAS, abs=2.5e-3)
    assert tilt_of(bench) < 0.006


@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_a_leg_that_yields_gives_no_bias(rate):
    """Its sole seems to turn by a degree at each step; with rigid legs it would be the robot."""
    bench = stepping(rate)
    position = np.array(FLAT.standing_position)
    largest = 0.0
    for tick in range(round(3.0 * rate)):
        phase = 2 * math.pi * tick / (0.6 * rate)
        position[ANKLE] = FLAT.standing_position[ANKLE] + 0.0175 * math.sin(phase)
        speed = np.zeros(len(FLAT.joints))
        speed[ANKLE] = 0.0175 * 2 * math.pi / 0.6 * math.cos(phase)
        bench.set("joints", position=position, velocity=speed)
        bench.step()
        largest = max(largest, float(np.abs(bench.get("estimate").gyro_bias).max()))
    assert largest < 0.01
