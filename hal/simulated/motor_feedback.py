"""The feedback of simulated drives: closed on each motor, around goals that a driver renews.

It is the law of the real robot's drives and of the driver that feeds them: the drives close a loop with
fixed gains on their own motors in every physics step, and the driver makes new goals once every period
of the bus from the newest command and from the measurement of the exchange before (``DriveGoals``).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D, Flags0D, Indices0D
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector
from ...robots.robot_description import RobotDescription
from ...robots.transmission import motor_gains
from ...runtime.language.signals import Field, Signal
from ..drive_control import (
    DriveGains,
    Gears,
    Goals,
    JointTargets,
    MeasuredMotion,
    Targets,
    TrackingErrors,
    gears_of,
    joint_gains,
    make_goals,
)

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


class MotorLoops(NamedTuple):
    """The loops of all drives: the gears and gains that goals are made with, the physics ``steps`` between
    two goals, the state (``FeedbackState``), and scratch, of which the last three are (n_joints,)."""

    gears: Gears
    steps: int
    following: Flags0D
    age: Indices0D
    goals: Goals
    seen: MeasuredMotion
    errors: TrackingErrors
    angle: Array1D
    speed: Array1D
    torque: Array1D


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
        self.loops = MotorLoops(
            gears_of(
                robot, stiffness, damping, motor_gains(robot, stiffness, "N m/rad").motor,
                motor_gains(robot, damping, "N m s/rad").motor, _LEAD * period,
            ),
            steps, state.following, state.age,
            Goals(state.torque, state.position, state.velocity),
            MeasuredMotion(np.zeros(n), np.zeros(n), state.seen_position, state.seen_velocity),
            TrackingErrors(*(np.zeros(n) for _ in TrackingErrors._fields)),
            *(np.zeros(n) for _ in range(3)),
        )  # fmt: skip
        self._state = state
        self._targets = Targets(*(np.zeros((1, n)) for _ in Targets._fields))

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
        targets = self._targets
        targets.torque[0], targets.position[0] = command.torque, command.position
        targets.velocity[0] = command.velocity
        targets.stiffness[0], targets.damping[0] = command.stiffness, command.damping
        return close_loops(self.loops, targets, 0, arrived, position, velocity, out)


@kernel
def close_loops(
    loops: MotorLoops,
    targets: Targets,
    row: int,
    arrived: bool,
    position: Array1D,
    velocity: Array1D,
    out: Array1D,
) -> bool:
    """As ``MotorFeedback.write``, for the command in a row of ``targets``."""
    gears, seen = loops.gears, loops.seen
    if arrived and not loops.following[()]:
        for k in range(out.shape[0]):
            seen.joint_position[k] = position[k]
            seen.joint_velocity[k] = velocity[k]
        loops.following[()] = True
    if not loops.following[()]:
        return False
    age = int(loops.age[()])
    if arrived or age >= loops.steps:
        multiply_vector(gears.to_motor, seen.joint_position, seen.position)
        multiply_vector(gears.to_motor, seen.joint_velocity, seen.velocity)
        make_goals(gears, targets, row, seen, loops.goals, loops.errors)
        for k in range(out.shape[0]):
            seen.joint_position[k] = position[k]
            seen.joint_velocity[k] = velocity[k]
        age = 0
    loops.age[()] = age + 1
    multiply_vector(gears.to_motor, position, loops.angle)
    multiply_vector(gears.to_motor, velocity, loops.speed)
    motor_feedback(
        loops.goals.torque, loops.goals.position, loops.goals.velocity, gears.motor_stiffness,
        gears.motor_damping, loops.angle, loops.speed, loops.torque,
    )  # fmt: skip
    multiply_vector(gears.torque_to_joint, loops.torque, out)
    return True


@kernel
def motor_feedback(
    torque: Array1D,
    position_goal: Array1D,
    velocity_goal: Array1D,
    stiffness: Array1D,
    damping: Array1D,
    position: Array1D,
    velocity: Array1D,
    out: Array1D,
) -> None:
    """Write what drives in direct-force mode ask of their motors to ``out``, each (n_motors,):
    ``torque + P (position_goal - position) + D (velocity_goal - velocity)``. Torques and gains may as
    well be in A, A/rad and A s/rad."""
    out[:] = (position_goal - position) * stiffness + torque + (velocity_goal - velocity) * damping
