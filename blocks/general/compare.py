"""A comparison of two vectors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import Carried, Given
from .elements import Elements
from .flags import Flags
from .vector import Vector

UFUNCS: Mapping[str, Any] = {
    "<": np.less, "<=": np.less_equal, "==": np.equal, "!=": np.not_equal,
    ">=": np.greater_equal, ">": np.greater,
}  # fmt: skip


class Compare(Block):
    """Element by element whether a < b, or another comparison; exact, with no tolerance.

    To compare with a constant, wire the constant: ``in: {a: sensor.y, b: {value: {value: 0.5}}}``.
    """

    class Params(Elements):
        operation: Literal["<", "<=", "==", "!=", ">=", ">"] = parameter(
            ">", text="the comparison of a with b"
        )

    params: Params
    a = Input(Vector, text="the left side")
    b = Input(Vector, text="the right side")
    y = Output(Flags, text="where it holds")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """Both sides must be the same quantity."""
        given.alike("a", "b")
        return {}

    def setup(self) -> None:
        """Choose the comparison."""
        self._compare = UFUNCS[self.params.operation]

    def step(self) -> None:
        """Compare."""
        self._compare(self.a.value, self.b.value, out=self.y.value)
