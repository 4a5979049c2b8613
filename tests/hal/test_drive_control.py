"""The goals of the drives give the joints the commanded torque, whatever the gains are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.blocks.signals import JointCommand
from aloft.hal.drive_control import DriveGoals
from aloft.mathematics.arrays import Array
from aloft.robots.description import find_robot
from aloft.robots.transmission import TransmissionMap, motor_gains

ROBOT = find_robot("bruce")
FLIGHT = np.array([40.0, 60.0, 60.0, 60.0, 15.0] * 2), np.array([1.0, 1.5, 1.5, 1.2, 0.3] * 2)
STIFFNESS, DAMPING = (motor_gains(ROBOT, gains, "").motor for gains in FLIGHT)


def goals(lead: float = 0.0) -> DriveGoals:
    return DriveGoals(ROBOT, *FLIGHT, STIFFNESS, DAMPING, lead)


def command(rng: np.random.Generator, stiffness: Array, damping: Array) -> JointCommand:
    made = JointCommand.allocate(ROBOT.dimensions)
    made.torque[:] = rng.uniform(-10, 10, 10)
    made.position[:] = rng.uniform(-1, 1, 10)
    made.velocity[:] = rng.uniform(-10, 10, 10)
    made.stiffness[:], made.damping[:] = stiffness, damping
    return made


def joint_torque(made: DriveGoals, position: Array, velocity: Array) -> Array:
    """What the drives give the joints with these goals, where the joints really are."""
    transmission = TransmissionMap(ROBOT)
    motor_position, motor_velocity, out = np.zeros(10), np.zeros(10), np.zeros(10)
    transmission.motor_motion(position, motor_position)
    transmission.motor_motion(velocity, motor_velocity)
    torque = (
        made.torque
        + STIFFNESS * (made.position - motor_position)
        + DAMPING * (made.velocity - motor_velocity)
    )
    transmission.joint_torque(torque, out)
    return out


def motors(joints: Array) -> Array:
    out = np.zeros(10)
    TransmissionMap(ROBOT).motor_motion(joints, out)
    return out


@given(st.integers(0, 10_000), st.floats(0.0, 2.0))
@settings(max_examples=60, deadline=None)
def test_at_the_measurement_the_torque_is_the_commanded_one(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    made = goals()
    wish = command(rng, scale * FLIGHT[0] * rng.uniform(0, 1, 10), scale * FLIGHT[1])
    position, velocity = rng.uniform(-1, 1, 10), rng.uniform(-10, 10, 10)
    made.follow(wish, motors(position), motors(velocity), position, velocity)
    wanted = (
        wish.torque
        + wish.stiffness * (wish.position - position)
        + wish.damping * (wish.velocity - velocity)
    )
    np.testing.assert_allclose(joint_torque(made, position, velocity), wanted, atol=1e-10)


def test_with_the_drives_own_gains_the_whole_feedback_runs_in_them() -> None:
    gains = np.array([40.0, 60.0, 60.0, 60.0, 0.0] * 2)  # exact: no gain on the ankles
    exact = motor_gains(ROBOT, gains, "").motor
    made = DriveGoals(ROBOT, gains, FLIGHT[1], exact, np.zeros(10), 0.001)
    wish = command(np.random.default_rng(1), gains, np.zeros(10))
    position = np.full(10, 0.1)
    made.follow(wish, motors(position), np.zeros(10), position, np.zeros(10))
    np.testing.assert_allclose(made.position, motors(wish.position), atol=1e-12)
    out = np.zeros(10)
    TransmissionMap(ROBOT).motor_torque(wish.torque, out)
    np.testing.assert_allclose(made.torque, out, atol=1e-10)


def test_without_gains_the_goals_move_with_the_motors() -> None:
    made = goals(lead=0.001)
    rng = np.random.default_rng(2)
    wish = command(rng, np.zeros(10), np.zeros(10))
    position, velocity = rng.uniform(-1, 1, 10), rng.uniform(-20, 20, 10)
    made.follow(wish, motors(position), motors(velocity), position, velocity)
    later = position + 0.001 * velocity
    np.testing.assert_allclose(joint_torque(made, later, velocity), wish.torque, atol=1e-10)


def test_holding() -> None:
    made = goals()
    made.hold(np.full(10, 0.3))
    assert made.position.tolist() == [0.3] * 10
    assert not made.torque.any() and not made.velocity.any()


@pytest.mark.parametrize("factor", [0.0, 0.25, 1.0, 3.0])
def test_the_share_follows_the_gains(factor: float) -> None:
    made = goals()
    wish = command(np.random.default_rng(3), factor * FLIGHT[0], factor * FLIGHT[1])
    made.follow(wish, np.zeros(10), np.zeros(10), np.zeros(10), np.zeros(10))
    np.testing.assert_allclose(made.position, min(1.0, factor) * motors(wish.position), atol=1e-12)
