"""A vector that jumps once."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Output
from ...runtime.language.parameters import live_parameter, parameter
from .elements import Elements, PerElement, spread
from .periods import first_tick
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class Step(Says, Block):
    """A vector that jumps once: y = before while t < at, y = after from then on.

    The jump comes in the first tick that is not before ``at``.
    """

    class Params(Elements, SourceParameters):
        in_unit = (
            "before",
            "after",
        )

        at: float = parameter(1.0, unit="s", ge=0.0, text="when the step comes")
        before: PerElement = live_parameter(0.0, text="the value before the step")
        after: PerElement = live_parameter(1.0, text="the value from the step on")

    params: Params
    y = Output(Vector, text="the step")

    def setup(self) -> None:
        """Find the tick of the step."""
        self._tick = first_tick(self.params.at, self.context.clock.base_period)
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep both values as arrays."""
        self._before = spread(self.params.before, self.params.n)
        self._after = spread(self.params.after, self.params.n)

    def step(self) -> None:
        """Write the value of the present tick."""
        np.copyto(self.y.value, self._before if self.tick < self._tick else self._after)
