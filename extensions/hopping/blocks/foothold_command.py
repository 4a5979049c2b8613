"""Jump commands to footholds given by another program."""

from __future__ import annotations

from ....mathematics.elementary import atan2
from ....mathematics.kernel import kernel
from ....runtime.language.block import Block, Input, Output, State
from ....runtime.language.signals import Field, Signal
from ..signals import FootholdPose, JumpCommand


class FootholdTaken(Signal):
    """The state of ``FootholdCommand``."""

    position = Field(3, unit="m", frame="world", text="of the last pose")
    orientation = Field(4, text="of the last pose")
    number = Field(dtype="int64", text="poses so far")


class FootholdCommand(Block):
    """Commands a jump to each new pose, which takes the place of one whose jump has not begun.

    The pose is that of the middle of the feet on the ground, in the estimator's world. Its height is that of the
    ground; of its orientation only the heading counts. A pose is new if a number in it has changed. Before the first one the orientation
    is all zeros, as that of ``ros2.Subscribe`` before a message has come.
    """

    pose = Input(FootholdPose, text="commanded place of the feet")
    command = Output(JumpCommand, text="the last pose as a command; number zero: none yet")
    memory = State(FootholdTaken, text="the last pose")

    @kernel
    @staticmethod
    def step(pose: FootholdPose, command: JumpCommand, memory: FootholdTaken) -> None:
        changed, size = 0.0, 0.0
        for k in range(3):
            changed = max(changed, abs(pose.position[k] - memory.position[k]))
        for k in range(4):
            changed = max(changed, abs(pose.orientation[k] - memory.orientation[k]))
            size += pose.orientation[k] * pose.orientation[k]
        if changed > 0.0 and size > 0.5:
            memory.number += 1
            memory.position[:] = pose.position
            memory.orientation[:] = pose.orientation
        x, y, z, w = (
            memory.orientation[0], memory.orientation[1], memory.orientation[2], memory.orientation[3],
        )  # fmt: skip
        command.number, command.placed, command.replaces = memory.number, True, True
        command.ahead, command.aside = memory.position[0], memory.position[1]
        command.turn = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        command.up = memory.position[2]
