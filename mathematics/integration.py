"""Integrates ordinary differential equations dx/dt = f(t, x) with a fixed step, for blocks of plants.

A method is made once, with memory for its stages, and ``step`` then replaces x by the state one step
later. It allocates nothing, and has no tolerance that could make two machines go different ways.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .arrays import Array

Rates = Callable[[float, Array, Array], None]
"""Writes dx/dt at a time [s] and a state into its last argument."""


class RungeKutta:
    """The classical method of order four, four evaluations a step. It is not for stiff systems.

    Args:
        rates: f.
        n: the number of states.
        substeps: how many steps a call of ``step`` is divided into.
    """

    def __init__(self, rates: Rates, n: int, substeps: int = 1) -> None:
        self._rates = rates
        self._substeps = substeps
        self._k = np.zeros((4, n))
        self._x = np.zeros(n)

    def step(self, time: float, x: Array, period: float) -> None:
        """Replace x at ``time`` by x one ``period`` [s] later."""
        h = period / self._substeps
        for number in range(self._substeps):
            self._one(time + number * h, x, h)

    def _one(self, time: float, x: Array, h: float) -> None:
        k, at = self._k, self._x
        self._rates(time, x, k[0])
        for stage, share in ((1, 0.5), (2, 0.5), (3, 1.0)):
            for i in range(len(x)):
                at[i] = x[i] + share * h * k[stage - 1, i]
            self._rates(time + share * h, at, k[stage])
        for i in range(len(x)):
            x[i] += h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
