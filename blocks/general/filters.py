"""Filters: Butterworth, band-stop, moving average, filtered derivative."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable
from typing import Literal

from ...mathematics.kernel import kernel
from ...mathematics.linear_systems import advance, band_stop, first_order, second_order, settle
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import SECOND
from .vectors import UnitOfInput, Vector, VectorParameters


class FilterState(Signal):
    """The memory of a second-order filter in transposed direct form II."""

    memory = Field(("n", 2), text="two numbers for each element")
    started = Field((), dtype="bool", text="there was an input")


class LinearFilter(UnitOfInput, Block):
    """The base of the filters: ``prepare`` designs the filter."""

    class Constants(Signal):
        """The filter."""

        coefficients = Field(5, text="b0, b1, b2, a1 and a2")

    u = Input(Vector, text="the signal to filter")
    y = Output(Vector, text="u, filtered")
    x = State(FilterState, text="the filter's memory")

    @abstractmethod
    def prepare(self) -> None:
        """Write b0, b1, b2, a1 and a2 for the block's parameters and period."""

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, x: FilterState, constants: Constants) -> None:
        if not x.started:  # as if the input had always been this one
            settle(constants.coefficients, u.value, x.memory)
            x.started = True
        advance(constants.coefficients, u.value, x.memory, y.value)


def too_fast(name: str, frequency: float, period: float) -> list[UnmetRequirement]:
    """Report a frequency [Hz] that is not below half of the rate at which the block runs."""
    if frequency < 0.5 / period:
        return []
    return [
        UnmetRequirement(
            f"{name} is not below half of the block's rate",
            parameter=name,
            expected=f"below {0.5 / period:g} Hz",
            found=f"{frequency:g} Hz",
        )
    ]


class ButterworthParameters(VectorParameters):
    """A cutoff and an order."""

    cutoff: float = parameter(unit="Hz", gt=0.0, text="frequency of the gain 1 / sqrt(2)")
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
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a cutoff that is not below half of the block's rate."""
        assert isinstance(params, ButterworthParameters)
        return too_fast("cutoff", params.cutoff, context.period)

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        """Return a cutoff far below the rate."""
        return {"cutoff": 20.0, "n": 2, "order": 2}

    @abstractmethod
    def prepare(self) -> None:
        """Say by ``design`` which of the two filters it is."""

    def design(self, high: bool) -> None:
        """Write the coefficients of the order asked for, of a high-pass or a low-pass."""
        cutoff, order, out = self.params.cutoff, self.params.order, self.constants.coefficients
        if order == 1:
            first_order(cutoff, self.period, high, out)
        else:
            second_order(cutoff, math.sqrt(0.5), self.period, high, out)


class LowPass(Butterworth):
    """A Butterworth low-pass of first or second order, by the prewarped bilinear transform.

    With w = 2 pi cutoff it is 1 / (1 + s / w), or w^2 / (s^2 + sqrt(2) w s + w^2). At the cutoff
    the gain is 1 / sqrt(2). It begins settled at the first input.
    """

    def prepare(self) -> None:
        self.design(high=False)


class HighPass(Butterworth):
    """A Butterworth high-pass of first or second order, by the prewarped bilinear transform.

    With w = 2 pi cutoff it is (s / w) / (1 + s / w), or s^2 / (s^2 + sqrt(2) w s + w^2). At the
    cutoff the gain is 1 / sqrt(2). It begins settled at the first input, so the first output is 0.
    """

    def prepare(self) -> None:
        self.design(high=True)


class BandStop(LinearFilter):
    """A notch: (s^2 + w^2) / (s^2 + v s + w^2) by the prewarped bilinear transform.

    w = 2 pi centre and v = 2 pi width. Nothing passes at the centre, and of the frequencies around
    it those within about ``width`` are damped by more than 1 / sqrt(2). It begins settled at the
    first input.
    """

    class Params(VectorParameters):
        centre: float = parameter(unit="Hz", gt=0.0, text="the frequency that is taken out")
        width: float = parameter(1.0, unit="Hz", gt=0.0, text="width of the notch")

    params: Params

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a centre that is not below half of the block's rate."""
        assert isinstance(params, cls.Params)
        return too_fast("centre", params.centre, context.period)

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        """Return a centre far below the rate."""
        return {"centre": 50.0, "n": 2}

    def prepare(self) -> None:
        p = self.params
        band_stop(p.centre, p.width, self.period, self.constants.coefficients)


class RecentInputs(Signal):
    """The last inputs."""

    values = Field(("samples", "n"), text="the last inputs, each in the place of its turn")
    count = Field((), dtype="int64", text="number of inputs so far")


class MovingAverage(UnitOfInput, Block):
    """The mean of the last inputs: y[n] = (u[n] + ... + u[n-k+1]) / k with k = ``samples``.

    At the start it is the mean of the inputs so far. The sum is made anew in every run, so no
    error of rounding grows.
    """

    class Params(VectorParameters):
        samples: int = parameter(10, ge=1, text="k, the number of inputs that are averaged")

    params: Params
    u = Input(Vector, text="the signal to average")
    y = Output(Vector, text="the mean")
    x = State(RecentInputs, text="the last inputs")

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, x: RecentInputs, params: Params) -> None:
        samples = params.samples
        x.values[x.count % samples, :] = u.value
        x.count += 1
        known = min(x.count, samples)
        if y.value.size > 8:  # many sums at once
            y.value[:] = 0.0
            for k in range(samples):
                y.value[:] += x.values[k, :]
            y.value[:] /= known
            return
        for i in range(y.value.size):  # a sum in a register does not wait for memory
            total = 0.0
            for k in range(samples):
                total += x.values[k, i]
            y.value[i] = total / known


class DerivativeState(Signal):
    """Memory of a filtered derivative."""

    value = Field("n", text="the input before")
    rate = Field("n", text="the derivative before")
    started = Field((), dtype="bool", text="there was an input")


class FilteredDerivative(Block):
    """The derivative s / (1 + tau s) by backward differences, which never rings:

    y[n] = (tau y[n-1] + u[n] - u[n-1]) / (tau + T), and y = 0 at the first input.

    T is the block's period. With ``time_constant`` 0 it is the plain difference (u[n] - u[n-1]) / T.
    """

    class Params(VectorParameters):
        time_constant: float = live_parameter(0.01, unit="s", ge=0.0, text="tau, of the smoothing")

    class Constants(Signal):
        """The weights of the difference equation."""

        decay = Field(text="tau / (tau + T)")
        gain = Field(unit="1/s", text="1 / (tau + T)")

    params: Params
    u = Input(Vector, text="the signal to differentiate")
    y = Output(Vector, text="its rate per second")
    x = State(DerivativeState, text="the input and the derivative before")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the unit of the input by a second."""
        u = inputs["u"]
        return {"y": u and u.times(SECOND, -1)}

    def prepare(self) -> None:
        tau = self.params.time_constant
        self.constants.decay = tau / (tau + self.period)
        self.constants.gain = 1.0 / (tau + self.period)

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, x: DerivativeState, constants: Constants) -> None:
        if not x.started:
            x.value[:] = u.value
            x.started = True
        x.rate[:] = x.rate * constants.decay + (u.value - x.value) * constants.gain
        x.value[:] = u.value
        y.value[:] = x.rate
