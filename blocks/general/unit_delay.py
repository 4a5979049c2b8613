"""A vector, delayed by one run of the block."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from .initial_value import InitialParameters
from .quantity_parameters import Keeps
from .vector import Vector


class UnitDelay(Keeps, Block):
    """The input of the run before: y[n] = x[n], x[n+1] = u[n], x[0] = initial.

    A Moore block, so it breaks a loop.
    """

    Params = InitialParameters
    params: InitialParameters
    u = Input(Vector, text="what is delayed")
    y = Output(Vector, text="u one run ago")
    x = State(Vector, text="u of the last run")

    def setup(self) -> None:
        """Start from the initial value."""
        self.x.value[...] = self.params.start_value()

    def emit(self) -> None:
        """Write the input of the last run."""
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        """Remember the input."""
        np.copyto(self.x.value, self.u.value)
