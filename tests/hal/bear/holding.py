"""Blocks for graphs of tests: one holds the standing pose, and one hangs."""

from __future__ import annotations

import numpy as np

from aloft.blocks.signals import CommandMode, JointCommand, JointState
from aloft.runtime.language.block import Block, Input, Output
from aloft.runtime.language.parameters import Parameters, parameter


class Hold(Block):
    """Holds the standing pose, and after some ticks does what the test is about."""

    class Params(Parameters):
        hang_at: int = parameter(-1, text="the tick from which it never returns")
        fail_at: int = parameter(-1, text="the tick at which it raises")

    needs = ("robot",)
    params: Params
    joints = Input(JointState, text="measured joints")
    command = Output(JointCommand, text="stay")

    def step(self) -> None:
        command = self.command
        command.mode[()] = CommandMode.ACTIVE
        command.torque.fill(0.01)
        np.copyto(command.position, self.robot.standing_position)
        command.stiffness.fill(150.0)
        command.damping.fill(2.0)
        if self.tick == self.params.fail_at:
            raise ZeroDivisionError("as the test wanted")
        while self.tick == self.params.hang_at:
            pass
