from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aloft.hal.simulated.drives import (
    DriveTrain,
    MotorScratch,
    clip_joint_torque,
    drive_motors,
    joint_feedback_torque,
    motor_torque_limits,
)
from aloft.hal.simulated.state import TickRecord
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
KOALA = ROBOT.profiles["koala"]
SPEEDS = arrays(np.float64, 10, elements=st.floats(-60, 60))
TORQUES = arrays(np.float64, 10, elements=st.floats(-100, 100))


def limits(speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    lower, upper = np.empty_like(speed), np.empty_like(speed)
    peak, no_load = np.full_like(speed, KOALA.peak_torque), np.full_like(speed, KOALA.no_load_speed)
    slope = peak / (no_load - KOALA.corner_speed)
    motor_torque_limits(speed, peak, slope, no_load, lower, upper)
    return lower, upper


def test_curve_at_its_corners() -> None:
    lower, upper = limits(np.array([0.0, 18.0, 24.0, 30.0, 40.0, -18.0, -30.0, -40.0]))
    np.testing.assert_allclose(upper, [10.5, 10.5, 5.25, 0.0, 0.0, 10.5, 10.5, 10.5])
    np.testing.assert_allclose(lower, [-10.5, -10.5, -10.5, -10.5, -10.5, -10.5, 0.0, 0.0])


def test_every_motor_has_its_own_curve_and_one_without_torque_does_nothing() -> None:
    speed, lower, upper = np.array([0.0, 5.0, -5.0]), np.zeros(3), np.zeros(3)
    peak, no_load = np.array([2.0, 4.0, 0.0]), np.array([10.0, 6.0, 10.0])
    motor_torque_limits(speed, peak, peak / (no_load - 4.0), no_load, lower, upper)
    np.testing.assert_allclose(upper, [2.0, 2.0, 0.0])
    np.testing.assert_allclose(lower, [-2.0, -4.0, 0.0])


@given(SPEEDS)
def test_curve_is_symmetric_monotone_and_brakes_fully(speed: np.ndarray) -> None:
    lower, upper = limits(speed)
    mirrored_lower, mirrored_upper = limits(-speed)
    np.testing.assert_array_equal(lower, -mirrored_upper)
    np.testing.assert_array_equal(upper, -mirrored_lower)
    assert (upper[speed <= 18.0] == 10.5).all()
    assert (upper[speed >= 30.0] == 0.0).all()
    order = np.argsort(speed)
    assert (np.diff(upper[order]) <= 1e-12).all()


@settings(max_examples=60)
@given(SPEEDS, TORQUES)
def test_clipped_torque_is_within_the_motors_limits(speed: np.ndarray, torque: np.ndarray) -> None:
    lower, upper = limits(speed)
    wanted, motor = np.zeros(10), np.zeros(10)
    clipped = torque.copy()
    clip_joint_torque(
        clipped, ROBOT.torque_to_motor, ROBOT.joint_to_motor.T.copy(), lower, upper, wanted, motor
    )
    assert (motor <= upper).all() and (motor >= lower).all()
    np.testing.assert_allclose(ROBOT.torque_to_motor @ clipped, motor, atol=1e-12)
    untouched = (wanted <= upper) & (wanted >= lower)
    np.testing.assert_array_equal(motor[untouched], wanted[untouched])
    if untouched.all():
        np.testing.assert_allclose(clipped, torque, atol=1e-12)


def test_hip_pitch_has_two_motors_and_knee_extension_shares_its_motor_with_the_ankle() -> None:
    lower, upper = limits(np.zeros(10))
    wanted, motor = np.zeros(10), np.zeros(10)
    torque = np.array([0, 21.0, 0, 8.0, -5.0, 0, 0, 0, 0, 0])
    clip_joint_torque(
        torque, ROBOT.torque_to_motor, ROBOT.joint_to_motor.T.copy(), lower, upper, wanted, motor
    )
    assert torque[1] == 21.0
    # The knee's motor is asked for 13 N m, the sum of knee extension and plantarflexion.
    assert abs(wanted[3]) == 13.0
    assert torque[3] == 5.5 and torque[4] == -5.0


def test_joint_feedback_is_the_papers_law() -> None:
    random = np.random.default_rng(0)
    feedforward, stiffness, damping, target, rate, position, velocity = random.normal(size=(7, 10))
    out = np.zeros(10)
    joint_feedback_torque(feedforward, stiffness, damping, target, rate, position, velocity, out)
    expected = feedforward + stiffness * (target - position) + damping * (rate - velocity)
    np.testing.assert_allclose(out, expected, rtol=1e-14)


def test_a_step_of_the_motors_is_recorded_and_what_is_not_a_number_is_not_hidden() -> None:
    square = np.eye(3)
    motors = DriveTrain(square, square, square, np.full(3, 2.0), np.ones(3), np.full(3, 10.0))
    scratch = MotorScratch.allocate({"n_joints": 3})
    record = TickRecord.allocate({"n_joints": 3, "n_contacts": 1})
    record.torque_high[:] = record.speed_high[:] = -np.inf
    record.torque_low[:] = record.speed_low[:] = np.inf
    torque = np.array([1.0, -5.0, 0.5])
    drive_motors(np.array([9.5, 0.5, -0.5]), torque, motors, scratch, record)
    np.testing.assert_array_equal(torque, [0.5, -2.0, 0.5])
    drive_motors(np.zeros(3), np.ones(3), motors, scratch, record)
    np.testing.assert_array_equal(record.saturated, [1, 1, 0])
    np.testing.assert_array_equal(record.torque_high, [1.0, 1.0, 1.0])
    np.testing.assert_array_equal(record.torque_low, [0.5, -2.0, 0.5])
    np.testing.assert_array_equal(record.speed_high, [9.5, 0.5, 0.0])
    np.testing.assert_array_equal(record.overload, [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(record.joint_torque, [1.5, -1.0, 1.5])
    drive_motors(np.zeros(3), np.full(3, np.nan), motors, scratch, record)
    drive_motors(np.zeros(3), np.ones(3), motors, scratch, record)
    for found in (record.torque_high, record.torque_low, record.overload, record.joint_torque):
        assert np.isnan(found).all()
