"""The types of the arrays that the whole package computes with, named once."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
Indices: TypeAlias = NDArray[np.int64]
Counts: TypeAlias = NDArray[np.int64]
"""As ``Indices``, for numbers that say how many."""
