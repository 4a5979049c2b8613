"""The common parameters of blocks whose state is a vector."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.parameters import parameter
from .elements import Elements, PerElement, spread


class InitialParameters(Elements):
    """The parameters of blocks that start from a vector."""

    initial: PerElement = parameter(
        0.0, text="the first output: n numbers, or one for all elements"
    )

    def start_value(self) -> NDArray[np.float64]:
        """``initial`` as an array of n elements."""
        return spread(self.initial, self.n)
