"""A vector that changes only so fast."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import live_parameter
from ...runtime.language.signals import Field, Signal
from .elements import Elements, PerElement, spread
from .quantity_parameters import Keeps
from .vector import Vector


class LastOutput(Signal):
    """What a block that starts at its first input remembers."""

    value = Field("n", text="the last output")
    started = Field((), dtype="bool", text="whether there was one")


class RateLimiter(Keeps, Block):
    """The input, followed only so fast: y[n] = min(max(u[n], y[n-1] - T f), y[n-1] + T r).

    r and f are the rates ``rising`` and ``falling`` and T is the block's period. The first output
    is the first input.
    """

    class Params(Elements):
        rising: PerElement = live_parameter(1.0, text="the fastest growth per second, positive")
        falling: PerElement = live_parameter(1.0, text="the fastest fall per second, positive")

    params: Params
    u = Input(Vector, text="what is followed")
    y = Output(Vector, text="what follows it")
    x = State(LastOutput, text="the output before")

    def setup(self) -> None:
        """Keep the greatest steps at hand."""
        self._lower = np.zeros(self.params.n)
        self._upper = np.zeros(self.params.n)
        self.on_parameters()

    def on_parameters(self) -> None:
        """Compute the greatest steps of one period; a negative rate counts as zero."""
        n = self.params.n
        self._rise = self.period * np.maximum(spread(self.params.rising, n), 0.0)
        self._fall = self.period * np.maximum(spread(self.params.falling, n), 0.0)

    def step(self) -> None:
        """Go towards the input."""
        x = self.x
        if not x.started:
            np.copyto(x.value, self.u.value)
            x.started[...] = True
        np.subtract(x.value, self._fall, out=self._lower)
        np.add(x.value, self._rise, out=self._upper)
        np.maximum(self.u.value, self._lower, out=x.value)
        np.minimum(x.value, self._upper, out=x.value)
        np.copyto(self.y.value, x.value)
