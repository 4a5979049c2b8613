"""Simulated drives close their loops per motor, as the twin's do, around goals that a driver renews."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aloft.blocks.signals import CommandMode, JointCommand
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.protocol import Mode
from aloft.hal.drive_control import CommandTargets, DriveGains, DriveGoals, joint_gains
from aloft.hal.simulated.motor_feedback import FeedbackState, MotorFeedback, close_loops
from aloft.hal.simulated.mujoco_robot import MujocoRobot
from aloft.hal.simulated.state import TickRecord
from aloft.hal.twin.devices import EmulatedActuator
from aloft.hal.twin.drives import EmulatedDrives
from aloft.mathematics.arrays import Array
from aloft.robots.description import find_robot
from aloft.robots.transmission import TransmissionMap, motor_gains
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing.bench import BlockBench

from ...simulator_settings import grouped

ROBOT = find_robot("bruce")
N = len(ROBOT.joints)
FLIGHT = {
    "*_hip_yaw": 40.0,
    "*_hip_pitch": 60.0,
    "*_hip_roll": 60.0,
    "*_knee": 60.0,
    "*_ankle": 15.0,
}
STEPS = 2


def command(rng: np.random.Generator) -> JointCommand:
    made = JointCommand.allocate(ROBOT.dimensions)
    made.mode[()] = CommandMode.ACTIVE
    made.torque[:] = rng.uniform(-0.5, 0.5, N)
    made.position[:] = ROBOT.standing_position + rng.uniform(-0.03, 0.03, N)
    made.velocity[:] = rng.uniform(-0.3, 0.3, N)
    made.stiffness[:] = rng.uniform(0.0, 60.0, N)
    made.damping[:] = rng.uniform(0.0, 1.5, N)
    return made


class Feedback(MotorFeedback):
    """The loops with one command at a time."""

    def write(
        self, command: JointCommand, arrived: bool, position: Array, velocity: Array, out: Array
    ) -> bool:
        rows = {name: values[None] for name, values in command if name != "mode"}
        return close_loops(
            self.loops, CommandTargets.bind(rows), 0, arrived, position, velocity, out
        )


def feedback(**params: Any) -> tuple[Feedback, FeedbackState]:
    state = FeedbackState.allocate(ROBOT.dimensions)
    gains = DriveGains.model_validate(params)
    return Feedback(ROBOT, gains, 0.001, STEPS, state), state


def motion(rng: np.random.Generator) -> tuple[Array, Array]:
    return ROBOT.standing_position + rng.uniform(-0.02, 0.02, N), rng.uniform(-0.5, 0.5, N)


@pytest.mark.parametrize("seed", range(5))
def test_where_nothing_moves_the_joints_get_the_commanded_feedback(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wanted = command(rng)
    position, velocity = motion(rng)[0], np.zeros(N)
    made, _ = feedback(stiffness=FLIGHT, gains="nearest")
    out = np.zeros(N)
    expected = (
        wanted.torque
        + wanted.stiffness * (wanted.position - position)
        + wanted.damping * wanted.velocity
    )
    for step in range(5):
        assert made.write(wanted, step == 0, position, velocity, out)
        np.testing.assert_allclose(out, expected, atol=1e-12)


def test_before_the_first_command_it_says_so() -> None:
    made, state = feedback()
    still, out = np.zeros(N), np.full(N, 7.0)
    assert not made.write(command(np.random.default_rng(0)), False, still, still, out)
    assert (out == 7.0).all() and not state.following


def test_between_two_exchanges_every_motor_has_its_own_fixed_gain() -> None:
    """A knee that is moved is held by the knee motor and the ankle motor: their gains couple."""
    made, _ = feedback(stiffness=FLIGHT, gains="nearest", damping=0.0)
    wanted = command(np.random.default_rng(0))
    wanted.stiffness[:] = DriveGains.model_validate({"stiffness": FLIGHT}).stiffness.resolve(ROBOT)  # type: ignore[union-attr]
    position, velocity = ROBOT.standing_position.copy(), np.zeros(N)
    first, moved = np.zeros(N), np.zeros(N)
    made.write(wanted, True, position, velocity, first)
    position[3] += 0.01
    made.write(wanted, False, position, velocity, moved)
    gains = motor_gains(ROBOT, wanted.stiffness, "N m/rad")
    np.testing.assert_allclose(moved - first, -gains.joint[:, 3] * 0.01, atol=1e-12)
    assert abs(gains.joint[4, 3]) > 5.0
    made.write(wanted, False, position, velocity, moved)  # new goals, from where it was at first
    np.testing.assert_allclose(moved - first, -gains.joint[:, 3] * 0.01, atol=1e-12)
    for _ in range(STEPS):  # new goals, from where it is: the commanded gain alone
        made.write(wanted, False, position, velocity, moved)
    expected = np.zeros(N)
    expected[3] = -60.0 * 0.01
    np.testing.assert_allclose(moved - first, expected, atol=1e-12)


def test_they_give_the_joints_what_the_twins_drives_give() -> None:
    rng = np.random.default_rng(4)
    gains = DriveGains()
    stiffness, damping = joint_gains(gains, ROBOT)
    motors = motor_gains(ROBOT, stiffness, "").motor, motor_gains(ROBOT, damping, "").motor
    hardware = Hardware.for_twin(ROBOT)
    actuators = [EmulatedActuator(k + 1) for k in range(N)]
    constant = hardware.drives.torque_constant
    for k, actuator in enumerate(actuators):
        actuator.config |= {
            "mode": float(Mode.DIRECT_FORCE), "limit_i_max": 30.0,
            "p_gain_direct_force": motors[0][k] / constant,
            "d_gain_direct_force": motors[1][k] / constant,
        }  # fmt: skip
        actuator.status["torque_enable"] = 1.0
    twin = EmulatedDrives(ROBOT, hardware, actuators, TickRecord.allocate(ROBOT.dimensions), 0.5)
    twin.take_states()
    driver = DriveGoals(ROBOT, stiffness, damping, *motors, 0.0015)
    made, _ = feedback()
    to_motors = TransmissionMap(ROBOT).motor_motion
    wanted, seen = command(rng), motion(rng)
    mine, its = np.zeros(N), np.zeros(N)
    made.write(wanted, True, *seen, mine)
    for exchange in range(4):
        angle, speed = np.zeros(N), np.zeros(N)
        to_motors(seen[0], angle)
        to_motors(seen[1], speed)
        driver.follow(wanted, angle, speed, *seen)
        for k, actuator in enumerate(actuators):
            actuator.status["goal_iq"] = driver.torque[k] / constant
            actuator.status["goal_position"] = driver.position[k]
            actuator.status["goal_velocity"] = driver.velocity[k]
        twin.take_goals(exchange * STEPS)
        for step in range(STEPS):
            now = motion(rng)
            if exchange or step:
                made.write(wanted, False, *now, mine)
                twin.joint_torque(exchange * STEPS + step, *now, now[1], its)
                np.testing.assert_allclose(mine, its, atol=1e-9)
            if step == 0 and exchange:
                seen = now


def bench(**params: Any) -> BlockBench[MujocoRobot]:
    return BlockBench(MujocoRobot, grouped(params), robot="bruce")


def test_it_stands_with_the_loops_of_its_motors() -> None:
    robot = bench(bus_period=0.001, latency=0.002)
    robot.set(
        "command", mode=CommandMode.ACTIVE, torque=0.01, position=ROBOT.standing_position,
        velocity=0.0, stiffness=150.0, damping=2.0,
    )  # fmt: skip
    robot.step(200)
    np.testing.assert_allclose(robot.get("joints").position, ROBOT.standing_position, atol=0.05)
    assert robot.get("truth").contact_force[:, 2].sum() == pytest.approx(50.2, rel=0.05)
    assert "lost_drive_gains" not in robot.block.metrics()


def test_gains_that_no_drives_can_give_are_refused_or_approximated() -> None:
    text = (
        "MujocoRobot: no motor gains give bruce's joints this stiffness, because motors share "
        "joints; with the nearest ones right_knee and right_ankle are coupled by"
    )
    with pytest.raises(BlockError, match="with the nearest ones") as caught:
        bench(bus_period=0.001, stiffness=FLIGHT)
    assert str(caught.value).startswith(text)
    robot = bench(bus_period=0.001, stiffness=FLIGHT, gains="nearest")
    lost = str(robot.block.metrics()["lost_drive_gains"])
    assert "right_ankle has 10 instead of 15 N m/rad" in lost
    bench(stiffness=FLIGHT)  # without a period of the bus they are not used


@pytest.mark.parametrize(
    ("period", "text"),
    [
        (0.0007, "timestep 0.0005 s does not divide bus_period 0.0007 s"),
        (0.0015, "bus_period 0.0015 s does not divide the control period 0.002 s"),
    ],
)
def test_periods_must_divide(period: float, text: str) -> None:
    with pytest.raises(BlockError, match=text):
        bench(bus_period=period)
