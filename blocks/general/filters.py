"""Filters: Butterworth, band-stop, moving average, filtered derivative."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.second_order_filter import advance, band_stop, first_order, second_order, settle
from ...runtime.language.block import Block, Context, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.quantities import Carried, Given
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import SECOND
from .vectors import UnitOfInput, Vector, VectorParameters


class FilterMemory(Signal):
    """The memory of a second-order filter in transposed direct form II."""

    memory = Field(("n", 2), text="two numbers for each element")
    started = Field((), dtype="bool", text="whether there was an input")


class LinearFilter(UnitOfInput, Block):
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


class ButterworthParameters(VectorParameters):
    """A cutoff and an order."""

    cutoff: float = parameter(unit="Hz", gt=0.0, text="where the gain is 1 / sqrt(2)")
    order: Literal[1, 2] = parameter(
        1, text="beyond the cutoff the gain falls by 20 dB a decade with 1, by 40 dB with 2"
    )


class Butterworth(LinearFilter):
    """The base of the Butterworth filters of first or second order.

    They are made by the prewarped bilinear transform.
    """

    Params = ButterworthParameters
    params: ButterworthParameters

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """The cutoff must be below half of the block's rate."""
        assert isinstance(params, ButterworthParameters)
        return too_fast("cutoff", params.cutoff, context.period)

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        """A cutoff far below the rate."""
        return {"cutoff": 20.0, "n": 2, "order": 2}

    @abstractmethod
    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Those of ``design``, for slow changes or for fast ones."""

    def design(self, passes_fast: bool, out: NDArray[np.float64]) -> None:
        """Write the coefficients of the order asked for."""
        cutoff, order = self.params.cutoff, self.params.order
        if order == 1:
            first_order(cutoff, self.period, passes_fast, out)
        else:
            second_order(cutoff, math.sqrt(0.5), self.period, passes_fast, out)


class LowPass(Butterworth):
    """A Butterworth low-pass of first or second order, by the prewarped bilinear transform.

    With w = 2 pi cutoff it is 1 / (1 + s / w), or w^2 / (s^2 + sqrt(2) w s + w^2). At the cutoff
    the gain is 1 / sqrt(2). It begins settled at the first input.
    """

    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Those that let slow changes pass."""
        self.design(False, out)


class HighPass(Butterworth):
    """A Butterworth high-pass of first or second order, by the prewarped bilinear transform.

    With w = 2 pi cutoff it is (s / w) / (1 + s / w), or s^2 / (s^2 + sqrt(2) w s + w^2). At the
    cutoff the gain is 1 / sqrt(2). It begins settled at the first input, so the first output is 0.
    """

    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Those that let fast changes pass."""
        self.design(True, out)


class BandStop(LinearFilter):
    """A notch: (s^2 + w^2) / (s^2 + v s + w^2) by the prewarped bilinear transform.

    w = 2 pi centre and v = 2 pi width. Nothing passes at the centre, and of the frequencies around
    it those within about ``width`` are damped by more than 1 / sqrt(2). It begins settled at the
    first input.
    """

    class Params(VectorParameters):
        centre: float = parameter(unit="Hz", gt=0.0, text="the frequency that is taken out")
        width: float = parameter(1.0, unit="Hz", gt=0.0, text="how broad the notch is")

    params: Params

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """The centre must be below half of the block's rate."""
        assert isinstance(params, cls.Params)
        return too_fast("centre", params.centre, context.period)

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        """A centre far below the rate."""
        return {"centre": 50.0, "n": 2}

    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Those of the notch."""
        band_stop(self.params.centre, self.params.width, self.period, out)


class Window(Signal):
    """The last inputs."""

    values = Field(("samples", "n"), text="the last inputs, each in the place of its turn")
    count = Field((), dtype="int64", text="how many inputs there were")


class MovingAverage(UnitOfInput, Block):
    """The mean of the last inputs: y[n] = (u[n] + ... + u[n-k+1]) / k with k = ``samples``.

    At the start it is the mean of the inputs so far. The sum is made anew in every run, so no
    error of rounding grows.
    """

    class Params(VectorParameters):
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

    class Params(VectorParameters):
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
