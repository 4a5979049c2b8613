"""The robot's state in the frame of the jump it makes: as if every jump began where a run begins."""

from __future__ import annotations

from ....blocks.signals import BaseState
from ....mathematics.elementary import cos, sin
from ....mathematics.kernel import kernel
from ....mathematics.rotations import multiply, turn_about_vertical
from ....runtime.language.block import Block, Input, Output
from ....runtime.language.signals import Field, Signal
from ..signals import JumpFrame


class StartFrame(Block):
    """Gives pose and velocity of the base in the frame of the feet before the jump, p' = R_z(-h) (p - o).

    o is ``frame.origin`` and h ``frame.heading`` in the estimator's world. Plans and landing laws are made for a
    robot that begins at the origin and looks along x: their gains ahead and aside, and their limits, are along the
    world's axes. ``SteeredPlan`` moves the frame when a plan begins. Wire ``frame`` with a delay of 1.
    """

    class Scratch(Signal):
        """Scratch memory of one step."""

        vector = Field(3, text="a vector")
        turn = Field(4, text="quaternion of the rotation")

    scratch: Scratch
    state = Input(BaseState, text="pose and velocity of the base by the estimator")
    frame = Input(JumpFrame, text="start of the jump")
    base = Output(BaseState, text="the same in that frame")

    @kernel
    @staticmethod
    def step(state: BaseState, frame: JumpFrame, base: BaseState, scratch: Scratch) -> None:
        scratch.vector[:] = state.position - frame.origin
        turn_about_vertical(scratch.vector, -frame.heading, base.position)
        turn_about_vertical(state.linear_velocity, -frame.heading, base.linear_velocity)
        base.angular_velocity[:] = state.angular_velocity
        turn = scratch.turn
        turn[0], turn[1] = 0.0, 0.0
        turn[2], turn[3] = -sin(0.5 * frame.heading), cos(0.5 * frame.heading)
        multiply(turn, state.orientation, base.orientation)
