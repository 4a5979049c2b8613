"""Play between a driving and a driven part."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import live_parameter
from .elements import Elements, PerElement, spread
from .quantity_parameters import Keeps
from .vector import Vector


class Backlash(Keeps, Block):
    """Play: y[n] = min(max(y[n-1], u[n] - width / 2), u[n] + width / 2), from y = 0."""

    class Params(Elements):
        width: PerElement = live_parameter(1.0, text="the play from one side to the other")

    params: Params
    u = Input(Vector, text="position of the driving part")
    y = Output(Vector, text="position of the driven part")
    x = State(Vector, text="position of the driven part before")

    def setup(self) -> None:
        """Keep half of the play at hand."""
        self._bound = np.zeros(self.params.n)
        self.on_parameters()

    def on_parameters(self) -> None:
        """As an array, so that no tick makes one; a negative play counts as none."""
        self._half = 0.5 * np.maximum(spread(self.params.width, self.params.n), 0.0)

    def step(self) -> None:
        """Push the driven part along, if it is reached."""
        np.subtract(self.u.value, self._half, out=self._bound)
        np.maximum(self.x.value, self._bound, out=self.x.value)
        np.add(self.u.value, self._half, out=self._bound)
        np.minimum(self.x.value, self._bound, out=self.x.value)
        np.copyto(self.y.value, self.x.value)
