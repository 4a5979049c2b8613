"""A vector times a constant."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import live_parameter
from .elements import Elements, PerElement
from .quantity_parameters import InUnit, Scales
from .vector import Vector


class Gain(Scales, Block):
    """The input times a constant: y = gain u.

    There may be one gain for each element. ``MatrixGain`` multiplies by a matrix.
    """

    class Params(Elements, InUnit):
        in_unit = ("gain",)

        gain: PerElement = live_parameter(1.0, text="the factor")

    params: Params
    u = Input(Vector, text="what is scaled")
    y = Output(Vector, text="gain times u")

    def setup(self) -> None:
        """Keep the factor at hand."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Keep the factor as an array, so that no tick allocates one."""
        self._gain = np.array(self.params.gain)

    def step(self) -> None:
        """Multiply."""
        np.multiply(self.u.value, self._gain, out=self.y.value)
