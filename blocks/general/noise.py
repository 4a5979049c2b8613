"""Gaussian noise, white and coloured."""

from __future__ import annotations

import math

import numpy as np

from ...mathematics.elementary import exp
from ...runtime.language.block import Block, Output, State
from ...runtime.language.parameters import ScalarOrVector, live_parameter, parameter
from ...runtime.language.random_stream import RandomStream, StreamState
from ...runtime.language.signals import Field, Signal
from .vectors import (
    SourceParameters,
    UnitFromParameters,
    Vector,
    VectorParameters,
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

    class Constants(Signal):
        """The parameters of each element."""

        std = Field("n", text="standard deviation of one sample")
        mean = Field("n", text="the mean")

    params: Params
    y = Output(Vector, text="the noise")
    stream = State(StreamState, text="the random stream")

    def save_state(self) -> None:
        """Keep where the stream is."""
        self._random.save(self.stream)

    def load_state(self) -> None:
        """Take it back."""
        self._random.load(self.stream)

    def setup(self) -> None:
        self._random = RandomStream(self, self.params.seed)

    def prepare(self) -> None:
        self.constants.std[...] = self.params.std
        self.constants.mean[...] = self.params.mean

    def step(self) -> None:
        """Draw from the stream; the numbers are NumPy's, so this stays Python."""
        y = self.y.value
        self._random.generator.standard_normal(out=y)
        np.multiply(y, self.constants.std, out=y)
        np.add(y, self.constants.mean, out=y)


class NoiseState(StreamState):
    """A random stream, and the noise it has made."""

    value = Field("n", text="the noise in units of its deviation")
    started = Field((), dtype="bool", text="there was a run")


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

    class Constants(Signal):
        """Constants derived from the parameters."""

        decay = Field(text="f")
        share = Field(text="sqrt(1 - f^2)")
        std = Field("n", text="standard deviation")

    class Scratch(Signal):
        """Scratch memory of one step."""

        sample = Field("n", text="the drawn numbers")

    params: Params
    y = Output(Vector, text="the noise")
    x = State(NoiseState, text="the noise and its random stream")

    def save_state(self) -> None:
        """Keep where the stream is."""
        self._random.save(self.x)

    def load_state(self) -> None:
        """Take it back."""
        self._random.load(self.x)

    def setup(self) -> None:
        self._random = RandomStream(self, self.params.seed)

    def prepare(self) -> None:
        decay = exp(-self.period / self.params.correlation_time)
        self.constants.decay = decay
        self.constants.share = math.sqrt(1.0 - decay * decay)
        self.constants.std[...] = self.params.std

    def step(self) -> None:
        """Decay, and add a new sample of NumPy's stream."""
        value, sample, constants = self.x.value, self.scratch.sample, self.constants
        self._random.generator.standard_normal(out=sample)
        if self.x.started:
            np.multiply(value, constants.decay, out=value)
            np.multiply(sample, constants.share, out=sample)
        self.x.started = True
        np.add(value, sample, out=value)
        np.multiply(value, constants.std, out=self.y.value)
