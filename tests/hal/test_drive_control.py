"""The goals of the drives give the joints the commanded torque, whatever the gains are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft import LoadError, load
from aloft.blocks.signals import JointCommand
from aloft.hal.drive_control import (
    DriveGoals,
    MotorModel,
    gears_of,
    nominal_torque,
    true_torque,
)
from aloft.mathematics.arrays import Array
from aloft.robots.description import find_robot
from aloft.robots.transmission import TransmissionMap, motor_gains

GRAPHS = Path(__file__).parents[2] / "graphs"
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


KNOWN = MotorModel(torque_constant={"*": 0.96, "left_*": 1.05}, saturation=0.12, load_friction=0.05)


@settings(max_examples=60)
@given(st.floats(-9.0, 9.0), st.floats(-20.0, 20.0), st.integers(0, 9))
def test_what_is_asked_of_a_known_motor_gives_the_torque(
    torque: float, speed: float, motor: int
) -> None:
    none = np.zeros(10)
    gears = gears_of(ROBOT, none, none, none, none, 0.0, KNOWN)
    asked = nominal_torque(gears, motor, torque, speed)
    assert true_torque(gears, motor, asked, speed) == pytest.approx(torque, abs=2e-3)


def test_a_known_motor_is_asked_for_what_gives_the_commanded_torque() -> None:
    rng = np.random.default_rng(2)
    made, true = goals(), DriveGoals(ROBOT, *FLIGHT, STIFFNESS, DAMPING, 0.0, KNOWN)
    asked = command(rng, *(np.zeros(10) for _ in range(2)))
    asked.torque *= 0.5
    for each in (made, true):
        each.follow(asked, *(np.zeros(10) for _ in range(4)))
    torque = np.zeros(10)
    TransmissionMap(ROBOT).joint_torque(true.torque, torque)
    assert np.abs(torque - asked.torque).max() > 0.1
    true.correct(np.zeros(10), torque)
    np.testing.assert_allclose(torque, asked.torque, atol=2e-3)


def test_nominal_motors_change_no_bit() -> None:
    asked = command(np.random.default_rng(3), *FLIGHT)
    found = []
    for motors in (None, MotorModel(), MotorModel(torque_constant={"*": 1.0})):
        made = DriveGoals(ROBOT, *FLIGHT, STIFFNESS, DAMPING, 0.0, motors)
        made.follow(asked, *(np.full(10, 0.1) for _ in range(4)))
        found.append(made.torque.tobytes())
    assert len(set(found)) == 1


@pytest.mark.parametrize(
    ("constant", "message"),
    [
        ({"left_knee": 1.1}, "bruce has no motor left_knee"),
        ({"*": 3.0}, "motor_model.torque_constant of * is 3"),
    ],
)
def test_a_model_of_motors_that_are_not_there(constant: dict[str, float], message: str) -> None:
    with pytest.raises(LoadError) as caught:
        load(GRAPHS / "jump.yaml", {"robot.motor_model.torque_constant": constant})
    assert message in str(caught.value)
