"""What the linear filters share: a memory that begins settled at the first input."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from ...mathematics.linear_systems import advance, settle
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.signals import Field, Signal
from .quantity_parameters import Keeps
from .vector import Vector


class FilterMemory(Signal):
    """The memory of a second-order filter in transposed direct form II."""

    memory = Field(("n", 2), text="two numbers for each element")
    started = Field((), dtype="bool", text="whether there was an input")


class LinearFilter(Keeps, Block):
    """The base of the filters: ``coefficients`` says which filter it is."""

    u = Input(Vector, text="what is filtered")
    y = Output(Vector, text="u, filtered")
    x = State(FilterMemory, text="the filter's memory")

    @abstractmethod
    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Write b0, b1, b2, a1 and a2 for the block's parameters and period."""

    def setup(self) -> None:
        """Compute the coefficients."""
        self._coefficients = np.zeros(5)
        self.coefficients(self._coefficients)

    def step(self) -> None:
        """Filter one sample; before the first the input is taken to have been constant."""
        if not self.x.started:
            settle(self._coefficients, self.u.value, self.x.memory)
            self.x.started[...] = True
        advance(self._coefficients, self.u.value, self.x.memory, self.y.value)


def too_fast(name: str, frequency: float, period: float) -> list[Misfit]:
    """A misfit where a frequency [Hz] is not below half of the rate at which the block runs."""
    if frequency < 0.5 / period:
        return []
    return [
        Misfit(
            f"{name} is not below half of the block's rate",
            parameter=name,
            expected=f"below {0.5 / period:g} Hz",
            found=f"{frequency:g} Hz",
        )
    ]
