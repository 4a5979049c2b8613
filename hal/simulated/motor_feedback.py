"""The feedback of simulated drives: closed on each motor, around goals that a driver renews.

It is the law of the real robot's drives and of the driver that feeds them: the drives close a loop with
fixed gains on their own motors in every physics step, and the driver makes new goals once every period
of the bus from the newest command and from the measurement of the exchange before (``DriveGoals``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...mathematics.kernel import kernel
from ...robots.robot_description import RobotDescription
from ...robots.transmission import Transmission, motor_gains
from ...runtime.language.signals import Field, Signal
from ..drive_gains import DriveGains, joint_gains
from ..drive_goals import DriveGoals, JointTargets

Array = NDArray[np.float64]

_LEAD = 1.5
"""From a measurement to the middle of the time in which the goals made from it act, in periods."""


class FeedbackState(Signal):
    """The goals of the drives, and the measurement that the next ones are made from."""

    following = Field(dtype="bool", text="whether a command has arrived")
    age = Field(dtype="int64", text="physics steps since the goals were made")
    torque = Field("n_joints", unit="N m", text="the motors' torques beside their feedback")
    position = Field("n_joints", unit="rad", text="the motors' target angles")
    velocity = Field("n_joints", unit="rad/s", text="the motors' target velocities")
    seen_position = Field("n_joints", unit="rad", text="joint angles in the exchange before")
    seen_velocity = Field("n_joints", unit="rad/s", text="joint velocities in it")


class MotorFeedback:
    """The torques that the drives' own loops give the joints.

    Args:
        robot: the description.
        params: the gains that run in the drives.
        period: of the bus [s].
        steps: physics steps in a period of the bus.
        state: the goals and the last measurement.
    """

    def __init__(
        self, robot: RobotDescription, params: DriveGains, period: float, steps: int,
        state: FeedbackState,
    ) -> None:  # fmt: skip
        n = len(robot.joints)
        stiffness, damping = joint_gains(params, robot)
        self._stiffness = motor_gains(robot, stiffness, "N m/rad").motor
        self._damping = motor_gains(robot, damping, "N m s/rad").motor
        self._goals = DriveGoals(
            robot, stiffness, damping, self._stiffness, self._damping, _LEAD * period
        )
        self._goals.torque = state.torque
        self._goals.position, self._goals.velocity = state.position, state.velocity
        self._state, self._steps = state, steps
        self._transmission = Transmission(robot)
        self._angle, self._speed = np.zeros(n), np.zeros(n)
        self._torque, self._scratch = np.zeros(n), np.zeros(n)

    def reset(self) -> None:
        """No command has arrived."""
        self._state.following[()] = False

    def write(
        self, command: JointTargets, arrived: bool, position: Array, velocity: Array, out: Array
    ) -> bool:
        """Write the joint torques [N m] of a physics step; says whether a command has arrived at all.

        Args:
            command: the active command.
            arrived: whether it has just arrived, so that the goals are new ones.
            position, velocity: the joints' motion as the drives' encoders read it [rad, rad/s].
        """
        state, goals, transmission = self._state, self._goals, self._transmission
        if arrived and not state.following[()]:
            state.seen_position[:] = position
            state.seen_velocity[:] = velocity
            state.following[()] = True
        if not state.following[()]:
            return False
        age = int(state.age)
        if arrived or age >= self._steps:
            transmission.motor_motion(state.seen_position, self._angle)
            transmission.motor_motion(state.seen_velocity, self._speed)
            goals.follow(
                command, self._angle, self._speed, state.seen_position, state.seen_velocity
            )
            state.seen_position[:] = position
            state.seen_velocity[:] = velocity
            age = 0
        state.age[()] = age + 1
        transmission.motor_motion(position, self._angle)
        transmission.motor_motion(velocity, self._speed)
        motor_feedback(
            goals.torque, goals.position, goals.velocity, self._stiffness, self._damping,
            self._angle, self._speed, self._torque, self._scratch,
        )  # fmt: skip
        transmission.joint_torque(self._torque, out)
        return True


@kernel
def motor_feedback(
    torque: Array,
    position_goal: Array,
    velocity_goal: Array,
    stiffness: Array,
    damping: Array,
    position: Array,
    velocity: Array,
    out: Array,
    scratch: Array,
) -> None:
    """Write what drives in direct-force mode ask of their motors to ``out``, each (n_motors,):
    ``torque + P (position_goal - position) + D (velocity_goal - velocity)``. Torques and gains may as
    well be in A, A/rad and A s/rad."""
    np.subtract(position_goal, position, out)
    np.multiply(out, stiffness, out)
    np.add(out, torque, out)
    np.subtract(velocity_goal, velocity, scratch)
    np.multiply(scratch, damping, scratch)
    np.add(out, scratch, out)
