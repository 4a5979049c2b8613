"""A vector that is sampled on a trigger, and held."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from .flags import Flag
from .initial_value import InitialParameters
from .quantity_parameters import Keeps
from .vector import Vector


class SampleHold(Keeps, Block):
    """The input where ``trigger`` holds, and its last such value where it does not.

    Before the first sample y = initial.
    """

    Params = InitialParameters
    params: InitialParameters
    u = Input(Vector, text="what is sampled")
    trigger = Input(Flag, text="whether to sample")
    y = Output(Vector, text="the last sample")
    x = State(Vector, text="the last sample")

    def setup(self) -> None:
        """Start from the initial value."""
        self.x.value[...] = self.params.start_value()

    def step(self) -> None:
        """Take a sample if asked to."""
        if self.trigger.value:
            np.copyto(self.x.value, self.u.value)
        np.copyto(self.y.value, self.x.value)
