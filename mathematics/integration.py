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

GAMMA = 0.43586652150845899942
"""The root of g^3 - 3 g^2 + 3/2 g - 1/6 for which the method of ``Implicit`` is L-stable."""
NEWTON_STEPS = 12
"""Newton's method has converged after three or four, or does not."""
CONVERGED = 1e-12
"""The relative size of Newton's last correction."""
_DIFFERENCE = 1.5e-8
"""About the root of the machine's precision: the best step of a one-sided difference."""


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


class Implicit:
    """An L-stable, stiffly accurate diagonally implicit method of order three with three stages.

    Fast parts that have died out stay away whatever the step is. (Alexander, Diagonally implicit
    Runge-Kutta methods for stiff ODEs, SIAM Journal on Numerical Analysis 14, 1977.) Stages are found
    by Newton's method with a Jacobian from differences, so a step takes about 12 (n + 1)
    evaluations.

    Args:
        rates: f.
        n: the number of states.
        substeps: how many steps a call of ``step`` is divided into.
    """

    def __init__(self, rates: Rates, n: int, substeps: int = 1) -> None:
        self._rates = rates
        self._substeps = substeps
        self._k = np.zeros((3, n))
        self._matrix = np.zeros((n, n))
        self._rows = np.zeros(n, np.int64)
        self._base, self._at, self._f, self._residual = (np.zeros(n) for _ in range(4))
        g = GAMMA
        b1 = -(6.0 * g * g - 16.0 * g + 1.0) / 4.0
        b2 = (6.0 * g * g - 20.0 * g + 5.0) / 4.0
        self._a = ((g,), ((1.0 - g) / 2.0, g), (b1, b2, g))
        self._c = (g, (1.0 + g) / 2.0, 1.0)

    def step(self, time: float, x: Array, period: float) -> None:
        """Replace x at ``time`` by x one ``period`` [s] later.

        Raises:
            ArithmeticError: Newton's method does not converge; smaller steps may help.
        """
        h = period / self._substeps
        for number in range(self._substeps):
            self._one(time + number * h, x, h)

    def _one(self, time: float, x: Array, h: float) -> None:
        k, base = self._k, self._base
        self._rates(time, x, self._f)
        for stage, shares in enumerate(self._a):
            for i in range(len(x)):
                base[i] = x[i]
                for earlier in range(stage):
                    base[i] += h * shares[earlier] * k[earlier, i]
                k[stage, i] = k[stage - 1, i] if stage else self._f[i]
            self._solve(time + self._c[stage] * h, h, k[stage])
        for i in range(len(x)):
            x[i] = base[i] + h * GAMMA * k[2, i]

    def _solve(self, time: float, h: float, k: Array) -> None:
        """Find k = f(time, base + h GAMMA k) from a first guess."""
        at, f, residual = self._at, self._f, self._residual
        for _ in range(NEWTON_STEPS):
            size, large = 1e-300, 0.0
            for i in range(len(k)):
                at[i] = self._base[i] + h * GAMMA * k[i]
                size, large = max(size, abs(k[i])), max(large, abs(at[i]))
            self._factorise(time, at, h)
            for i in range(len(k)):
                residual[i] = f[i] - k[i]
            self._substitute(residual)
            correction = 0.0
            for i in range(len(k)):
                k[i] += residual[i]
                correction = max(correction, abs(residual[i]))
            # what is left is of the size of the correction's square, or of rounding in x / h
            if correction <= CONVERGED * size + 1e-15 * large / h:
                return
        raise ArithmeticError(
            f"the implicit step of {h:g} s at {time:g} s does not converge; take more substeps"
        )

    def _factorise(self, time: float, x: Array, h: float) -> None:
        """Factorise 1 - h GAMMA df/dx by rows with pivots; f at ``time`` is left in ``_f``."""
        n, matrix = len(x), self._matrix
        self._rates(time, x, self._f)
        for j in range(n):
            kept = x[j]
            x[j] = kept + _DIFFERENCE * max(abs(kept), 1e-6)
            self._rates(time, x, self._residual)
            for i in range(n):
                slope = (self._residual[i] - self._f[i]) / (x[j] - kept)
                matrix[i, j] = (1.0 if i == j else 0.0) - h * GAMMA * slope
            x[j] = kept
        for j in range(n):
            best = j
            for i in range(j + 1, n):
                if abs(matrix[i, j]) > abs(matrix[best, j]):
                    best = i
            self._rows[j] = best
            if matrix[best, j] == 0.0:
                raise ArithmeticError(f"the implicit step of {h:g} s at {time:g} s has no solution")
            for column in range(n):
                upper, lower = matrix[j, column], matrix[best, column]
                matrix[j, column], matrix[best, column] = lower, upper
            for i in range(j + 1, n):
                matrix[i, j] /= matrix[j, j]
                for column in range(j + 1, n):
                    matrix[i, column] -= matrix[i, j] * matrix[j, column]

    def _substitute(self, vector: Array) -> None:
        """Solve the factorised system for a right-hand side, in place."""
        n, matrix = len(vector), self._matrix
        for j in range(n):
            best = int(self._rows[j])
            first, second = vector[j], vector[best]
            vector[j], vector[best] = second, first
        for i in range(n):
            for j in range(i):
                vector[i] -= matrix[i, j] * vector[j]
        for i in range(n - 1, -1, -1):
            for j in range(i + 1, n):
                vector[i] -= matrix[i, j] * vector[j]
            vector[i] /= matrix[i, i]
