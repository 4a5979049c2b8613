"""When truth values change."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import parameter
from ...runtime.language.signals import Field, Signal
from .elements import Elements
from .flags import Flags


class FlagsBefore(Signal):
    """The truth values of the run before."""

    value = Field("n", dtype="bool", text="the truth values")
    started = Field((), dtype="bool", text="whether there was a run before")


class EdgeDetector(Block):
    """Where an element began to hold in this run (rising), ceased to (falling), or either.

    The first run has no edge.
    """

    class Params(Elements):
        edge: Literal["rising", "falling", "either"] = parameter("rising", text="which change")

    params: Params
    u = Input(Flags, text="the truth values")
    y = Output(Flags, text="which elements changed in this run")
    x = State(FlagsBefore, text="the truth values of the run before")

    def step(self) -> None:
        """Compare with the run before."""
        u, before, y = self.u.value, self.x.value, self.y.value
        if not self.x.started:
            np.copyto(before, u)
            self.x.started[...] = True
        if self.params.edge == "rising":
            np.greater(u, before, out=y)
        elif self.params.edge == "falling":
            np.less(u, before, out=y)
        else:
            np.not_equal(u, before, out=y)
        np.copyto(before, u)
