"""A vector that is sampled now and then, and held."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import parameter
from ...runtime.language.signals import Field, Signal
from .elements import Elements
from .quantity_parameters import Keeps
from .vector import Vector


class Held(Signal):
    """A held sample."""

    value = Field("n", text="the last sample")
    age = Field((), dtype="int64", text="runs since it was taken")


class ZeroOrderHold(Keeps, Block):
    """A sample of the input in every k-th run, held in between: y[n] = u[k floor(n / k)].

    Between blocks of different rates none is needed: there a slower reader samples and a faster
    one holds by itself.
    """

    class Params(Elements):
        samples: int = parameter(2, ge=1, text="k, from one sample to the next in runs")

    params: Params
    u = Input(Vector, text="what is sampled")
    y = Output(Vector, text="the last sample")
    x = State(Held, text="the last sample")

    def step(self) -> None:
        """Take a sample if it is time to."""
        age = int(self.x.age)
        if age == 0:
            np.copyto(self.x.value, self.u.value)
        self.x.age[...] = (age + 1) % self.params.samples
        np.copyto(self.y.value, self.x.value)
