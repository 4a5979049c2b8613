"""Polynomials between two states of motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .kernel import kernel


@dataclass(frozen=True)
class Quintic:
    """A polynomial of degree five in time, lowest coefficient first."""

    coefficients: tuple[float, ...]

    def position(self, time: float) -> float:
        """The value of the polynomial at ``time``."""
        a, b, c, d, e, f = self.coefficients
        return a + time * (b + time * (c + time * (d + time * (e + time * f))))

    def velocity(self, time: float) -> float:
        """The first derivative at ``time``."""
        _, b, c, d, e, f = self.coefficients
        return b + time * (2 * c + time * (3 * d + time * (4 * e + time * 5 * f)))

    def acceleration(self, time: float) -> float:
        """The second derivative at ``time``."""
        _, _, c, d, e, f = self.coefficients
        return 2 * c + time * (6 * d + time * (12 * e + time * 20 * f))


def quintic(
    duration: float, start: tuple[float, float, float], end: tuple[float, float, float]
) -> Quintic:
    """The quintic from position, velocity and acceleration at 0 to those at ``duration``."""
    t = duration
    matrix = np.array(
        [
            [t**3, t**4, t**5],
            [3 * t**2, 4 * t**3, 5 * t**4],
            [6 * t, 12 * t**2, 20 * t**3],
        ]
    )
    p, v, a = start
    right = np.array([end[0] - p - v * t - 0.5 * a * t**2, end[1] - v - a * t, end[2] - a])
    d, e, f = np.linalg.solve(matrix, right).tolist()
    return Quintic((p, v, 0.5 * a, d, e, f))


@kernel
def minimum_jerk(share: float) -> tuple[float, float, float]:
    """The minimum-jerk motion from 0 to 1: its value and two derivatives after a ``share`` u.

    The motion 10 u^3 - 15 u^4 + 6 u^5 begins and ends at rest. A ``share`` outside of 0 to 1 gives
    the state at the nearer end.
    """
    u = min(max(share, 0.0), 1.0)
    return (
        u * u * u * (10.0 + u * (-15.0 + 6.0 * u)),
        30.0 * u * u * (1.0 - u) * (1.0 - u),
        60.0 * u * (1.0 - u) * (1.0 - 2.0 * u),
    )
