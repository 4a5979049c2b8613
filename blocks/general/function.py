"""A mathematical function of every element."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import parameter
from .elements import Elements
from .vector import Vector

Name = Literal[
    "abs", "sign", "negative", "reciprocal", "square", "sqrt", "exp", "log", "log10",
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "floor", "ceil", "round",
]  # fmt: skip
UFUNCS: Mapping[str, Any] = {
    "abs": np.absolute, "sign": np.sign, "negative": np.negative, "reciprocal": np.reciprocal,
    "square": np.square, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "log10": np.log10,
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos,
    "atan": np.arctan, "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "floor": np.floor,
    "ceil": np.ceil, "round": np.rint,
}  # fmt: skip


class Function(Block):
    """A function of every element by itself: y = f(u).

    Angles are in rad; ``round`` rounds halves to even. Outside a function's domain, such as the
    square root of a negative number, an element is not finite, and that ends the run with the
    block's name.
    """

    class Params(Elements):
        function: Name = parameter("abs", text="which function")

    params: Params
    u = Input(Vector, text="the arguments")
    y = Output(Vector, text="the function's values")

    def setup(self) -> None:
        """Choose the function."""
        self._function = UFUNCS[self.params.function]

    def step(self) -> None:
        """Evaluate it."""
        self._function(self.u.value, out=self.y.value)
