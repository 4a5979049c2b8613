"""Gaussian noise that is independent from run to run."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Output, State
from ...runtime.language.parameters import live_parameter, parameter
from ...runtime.language.random_stream import RandomStream, StreamState
from .elements import Elements, PerElement, spread
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class WhiteNoise(Says, Block):
    """Gaussian noise: every element of every run is drawn anew, y = mean + std N(0, 1).

    ``std`` is that of one sample. For a noise density d per square root of Hz it is d sqrt(f / 2)
    at a rate f. The stream depends on ``seed`` and on the block's path.
    """

    class Params(Elements, SourceParameters):
        in_unit = (
            "std",
            "mean",
        )

        std: PerElement = live_parameter(1.0, text="standard deviation of one sample")
        mean: PerElement = live_parameter(0.0, text="the mean")
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
        self._std = spread(self.params.std, self.params.n)
        self._mean = spread(self.params.mean, self.params.n)

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
