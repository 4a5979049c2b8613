"""The confidence interval of a success rate."""

from __future__ import annotations

import math

Z_95 = 1.959963984540054
"""The standard normal's quantile that leaves 2.5 % above it."""


def wilson_interval(successes: int, n: int, z: float = Z_95) -> tuple[float, float]:
    """The score interval of E. B. Wilson (1927) for a probability of success.

        centre = (p + z^2 / 2n) / (1 + z^2 / n)
        half   = z / (1 + z^2 / n) sqrt(p (1 - p) / n + z^2 / 4n^2)

    with p = successes / n. Unlike the interval around p it never leaves [0, 1], and it says
    something also where all runs succeed: 40 of 40 give 0.912 to 1. Without runs it is (0, 1).

    Raises:
        ValueError: there are fewer than no successes, or more of them than runs.
    """
    if not 0 <= successes <= n:
        raise ValueError(f"{successes} successes of {n} runs")
    if n == 0:
        return 0.0, 1.0
    p = successes / n
    scale = 1.0 + z * z / n
    centre = (p + z * z / (2 * n)) / scale
    half = z / scale * math.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n))
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == n else min(1.0, centre + half)
    return low, high
