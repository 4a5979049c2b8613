"""The feedback of simulated drives: closed on each motor, around goals that a driver renews.

It is the law of the real robot's drives and of the driver that feeds them: the drives close a loop with
fixed gains on their own motors in every physics step, and the driver makes new goals once every period
of the bus from the newest command and from the measurement of the exchange before (``DriveGoals``).
"""

from __future__ import annotations

from typing import NamedTuple

from ...mathematics.arrays import Array1D
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector
from ...robots.robot_description import RobotDescription
from ...robots.transmission import motor_gains
from ...runtime.language.signals import Field
from ...runtime.language.steps import as_record
from ..drive_control import (
    CommandTargets,
    DriveGains,
    Gears,
    GoalScratch,
    MeasuredMotion,
    MotorGoals,
    gears_of,
    joint_gains,
    make_goals,
)

_LEAD = 1.5
"""Time from a measurement to the middle of that in which the goals made from it act, in periods."""


class FeedbackState(MotorGoals):
    """The goals of the drives, and the measurement that the next ones are made from."""

    following = Field(dtype="bool", text="a command has arrived")
    age = Field(dtype="int64", text="physics steps since the goals were made")
    seen_position = Field("n_joints", unit="rad", text="joint angles in the exchange before")
    seen_velocity = Field("n_joints", unit="rad/s", text="joint velocities in it")


class LoopScratch(GoalScratch):
    """Intermediate values of the loops of all drives in a physics step."""

    angle = Field("n_joints", unit="rad", text="of the motors")
    speed = Field("n_joints", unit="rad/s", text="of the motors")
    torque = Field("n_joints", unit="N m", text="of the motors")


class MotorLoops(NamedTuple):
    """The loops of all drives: the gears and gains that goals are made with, the physics ``steps`` between
    two goals, and the motion that goals are made from, whose joints are those of the ``state``."""

    gears: Gears
    steps: int
    state: FeedbackState
    measured: MeasuredMotion
    scratch: LoopScratch


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
        stiffness, damping = joint_gains(params, robot)
        motors = MeasuredMotion.allocate(robot.dimensions)
        measured = MeasuredMotion.bind({
            **motors.views(),
            "joint_position": state.seen_position, "joint_velocity": state.seen_velocity,
        })  # fmt: skip
        self.loops = MotorLoops(
            gears_of(
                robot, stiffness, damping, motor_gains(robot, stiffness, "N m/rad").motor,
                motor_gains(robot, damping, "N m s/rad").motor, _LEAD * period,
                params.motor_model,
            ),
            steps, as_record(state), as_record(measured),
            as_record(LoopScratch.allocate(robot.dimensions)),
        )  # fmt: skip
        self._state = state

    def reset(self) -> None:
        """No command has arrived."""
        self._state.following[()] = False


@kernel
def close_loops(
    loops: MotorLoops,
    commands: CommandTargets,
    row: int,
    arrived: bool,
    position: Array1D,
    velocity: Array1D,
    out: Array1D,
) -> bool:
    """Write the joint torques [N m] of a physics step; return whether a command has arrived at all.

    Args:
        commands, row: the active command.
        arrived: whether it has just arrived, so that the goals are new ones.
        position, velocity: the joints' motion as the drives' encoders read it [rad, rad/s].
    """
    gears, state, measured, scratch = loops.gears, loops.state, loops.measured, loops.scratch
    if arrived and not state.following:
        measured.joint_position[:] = position
        measured.joint_velocity[:] = velocity
        state.following = True
    if not state.following:
        return False
    age = state.age
    if arrived or age >= loops.steps:
        multiply_vector(gears.to_motor, measured.joint_position, measured.position)
        multiply_vector(gears.to_motor, measured.joint_velocity, measured.velocity)
        make_goals(gears, commands, row, measured, state, scratch)
        measured.joint_position[:] = position
        measured.joint_velocity[:] = velocity
        age = 0
    state.age = age + 1
    multiply_vector(gears.to_motor, position, scratch.angle)
    multiply_vector(gears.to_motor, velocity, scratch.speed)
    motor_feedback(
        state.torque, state.position, state.velocity, gears.motor_stiffness,
        gears.motor_damping, scratch.angle, scratch.speed, scratch.torque,
    )  # fmt: skip
    multiply_vector(gears.torque_to_joint, scratch.torque, out)
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
