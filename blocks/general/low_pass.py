"""A filter that passes slow changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .butterworth import Butterworth


class LowPass(Butterworth):
    """A Butterworth low-pass of first or second order, by the prewarped bilinear transform.

    With w = 2 pi cutoff it is 1 / (1 + s / w), or w^2 / (s^2 + sqrt(2) w s + w^2). At the cutoff
    the gain is 1 / sqrt(2). It begins settled at the first input.
    """

    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Those that let slow changes pass."""
        self.design(False, out)
