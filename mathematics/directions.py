"""Unit vectors."""

from __future__ import annotations

import math

from .kernel import kernel


@kernel
def unit(
    x: float, y: float, z: float, default_x: float, default_y: float, default_z: float
) -> tuple[float, float, float]:
    """The unit vector along (x, y, z), or the default where there is no direction.

    Dividing by the largest element first keeps very long and very short vectors exact.
    """
    largest = max(abs(x), abs(y), abs(z))
    if largest < 1e-300:
        return default_x, default_y, default_z
    x, y, z = x / largest, y / largest, z / largest
    size = math.sqrt(x * x + y * y + z * z)
    return x / size, y / size, z / size
