"""A vector in whole steps."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import live_parameter
from .elements import Elements
from .quantity_parameters import Keeps
from .vector import Vector


class Quantiser(Keeps, Block):
    """The nearest whole multiple of a step: y = interval round(u / interval), halves to even."""

    class Params(Elements):
        interval: float = live_parameter(0.5, gt=0.0, text="from one output value to the next")

    params: Params
    u = Input(Vector, text="what is rounded")
    y = Output(Vector, text="the rounded vector")

    def setup(self) -> None:
        """Keep the step at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """As an array, so that no tick makes one."""
        self._interval = np.array(self.params.interval)

    def step(self) -> None:
        """Round."""
        np.divide(self.u.value, self._interval, out=self.y.value)
        np.rint(self.y.value, out=self.y.value)
        np.multiply(self.y.value, self._interval, out=self.y.value)
