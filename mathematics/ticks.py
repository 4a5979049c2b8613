"""Instants and durations counted in ticks, so that what is meant to fall on a tick does.

Seconds divided by a period are rarely whole in floating-point numbers: 0.3 s at 1 kHz is the tick 300, but
the remainder of 0.9 s by 0.3 s is 0.3 s less a rounding, and not zero. All arithmetic on time that decides
in which tick something happens is therefore done in ticks, in which numbers of ticks are exact up to 2^53.
"""

from __future__ import annotations

import math

import numpy as np

from .arrays import Array, Array1D
from .kernel import kernel

ON_TICK = 1e-6
"""An instant that is no farther from a tick than this share of one is meant to be on it."""


@kernel
def in_ticks(seconds: float, base_period: float) -> float:
    """Return an instant or a duration [s] in ticks; a whole number where it is meant to be one."""
    exact = seconds / base_period
    whole = math.floor(exact + 0.5)
    if abs(exact - whole) <= ON_TICK:
        return float(whole)
    return exact


@kernel
def first_tick(seconds: float, base_period: float) -> int:
    """Return the first tick that is not before an instant [s]."""
    return math.ceil(in_ticks(seconds, base_period))


@kernel
def since_begin(now: float, begin: float, length: float) -> float:
    """Return the ticks since the present one of the periods of ``length`` ticks began, the first of
    which began at ``begin``; from 0 to less than ``length``.

    A ``length`` that is not whole is met by a tick now and then, as 333.3 is by the thousandth:
    that one is zero, too.
    """
    found = (now - begin) % length
    if found > length - ON_TICK:
        return 0.0
    return found


def all_in_ticks(seconds: Array1D, base_period: float, rounding: float = 0.0) -> Array:
    """Return instants [s], (n,), in ticks; whole numbers where they are meant to be.

    ``rounding`` is how far off the instants may be [s], as differences of times of day are.
    """
    exact = np.asarray(seconds, np.float64) / base_period
    whole = np.floor(exact + 0.5)
    near = min(ON_TICK + rounding / base_period, 0.1)
    return np.where(np.abs(exact - whole) <= near, whole, exact)
