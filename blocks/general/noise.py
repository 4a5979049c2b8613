"""Gaussian noise, white and coloured."""

from __future__ import annotations

import math

import numpy as np

from ...runtime.language.block import Block, Output, State
from ...runtime.language.parameters import live_parameter, parameter
from ...runtime.language.random_stream import RandomStream, StreamState
from ...runtime.language.signals import Field
from .vectors import (
    ScalarOrVector,
    SourceParameters,
    UnitFromParameters,
    Vector,
    VectorParameters,
    broadcast,
)


class WhiteNoise(UnitFromParameters, Block):
    """Gaussian noise: every element of every run is drawn anew, y = mean + std N(0, 1).

    ``std`` is that of one sample. For a noise density d per square root of Hz it is d sqrt(f / 2)
    at a rate f. The stream depends on ``seed`` and on the block's path.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = (
            "std",
            "mean",
        )

        std: ScalarOrVector = live_parameter(1.0, text="standard deviation of one sample")
        mean: ScalarOrVector = live_parameter(0.0, text="the mean")
        seed: int = parameter(0, ge=0, text="of the random stream")

    params: Params
    y = Output(Vector, text="the noise")
    stream = State(StreamState, text="the random stream")

    def setup(self) -> None:
        """Make the stream."""
        self._random = RandomStream(self, self.params.seed)
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep mean and deviation as arrays."""
        self._std = broadcast(self.params.std, self.params.n)
        self._mean = broadcast(self.params.mean, self.params.n)

    def step(self) -> None:
        """Draw."""
        self._random.generator.standard_normal(out=self.y.value)
        np.multiply(self.y.value, self._std, out=self.y.value)
        np.add(self.y.value, self._mean, out=self.y.value)

    def freeze(self) -> None:
        """Keep where the stream is."""
        self._random.save(self.stream)

    def thaw(self) -> None:
        """Take it back."""
        self._random.load(self.stream)


class NoiseState(StreamState):
    """A random stream, and the noise it has made."""

    value = Field("n", text="the noise in units of its deviation")
    started = Field((), dtype="bool", text="whether there was a run")


class ColouredNoise(UnitFromParameters, Block):
    """First-order Gauss-Markov noise, sampled exactly: y = std x with

    x[n] = f x[n-1] + sqrt(1 - f^2) N(0, 1), f = exp(-T / correlation_time), x[0] = N(0, 1).

    Its deviation is ``std`` from the first run on, its autocorrelation falls to 1 / e within the
    correlation time. T is the block's period. The stream depends on ``seed`` and the block's path.
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = ("std",)

        std: ScalarOrVector = live_parameter(1.0, text="standard deviation")
        correlation_time: float = parameter(
            0.1, unit="s", gt=0.0, text="in which the autocorrelation falls to 1 / e"
        )
        seed: int = parameter(0, ge=0, text="of the random stream")

    params: Params
    y = Output(Vector, text="the noise")
    x = State(NoiseState, text="the noise and its random stream")

    def setup(self) -> None:
        """Make the stream."""
        self._random = RandomStream(self, self.params.seed)
        factor = math.exp(-self.period / self.params.correlation_time)
        self._keep = np.array(factor)
        self._new = np.array(math.sqrt(1.0 - factor * factor))
        self._drawn = np.zeros(self.params.n)
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep the deviation as an array."""
        self._std = broadcast(self.params.std, self.params.n)

    def step(self) -> None:
        """Forget a little, and add something new."""
        value = self.x.value
        self._random.generator.standard_normal(out=self._drawn)
        if self.x.started:
            np.multiply(value, self._keep, out=value)
            np.multiply(self._drawn, self._new, out=self._drawn)
        self.x.started[...] = True
        np.add(value, self._drawn, out=value)
        np.multiply(value, self._std, out=self.y.value)

    def freeze(self) -> None:
        """Keep where the stream is."""
        self._random.save(self.x)

    def thaw(self) -> None:
        """Take it back."""
        self._random.load(self.x)
