"""Checks of lower and upper bounds that blocks share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Misfit
from .elements import PerElement, spread_bound


def crossed_bounds(lower: PerElement | None, upper: PerElement | None, n: int) -> Iterable[Misfit]:
    """A misfit where a lower bound is above its upper one."""
    low, high = spread_bound(lower, n, -np.inf), spread_bound(upper, n, np.inf)
    for i in np.flatnonzero(low > high)[:1]:
        yield Misfit(
            f"the lower bound of element {i} is above the upper one",
            parameter="lower",
            expected=f"at most {high[i]:g}",
            found=f"{low[i]:g}",
        )


class Bounded:
    """The base of blocks whose parameters ``lower`` and ``upper`` bound ``n`` elements."""

    @classmethod
    def requires(cls, params: Any, robot: RobotDescription | None) -> Iterable[Misfit]:
        """The bounds must not cross."""
        return crossed_bounds(params.lower, params.upper, params.n)
