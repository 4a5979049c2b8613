"""A leg that is a spring, with a rest length, a stiffness and a damping for each phase."""

import numpy as np

from aloft import Block, Input, Output, Parameters, parameter
from aloft.blocks.general.state_machine import StateName
from aloft.blocks.signals import CommandMode, JointCommand, JointState


class Leg(Block):
    """force = stiffness (length - leg) - damping leg', with numbers chosen by the phase.

    The motor of the joint ``leg`` pushes along it; other joints get nothing.
    """

    class Params(Parameters):
        length: list[float] = parameter(text="where the spring is at rest [m], for each phase")
        stiffness: list[float] = parameter(text="[N/m], for each phase")
        damping: list[float] = parameter(text="[N s/m], for each phase")

    needs = ("robot",)
    params: Params
    joints = Input(JointState, text="measured joints")
    phase = Input(StateName, text="the phase")
    command = Output(JointCommand, text="the force of the leg's motor")

    def setup(self) -> None:
        """Find the joint."""
        self._leg = [joint.name for joint in self.robot.joints].index("leg")
        p = self.params
        self._numbers = np.array([p.length, p.stiffness, p.damping]).T

    def step(self) -> None:
        """Make one tick."""
        command, leg = self.command, self._leg
        for field in (command.position, command.velocity, command.stiffness, command.damping):
            field.fill(0.0)
        length, stiffness, damping = self._numbers[int(self.phase.index)]
        command.torque.fill(0.0)
        command.torque[leg] = (
            stiffness * (length - self.joints.position[leg]) - damping * self.joints.velocity[leg]
        )
        command.mode[()] = CommandMode.ACTIVE
