"""The rate of change of a vector, smoothed."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.quantities import Carried, Given
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import SECOND
from .elements import Elements
from .vector import Vector


class DerivativeMemory(Signal):
    """What a filtered derivative remembers."""

    value = Field("n", text="the input before")
    rate = Field("n", text="the derivative before")
    started = Field((), dtype="bool", text="whether there was an input")


class FilteredDerivative(Block):
    """The derivative s / (1 + tau s) by backward differences, which never rings:

    y[n] = (tau y[n-1] + u[n] - u[n-1]) / (tau + T), and y = 0 at the first input.

    T is the block's period. With ``time_constant`` 0 it is the plain difference (u[n] - u[n-1]) / T.
    """

    class Params(Elements):
        time_constant: float = live_parameter(0.01, unit="s", ge=0.0, text="tau, of the smoothing")

    params: Params
    u = Input(Vector, text="what is differentiated")
    y = Output(Vector, text="its rate per second")
    x = State(DerivativeMemory, text="the input and the derivative before")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The unit of the input by a second."""
        u = given["u"]
        return {"y": u and u.times(SECOND, -1)}

    def setup(self) -> None:
        """Compute the weights."""
        self._difference = np.zeros(self.params.n)
        self.on_parameters()

    def on_parameters(self) -> None:
        """As arrays, so that no tick makes them."""
        tau = self.params.time_constant
        self._keep = np.array(tau / (tau + self.period))
        self._gain = np.array(1.0 / (tau + self.period))

    def step(self) -> None:
        """Differentiate."""
        x = self.x
        if not x.started:
            np.copyto(x.value, self.u.value)
            x.started[...] = True
        np.subtract(self.u.value, x.value, out=self._difference)
        np.multiply(self._difference, self._gain, out=self._difference)
        np.multiply(x.rate, self._keep, out=x.rate)
        np.add(x.rate, self._difference, out=x.rate)
        np.copyto(x.value, self.u.value)
        np.copyto(self.y.value, x.rate)
