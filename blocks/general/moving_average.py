"""The mean of the last inputs."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import parameter
from ...runtime.language.signals import Field, Signal
from .elements import Elements
from .quantity_parameters import Keeps
from .vector import Vector


class Window(Signal):
    """The last inputs."""

    values = Field(("samples", "n"), text="the last inputs, each in the place of its turn")
    count = Field((), dtype="int64", text="how many inputs there were")


class MovingAverage(Keeps, Block):
    """The mean of the last inputs: y[n] = (u[n] + ... + u[n-k+1]) / k with k = ``samples``.

    At the start it is the mean of the inputs so far. The sum is made anew in every run, so no
    error of rounding grows.
    """

    class Params(Elements):
        samples: int = parameter(10, ge=1, text="k, how many inputs are averaged")

    params: Params
    u = Input(Vector, text="what is averaged")
    y = Output(Vector, text="the mean")
    x = State(Window, text="the last inputs")

    def setup(self) -> None:
        """Make room for the count."""
        self._number = np.zeros(())

    def step(self) -> None:
        """Take the input in and average."""
        x, samples = self.x, self.params.samples
        count = int(x.count)
        np.copyto(x.values[count % samples], self.u.value)
        x.count[...] = count + 1
        self._number[...] = min(count + 1, samples)
        np.add.reduce(x.values, axis=0, out=self.y.value)
        np.divide(self.y.value, self._number, out=self.y.value)
