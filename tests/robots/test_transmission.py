"""Joints to motors and back: nothing is lost, power is conserved, and gains that cannot be are said."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.robots.description import find_robot
from aloft.robots.transmission import (
    TransmissionMap,
    _non_negative_least_squares,
    motor_gains,
)

ROBOT = find_robot("bruce")
NAMES = [joint.name for joint in ROBOT.joints]
VALUES = st.lists(st.floats(-50.0, 50.0), min_size=10, max_size=10).map(np.array)


@given(VALUES, VALUES)
@settings(max_examples=50, deadline=None)
def test_motion_and_torque_come_back_and_power_is_conserved(
    velocity: np.ndarray, torque: np.ndarray
) -> None:
    transmission = TransmissionMap(ROBOT)
    motor_velocity, motor_torque, back = np.zeros(10), np.zeros(10), np.zeros(10)
    transmission.motor_motion(velocity, motor_velocity)
    transmission.motor_torque(torque, motor_torque)
    assert float(motor_velocity @ motor_torque) == pytest.approx(
        float(velocity @ torque), rel=1e-12, abs=1e-9
    )
    transmission.joint_motion(motor_velocity, back)
    np.testing.assert_allclose(back, velocity, rtol=1e-14, atol=1e-13)
    transmission.joint_torque(motor_torque, back)
    np.testing.assert_allclose(back, torque, rtol=1e-14, atol=1e-13)


def test_the_transmission_of_bruce_is_the_published_one() -> None:
    # Westwood's kinematics, right leg: th2 = (ph2 - ph3)/2, th3 = -(ph2 + ph3)/2, th4 = -ph4,
    # th5 = ph4 + ph5; k2 = (t2 - t3)/2, k3 = -(t2 + t3)/2, k4 = t5 - t4, k5 = t5
    transmission, out = TransmissionMap(ROBOT), np.zeros(10)
    motor = np.array([0.1, 0.2, 0.3, 0.4, 0.5] * 2)
    transmission.joint_motion(motor, out)
    np.testing.assert_allclose(out[:5], [-0.1, -0.05, -0.25, -0.4, 0.9], atol=1e-15)
    np.testing.assert_allclose(out[5:], [-0.1, -0.05, -0.25, 0.4, -0.9], atol=1e-15)
    torque = np.array([1.0, 2.0, 3.0, 4.0, 5.0] * 2)
    transmission.motor_torque(torque, out)
    np.testing.assert_allclose(out[:5], [-1.0, -0.5, -2.5, 1.0, 5.0], atol=1e-15)
    np.testing.assert_allclose(out[5:], [-1.0, -0.5, -2.5, -1.0, -5.0], atol=1e-15)


@given(st.lists(st.floats(0.0, 200.0), min_size=10, max_size=10).map(np.array))
@settings(max_examples=50, deadline=None)
def test_gains_that_motors_can_give_are_found_again(motor: np.ndarray) -> None:
    matrix = ROBOT.joint_to_motor
    joint = (matrix.T * motor) @ matrix
    if np.abs(joint - np.diag(np.diag(joint))).max() > 0.0:
        return  # these couple joints
    found = motor_gains(ROBOT, np.diag(joint).copy(), "N m/rad")
    np.testing.assert_allclose(found.joint, joint, atol=1e-9 * max(1.0, joint.max()))
    assert found.exact


def test_equal_gains_of_the_differential_are_exact() -> None:
    wanted = np.array([40.0, 60.0, 60.0, 60.0, 0.0] * 2)
    found = motor_gains(ROBOT, wanted, "N m/rad")
    assert found.exact
    np.testing.assert_allclose(found.motor, [40.0, 30.0, 30.0, 60.0, 0.0] * 2, atol=1e-9)


def test_what_is_lost_of_other_gains_is_said() -> None:
    wanted = np.array([40.0, 60.0, 60.0, 60.0, 15.0] * 2)
    found = motor_gains(ROBOT, wanted, "N m/rad")
    # least squares by hand: ankle motor x minimises (x/15 - 1)^2 + 2 (x/30)^2, so x = 10
    np.testing.assert_allclose(found.motor, [40.0, 30.0, 30.0, 50.0, 10.0] * 2, rtol=1e-9)
    assert not found.exact
    assert found.losses == (
        "right_knee and right_ankle are coupled by 10 N m/rad",
        "right_ankle has 10 instead of 15 N m/rad",
        "left_knee and left_ankle are coupled by 10 N m/rad",
        "left_ankle has 10 instead of 15 N m/rad",
    )


def test_unequal_gains_of_the_differential_lose_their_difference() -> None:
    wanted = np.array([40.0, 80.0, 20.0, 0.0, 0.0] * 2)
    found = motor_gains(ROBOT, wanted, "N m/rad")
    assert len(found.losses) == 4 and found.joint[1, 1] == pytest.approx(found.joint[2, 2])
    assert (found.motor >= 0.0).all()


@given(st.integers(0, 10_000), st.integers(1, 6))
@settings(max_examples=60, deadline=None)
def test_no_other_non_negative_gains_have_a_smaller_error(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    columns = np.vstack([rng.normal(size=(2 * n, n)), np.eye(n)])
    target = 2.0 * rng.normal(size=3 * n)
    found = _non_negative_least_squares(columns, target)
    slope = columns.T @ (columns @ found - target)  # the conditions of Karush, Kuhn and Tucker
    assert (found >= 0.0).all() and (slope >= -1e-9).all()
    np.testing.assert_allclose(found * slope, 0.0, atol=1e-9)


@given(st.integers(0, 10_000), st.integers(1, 6))
@settings(max_examples=60, deadline=None)
def test_non_negative_gains_that_fit_exactly_are_found(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    columns = np.vstack([rng.normal(size=(n, n)), 2.0 * np.eye(n)])
    expected = np.where(rng.random(n) < 0.3, 0.0, rng.uniform(0.1, 100.0, n))
    found = _non_negative_least_squares(columns, columns @ expected)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_a_motor_that_moves_no_joint_gets_no_gain() -> None:
    columns = np.array([[2.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(_non_negative_least_squares(columns, np.array([6.0, 5.0])), [3, 0])


@pytest.mark.parametrize("factor", [1e-3, 1.0, 1e3])
def test_gains_grow_in_proportion_to_those_wanted(factor: float) -> None:
    wanted = np.array([40.0, 80.0, 20.0, 60.0, 15.0] * 2)
    found, scaled = (motor_gains(ROBOT, each, "N m/rad") for each in (wanted, factor * wanted))
    np.testing.assert_allclose(scaled.motor, factor * found.motor, rtol=1e-9, atol=1e-12 * factor)
    assert len(scaled.losses) == len(found.losses)
