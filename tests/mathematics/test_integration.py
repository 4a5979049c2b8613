"""Both methods: their order on a known solution, stiffness, conserved energy, no allocation."""

import numpy as np
import pytest

from aloft.mathematics.arrays import Array
from aloft.mathematics.integration import Implicit, RungeKutta
from aloft.runtime.testing.allocations import count_array_allocations


def oscillator(time: float, x: Array, out: Array) -> None:
    """x'' = -x + t, whose solution from rest is t - sin t."""
    out[0], out[1] = x[1], time - x[0]


def error(method: type[RungeKutta] | type[Implicit], steps: int, substeps: int = 1) -> float:
    x, h = np.zeros(2), 2.0 / steps
    solver = method(oscillator, 2, substeps)
    for step in range(steps):
        solver.step(step * h, x, h)
    return float(np.hypot(x[0] - (2.0 - np.sin(2.0)), x[1] - (1.0 - np.cos(2.0))))


@pytest.mark.parametrize(("method", "order"), [(RungeKutta, 4), (Implicit, 3)])
def test_the_order(method: type[RungeKutta] | type[Implicit], order: int) -> None:
    errors = [error(method, steps) for steps in (20, 40, 80)]
    assert np.diff(np.log2(errors)) == pytest.approx([-order, -order], abs=0.1)


@pytest.mark.parametrize("method", [RungeKutta, Implicit])
def test_substeps_are_steps(method: type[RungeKutta] | type[Implicit]) -> None:
    assert error(method, 10, 4) == pytest.approx(error(method, 40), rel=1e-6)


def test_a_stiff_system() -> None:
    """Prothero and Robinson: x' = -1e6 (x - cos t) - sin t goes to cos t within a step."""

    def rates(time: float, x: Array, out: Array) -> None:
        out[0] = -1e6 * (x[0] - np.cos(time)) - np.sin(time)

    x = np.array([3.0])
    method = Implicit(rates, 1)
    for step in range(100):
        method.step(step * 0.05, x, 0.05)
    assert x[0] == pytest.approx(np.cos(5.0), abs=1e-6)


def test_a_stiff_and_nonlinear_system() -> None:
    """Robertson's reaction: masses stay 1, and the known values at 40 s."""

    def rates(time: float, x: Array, out: Array) -> None:
        first, second = 0.04 * x[0], 3e7 * x[1] * x[1]
        third = 1e4 * x[1] * x[2]
        out[0], out[1], out[2] = third - first, first - third - second, second

    x = np.array([1.0, 0.0, 0.0])
    method = Implicit(rates, 3, substeps=10)
    for step in range(400):
        method.step(step * 0.1, x, 0.1)
    assert x.sum() == pytest.approx(1.0, abs=1e-10)
    assert x == pytest.approx([0.7158270688, 9.185534765e-6, 0.2841637457], rel=1e-5)


def test_what_does_not_converge_is_an_error() -> None:
    def rates(time: float, x: Array, out: Array) -> None:
        out[0] = 1e9 if x[0] < 0.5 else -1e9

    with pytest.raises(
        ArithmeticError, match=r"0\.1 s at .* does not converge; take more substeps"
    ):
        Implicit(rates, 1).step(0.0, np.array([0.499]), 0.1)


@pytest.mark.parametrize("method", [RungeKutta, Implicit])
def test_no_array_is_allocated(method: type[RungeKutta] | type[Implicit]) -> None:
    x, solver = np.zeros(2), method(oscillator, 2)
    solver.step(0.0, x, 0.01)
    with count_array_allocations() as counted:
        for step in range(50):
            solver.step(step * 0.01, x, 0.01)
    assert counted.count == 0, counted
