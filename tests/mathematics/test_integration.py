"""The method's order on a known solution, its substeps, no allocation."""

import numpy as np
import pytest

from aloft.mathematics.arrays import Array
from aloft.mathematics.integration import RungeKutta
from aloft.runtime.testing.allocations import count_array_allocations


def oscillator(time: float, x: Array, out: Array) -> None:
    """x'' = -x + t, whose solution from rest is t - sin t."""
    out[0], out[1] = x[1], time - x[0]


def error(steps: int, substeps: int = 1) -> float:
    x, h = np.zeros(2), 2.0 / steps
    solver = RungeKutta(oscillator, 2, substeps)
    for step in range(steps):
        solver.step(step * h, x, h)
    return float(np.hypot(x[0] - (2.0 - np.sin(2.0)), x[1] - (1.0 - np.cos(2.0))))


def test_the_order() -> None:
    errors = [error(steps) for steps in (20, 40, 80)]
    assert np.diff(np.log2(errors)) == pytest.approx([-4.0, -4.0], abs=0.1)


def test_substeps_are_steps() -> None:
    assert error(10, 4) == pytest.approx(error(40), rel=1e-6)


def test_no_array_is_allocated() -> None:
    x, solver = np.zeros(2), RungeKutta(oscillator, 2)
    solver.step(0.0, x, 0.01)
    with count_array_allocations() as counted:
        for step in range(50):
            solver.step(step * 0.01, x, 0.01)
    assert counted.count == 0, counted
