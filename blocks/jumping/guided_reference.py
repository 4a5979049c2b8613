"""The base of references that guide the whole body from a few numbers, without a plan file."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable

from ...planner.library.jump_table import JumpTable, JumpTableReader
from ...runtime.language.block import Block, Context, Input, Output, UnmetRequirement
from ...runtime.language.parameters import Parameters, parameter
from ..signals import DelayEstimate, JumpReference
from .guided_motion import too_few_joints


class GuidedParameters(Parameters):
    """The parameter of all these references."""

    lead: float = parameter(
        0.002, unit="s", ge=0.0, le=0.02, text="delay from sensing to torque that is compensated"
    )


class GuidedReference(Block):
    """A table made at load, whose reader publishes the instant of a tick, or ``delay.ahead`` later."""

    Params = GuidedParameters
    needs = ("floating base", "feet")
    params: GuidedParameters
    delay = Input(DelayEstimate, default={}, text="how far ahead of time the controller works")
    reference = Output(JumpReference, text="the plan at the present instant")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report too few joints to move the centre of mass and the base with all feet standing."""
        robot = context.robot
        return too_few_joints(robot)

    @abstractmethod
    def make_table(self) -> JumpTable:
        """The motion of the block's robot."""

    def setup(self) -> None:
        self._reader = JumpTableReader(self.make_table(), self.reference)
