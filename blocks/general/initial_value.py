"""The common parameters of blocks whose state is a vector."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.errors import BlockError
from ...runtime.language.parameters import Parameters, parameter


class InitialParameters(Parameters):
    """The parameters of blocks that start from a vector."""

    n: int = parameter(1, ge=1, text="elements")
    initial: float | list[float] = parameter(
        0.0, text="the first output: n numbers, or one for all elements"
    )

    def start_value(self) -> NDArray[np.float64]:
        """``initial`` as an array. Raises ``BlockError`` if it has not n elements."""
        value = np.asarray(self.initial, np.float64)
        if value.shape not in ((), (self.n,)):
            raise BlockError(f"initial has {value.size} elements, expected n = {self.n}")
        return value
