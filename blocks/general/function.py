"""A mathematical function of every element."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.errors import UnitError
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import Carried, Given, Quantity
from ...runtime.language.unit_algebra import ONE, root
from ...runtime.language.units import parse_unit
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


_SAME = ("abs", "negative", "floor", "ceil", "round")
_OF_ANGLES = ("sin", "cos", "tan")
_TO_ANGLES = ("asin", "acos", "atan")


def _quantity(name: str, given: Given) -> Quantity | None:
    """What a function makes of the quantity of ``u``."""
    u = given["u"]
    if u is None or name in _SAME:
        return u
    if name == "reciprocal":
        return Quantity(frame=u.frame).times(u.unit, -1)
    if name == "square":
        return u.times(u.unit)
    if name == "sqrt":
        try:
            return Quantity(None if u.unit is None else root(u.unit), u.frame)
        except UnitError as error:
            given.refuse("u", str(error))
            return Quantity(None)
    if name in _OF_ANGLES:
        given.demand("u", ("rad", ""), f"{name} takes angles in rad")
    elif name != "sign":
        given.demand("u", ("",), f"{name} takes plain numbers")
    return Quantity(parse_unit("rad") if name in _TO_ANGLES else ONE)


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

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """Angles go into sin, cos and tan; roots need even powers."""
        assert isinstance(params, cls.Params)
        return {"y": _quantity(params.function, given)}

    def setup(self) -> None:
        """Choose the function."""
        self._function = UFUNCS[self.params.function]

    def step(self) -> None:
        """Evaluate it."""
        self._function(self.u.value, out=self.y.value)
