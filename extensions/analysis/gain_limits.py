"""The factors on a loop's gain at which it becomes unstable, or stable: its closed loop's poles decide.

Where the loop's transfer meets the real axis there may be a limit. A sampled loop meets it also at
frequency 0 and at half its sampling rate, where no frequency of a grid is: a first-order loop u = -K x has
its only limit there. What is found so is a candidate. It is a limit if the number of poles outside of the
unit circle differs on its two sides. Poles slower than ``slowest`` are drift, as of blocks that learn; at
frequency 0 every limit begins so, so there a pole must be faster at half or twice the gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from .linearisation import Linearisation

ON_CIRCLE = 1e-6
"""A pole that is no farther outside of the unit circle than this is taken to lie on it: drift."""
SIDES = (2e-3, 2e-2)
"""The distances of a candidate's two sides from it: first near, then farther, for one that was interpolated."""
EXACT = 2e-5
"""The relative error of a limit that was interpolated."""
_BESIDE = 1e-6
"""The distance from 1 or -1 at which a transfer with a pole there is computed."""


class ClosedLoop:
    """A loop that was opened at a wire, closed with some gain on some of its channels.

    Args:
        model: of a wire, opened, to itself.
        columns: the inputs of the model on which the gain is; on all others it is 1.
        slowest: the frequency below which a pole is drift [rad/s].
    """

    def __init__(self, model: Linearisation, columns: Sequence[int], slowest: float) -> None:
        self._model = model
        self._slowest = slowest
        self._columns = list(columns)
        self._others = [k for k in range(len(model.inputs)) if k not in set(columns)]

    def limits(self, candidates: Array) -> tuple[float, float]:
        """Return the least limit above 1, infinite without one, and the greatest below, 0 without one.

        ``candidates`` are gains, (n,), at which the loop meets the real axis between the ends.
        """
        found = [(float(gain), False) for gain in (*candidates, *self._gains_at(-1.0))]
        found += [(gain, True) for gain in self._gains_at(1.0)]
        found = sorted(each for each in found if 0.0 < each[0] < np.inf)
        above = [each for each in found if each[0] >= 1.0]
        below = [each for each in reversed(found) if each[0] < 1.0]
        up = next((g for each in above if (g := self._limit(*each)) is not None), np.inf)
        down = next((g for each in below if (g := self._limit(*each)) is not None), 0.0)
        return up, down

    def _limit(self, gain: float, at_zero: bool) -> float | None:
        """Return the limit at a candidate, or ``None`` where the poles do not change there."""
        if at_zero:
            return gain if self._runaways(0.5 * gain) != self._runaways(2.0 * gain) else None
        for side in SIDES:
            low, high = gain * (1.0 - side), gain * (1.0 + side)
            if low < 1.0 < high:  # the present gain is on its own side
                low, high = (1.0, high) if gain >= 1.0 else (low, 1.0)
            before = self._unstable(low)
            if before == self._unstable(high):
                continue
            while high - low > EXACT * low:
                middle = 0.5 * (low + high)
                if self._unstable(middle) == before:
                    low = middle
                else:
                    high = middle
            found = 0.5 * (low + high)
            return gain if abs(found - gain) <= 2.0 * EXACT * gain else found
        return None

    def _unstable(self, gain: float) -> int:
        """Return the number of poles outside of the unit circle, with a gain; drift does not count."""
        poles = self._poles(gain)
        fast = self._rate(poles) > 0.5 * self._slowest
        return int(((np.abs(poles) > 1.0 + ON_CIRCLE) & fast).sum())

    def _runaways(self, gain: float) -> int:
        """Return the number of poles that grow without oscillating, faster than drift, with a gain."""
        poles = self._poles(gain)
        turn = np.abs(np.angle(poles)) / self._model.period
        growing = (np.abs(poles) > 1.0) & (self._rate(poles) > self._slowest)
        return int((growing & (turn < 0.5 * self._slowest)).sum())

    def _rate(self, poles: Any) -> Array:
        """Return the rates |s| of poles z = exp(s period) [1/s]."""
        found = np.log(np.where(poles == 0.0, 1e-300, poles))
        return np.asarray(np.abs(found)) / self._model.period

    def _poles(self, gain: float) -> Any:
        """Return the poles of the loop closed with a gain, complex."""
        model, count = self._model, len(self._model.inputs)
        gains = np.ones(count)
        gains[self._columns] = gain
        through = np.linalg.solve(np.eye(count) - model.d * gains, model.c)
        return np.linalg.eigvals(model.a + (model.b * gains) @ through).astype(complex)

    def _gains_at(self, z: float) -> list[float]:
        """Return the positive gains at which there is a pole at z = 1 or -1: frequency 0 or half the rate."""
        loop = self._transfer(z)
        if self._others:
            some, others = self._columns, self._others
            inner = np.eye(len(others)) - loop[np.ix_(others, others)]
            through = np.linalg.solve(inner, loop[np.ix_(others, some)])
            loop = loop[np.ix_(some, some)] + loop[np.ix_(some, others)] @ through
        return [
            1.0 / float(value.real)
            for value in np.linalg.eigvals(loop).astype(complex)
            if abs(value.imag) <= 1e-6 * abs(value) and value.real > 0.0
        ]

    def _transfer(self, z: float) -> Array:
        """Return the transfer of the opened loop at z = 1 or -1, or beside it where it has a pole there."""
        model = self._model
        n = len(model.a)
        if n == 0:
            return np.array(model.d)
        pencil = z * np.eye(n) - model.a
        if np.linalg.cond(pencil) > 1e12:
            pencil = z * (1.0 + _BESIDE) * np.eye(n) - model.a
        return np.asarray(model.d + model.c @ np.linalg.solve(pencil, model.b))
