"""Columns of a log at the times of their rows: where they have gaps, and whether a tick's sample is a new one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...mathematics.arrays import Array, Array1D, Flags
from .columns import LATE, last_rows, usual_step

GAP = 5.0
"""Steps between two rows, in usual ones, above which there is a gap."""


@dataclass(frozen=True)
class Series:
    """Columns ``values`` (n, k) at their ``stamps`` (n,) [s].

    ``lost`` rows were no numbers, ``same`` had the time of a later one; the clock began again ``wraps`` times, and an even grid
    is ``shift`` [s] from the stamps.
    """

    stamps: Array1D
    values: Array
    parameter: str = ""
    lost: int = 0
    same: int = 0
    wraps: int = 0
    shift: float = 0.0

    def gaps(self) -> Flags:
        """Return whether a gap follows each row (n,)."""
        steps = np.diff(self.stamps, append=self.stamps[-1])
        return steps > GAP * usual_step(self.stamps)

    def spread(self) -> float:
        """Return the standard deviation of the steps between rows, relative to their mean, without gaps."""
        steps = np.diff(self.stamps)[~self.gaps()[:-1]]
        return float(steps.std() / steps.mean()) if steps.any() else 0.0

    def validity(self, times: Array1D, repeated: Flags) -> tuple[Flags, Array1D]:
        """Return at each time (m,) whether the last sample is a new one and no gap is there, and the sample's age [s].

        Args:
            repeated: whether each row repeats the one before, (n,).
        """
        last = last_rows(self.stamps, times, hold=True)
        renewed = np.maximum.accumulate(np.where(repeated, 0, np.arange(len(repeated))))
        within = self.gaps()[last] & (times > self.stamps[last] + LATE)
        return ~repeated[last] & ~within, times - self.stamps[renewed[last]]
