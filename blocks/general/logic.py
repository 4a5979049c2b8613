"""Logic of two vectors of truth values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import parameter
from .elements import Elements
from .flags import Flags

UFUNCS: Mapping[str, tuple[Any, bool]] = {
    "and": (np.logical_and, False),
    "or": (np.logical_or, False),
    "xor": (np.logical_xor, False),
    "nand": (np.logical_and, True),
    "nor": (np.logical_or, True),
}
"""The function of each operation, and whether its result is negated."""


class Logic(Block):
    """Element by element: y = a and b, a or b, a xor b, not (a and b), not (a or b)."""

    class Params(Elements):
        operation: Literal["and", "or", "xor", "nand", "nor"] = parameter(
            "and", text="what is done"
        )

    params: Params
    a = Input(Flags, text="the first truth values")
    b = Input(Flags, text="the second truth values")
    y = Output(Flags, text="the result")

    def setup(self) -> None:
        """Choose the operation."""
        self._operation, self._negated = UFUNCS[self.params.operation]

    def step(self) -> None:
        """Combine."""
        self._operation(self.a.value, self.b.value, out=self.y.value)
        if self._negated:
            np.logical_not(self.y.value, out=self.y.value)
