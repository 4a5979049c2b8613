"""Instants of a run as whole ticks, so that rounding of seconds cannot move them by one."""

from __future__ import annotations

import math

from ...mathematics.kernel import kernel


@kernel
def first_tick(seconds: float, base_period: float) -> int:
    """The first tick that is not before an instant [s]; one that is meant to be on a tick is."""
    return math.ceil(seconds / base_period - 1e-6)
