"""The product or quotient of two vectors."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import parameter
from .elements import Elements
from .vector import Vector


class Product(Block):
    """Element by element: y = a b, or y = a / b.

    A division by zero makes an element infinite, which ends the run with the block's name.
    """

    class Params(Elements):
        operation: Literal["multiply", "divide"] = parameter("multiply", text="what is done")

    params: Params
    a = Input(Vector, text="the first factor, or the dividend")
    b = Input(Vector, text="the second factor, or the divisor")
    y = Output(Vector, text="the product or quotient")

    def setup(self) -> None:
        """Choose the operation."""
        self._operation = np.multiply if self.params.operation == "multiply" else np.divide

    def step(self) -> None:
        """Multiply or divide."""
        self._operation(self.a.value, self.b.value, out=self.y.value)
