"""A joint PD for any robot: it takes all joints to a pose, or lets them follow one."""

from __future__ import annotations

from collections.abc import Mapping

from ...mathematics.interpolation import minimum_jerk
from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Clock, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ..signals import CommandMode, JointCommand, JointState


class JointSetpoint(Signal):
    """The wanted positions and speeds of the joints now, and the torque beside the feedback."""

    position = Field("n_joints", unit="rad", text="joint angles")
    velocity = Field("n_joints", unit="rad/s", text="joint velocities")
    torque = Field("n_joints", unit="N m", text="feedforward torques")


class HoldJoints(Block):
    """Joint feedback at the drives towards a pose or a path, begun softly from where the joints are:

        tau = tau_ff + stiffness (q_d - q) + damping (q_d' - q')

    With s(t) the minimum-jerk curve from 0 to 1 within ``duration`` and q0 the angles in the first run,
    q_d = q0 + s (goal - q0). The goal is ``setpoint``, where that is wired, as from a
    ``blocks.TablePlayback``; else ``position``, or q0 without one. q_d' is its derivative, in which a
    setpoint's velocity counts with s. Gains are per joint, by name or pattern
    (``stiffness: {"*": 40, "*_knee": 60}``), and may change during a run. It does not know the ground or
    the limits of joints: ``blocks.SafetyMonitor`` does.
    """

    class Params(Parameters):
        position: PerJoint | None = parameter(
            None, unit="rad", text="the pose; none: where the joints are in the first run"
        )
        duration: float = parameter(1.0, unit="s", gt=0.0, text="time in which it is reached")
        stiffness: PerJoint = live_parameter(unit="N m/rad", ge=0.0, text="gain on angles")
        damping: PerJoint = live_parameter(unit="N m s/rad", ge=0.0, text="gain on velocities")

    class Constants(Signal):
        """The gains and the pose of each joint."""

        goal = Field("n_joints", unit="rad", text="the pose")
        posed = Field(dtype="bool", text="there is a pose")
        followed = Field(dtype="bool", text="a setpoint is wired")
        stiffness = Field("n_joints", unit="N m/rad", text="gain on angles")
        damping = Field("n_joints", unit="N m s/rad", text="gain on velocities")

    class Begin(Signal):
        """The pose and the time at which it began."""

        position = Field("n_joints", unit="rad", text="the joint angles then")
        tick = Field(dtype="int64", text="the tick")
        begun = Field(dtype="bool", text="it has begun")

    needs = ("robot",)
    params: Params
    constants: Constants
    joints = Input(JointState, text="the measured joints")
    setpoint = Input(JointSetpoint, default={}, text="a path that is followed instead of the pose")
    command = Output(JointCommand, text="command to the drives")
    begin = State(Begin, text="where and when it began")

    @classmethod
    def example_parameters(cls) -> Mapping[str, object]:
        """Return gains for all joints."""
        return {"stiffness": 40.0, "damping": 1.0}

    def prepare(self) -> None:
        p, constants = self.params, self.constants
        constants.stiffness[:] = p.stiffness.resolve(self.robot)
        constants.damping[:] = p.damping.resolve(self.robot)
        constants.posed = p.position is not None
        if p.position is not None:
            constants.goal[:] = p.position.resolve(self.robot)
        constants.followed = "setpoint" in self.context.wired

    @kernel
    @staticmethod
    def step(
        joints: JointState,
        setpoint: JointSetpoint,
        command: JointCommand,
        begin: Begin,
        params: Params,
        constants: Constants,
        clock: Clock,
    ) -> None:
        if not begin.begun:
            begin.position[:] = joints.position
            begin.tick = clock.tick
            begin.begun = True
        elapsed = (clock.tick - begin.tick) * clock.base_period
        share, rate, _ = minimum_jerk(min(elapsed / params.duration, 1.0))
        command.mode = int(CommandMode.ACTIVE)
        command.stiffness[:] = constants.stiffness
        command.damping[:] = constants.damping
        for k in range(command.position.shape[0]):
            goal = begin.position[k]
            if constants.followed:
                goal = setpoint.position[k]
            elif constants.posed:
                goal = constants.goal[k]
            way = goal - begin.position[k]
            command.position[k] = begin.position[k] + share * way
            command.velocity[k] = share * setpoint.velocity[k] + rate / params.duration * way
            command.torque[k] = setpoint.torque[k]
