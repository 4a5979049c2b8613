"""The delay from a tick's instant to the torques computed in it, from commanded and measured torques."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from .rigid_body import IdentificationError, Value

LONGEST = 20
"""Delays up to so many ticks are looked for."""
_FEWEST = 50
_RESOLUTION = 0.05
"""The smallest standard deviation that is claimed, in ticks: commands may come a little earlier or later."""
_PARTS = 10
"""The parts of a run whose delays are compared."""


@dataclass(frozen=True)
class Delay:
    """What was found.

    Attributes:
        delay: from a tick's instant until its command acts [s].
        correlation: between the changes of the measured torques and those expected with this delay.
        ticks: how many were used.
    """

    delay: Value
    correlation: float
    ticks: int


def identify_delay(
    period: float, commanded: Array, measured: Array, feedback: NDArray[np.bool_]
) -> Delay:
    """Find the delay between commands and torques.

    The command of tick k acts from t_k + d until the next one acts. A measured torque is the mean over
    the tick before, so with d = (j + share) T its change is ``(1 - share)`` of the command's change
    j + 1 ticks earlier and ``share`` of the one before that. Of all whole j and shares that pair is
    taken for which expected and measured changes correlate most.

    Args:
        period: T [s].
        commanded: feedforward torques [N m], (n, n_joints).
        measured: mean torques over the tick before [N m], (n, n_joints).
        feedback: the ticks whose commands have joint feedback; they are not used, (n,).

    Raises:
        IdentificationError: too few ticks have torques without joint feedback.
    """
    lags = LONGEST + 2
    clean = np.convolve(feedback, np.ones(lags + 1))[: len(feedback)] < 0.5
    clean[: lags + 1] = False
    used = np.flatnonzero(clean)
    if len(used) < _FEWEST:
        raise IdentificationError(
            f"only {len(used)} ticks have commands without joint feedback; {_FEWEST} are needed to find "
            "the delay: record a run in which the robot stands or squats"
        )
    changes = np.diff(commanded, axis=0, prepend=commanded[:1])
    best = (-1.0, 0, 0.0)
    for j in range(LONGEST):
        correlation, share = _fit(changes, measured, used, j)
        if correlation > best[0]:
            best = (correlation, j, share)
    correlation, j, share = best
    if correlation < 0.3:
        raise IdentificationError(
            "the measured torques do not follow the commanded ones at any delay up to "
            f"{1e3 * LONGEST * period:g} ms (correlation {correlation:.2f})"
        )
    parts = [_fit(changes, measured, part, j)[1] for part in np.array_split(used, _PARTS)]
    std = max(float(np.std(parts, ddof=1)) / math.sqrt(_PARTS), _RESOLUTION)
    return Delay(Value((j + share) * period, std * period), correlation, len(used))


def _fit(changes: Array, measured: Array, used: NDArray[np.int64], j: int) -> tuple[float, float]:
    """How well measured changes correlate with those of the commands j + 1 and j + 2 ticks earlier,
    and the share of the latter."""
    seen = (measured[used] - measured[used - 1]).ravel()
    first = changes[used - 1 - j].ravel()
    step = changes[used - 2 - j].ravel() - first
    square = float(step @ step)
    if square <= 0.0:
        return 0.0, 0.0
    share = min(1.0, max(0.0, float(step @ (seen - first)) / square))
    expected = first + share * step
    size = float(np.linalg.norm(expected) * np.linalg.norm(seen))
    return (float(expected @ seen) / size if size > 0.0 else 0.0), share
