"""A vector, delayed by several runs of the block."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import parameter
from ...runtime.language.signals import Field, Signal
from .initial_value import InitialParameters
from .quantity_parameters import Keeps
from .vector import Vector


class Line(Signal):
    """A delay line."""

    values = Field(("samples", "n"), text="the last inputs, each in the place of its turn")
    next = Field((), dtype="int64", text="the place of the oldest, which is the next to be written")


class Delay(Keeps, Block):
    """The input of k runs before: y[n] = u[n-k] with k = ``samples``, and initial for n < k.

    A Moore block, so it breaks a loop. A wire delays as well: ``{from: a.y, delay: 3}``.
    """

    class Params(InitialParameters):
        samples: int = parameter(1, ge=1, text="k, by how many runs of the block")

    params: Params
    u = Input(Vector, text="what is delayed")
    y = Output(Vector, text="u, k runs ago")
    x = State(Line, text="the last k inputs")

    def setup(self) -> None:
        """Fill the line with the initial value."""
        self.x.values[...] = self.params.start_value()

    def emit(self) -> None:
        """Write the oldest."""
        np.copyto(self.y.value, self.x.values[int(self.x.next)])

    def update(self) -> None:
        """Replace the oldest by the input."""
        place = int(self.x.next)
        np.copyto(self.x.values[place], self.u.value)
        self.x.next[...] = (place + 1) % self.params.samples
