"""A filter that passes fast changes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .butterworth import Butterworth


class HighPass(Butterworth):
    """A Butterworth high-pass of first or second order, by the prewarped bilinear transform.

    With w = 2 pi cutoff it is (s / w) / (1 + s / w), or s^2 / (s^2 + sqrt(2) w s + w^2). At the
    cutoff the gain is 1 / sqrt(2). It begins settled at the first input, so the first output is 0.
    """

    def coefficients(self, out: NDArray[np.float64]) -> None:
        """Those that let fast changes pass."""
        self.design(True, out)
