"""The product or quotient of two vectors."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import Carried, Given
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

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The product or quotient of the units; a frame is kept."""
        assert isinstance(params, cls.Params)
        a, b = given["a"], given["b"]
        if a is None or b is None:
            return {}
        y = a.times(b.unit, 1 if params.operation == "multiply" else -1)
        return {"y": replace(y, frame=a.frame or b.frame)}

    def setup(self) -> None:
        """Choose the operation."""
        self._operation = np.multiply if self.params.operation == "multiply" else np.divide

    def step(self) -> None:
        """Multiply or divide."""
        self._operation(self.a.value, self.b.value, out=self.y.value)
