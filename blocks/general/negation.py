"""The opposite of truth values."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output
from .elements import Elements
from .flags import Flags


class Not(Block):
    """Element by element: y = not u."""

    Params = Elements
    params: Elements
    u = Input(Flags, text="the truth values")
    y = Output(Flags, text="their opposites")

    def step(self) -> None:
        """Negate."""
        np.logical_not(self.u.value, out=self.y.value)
