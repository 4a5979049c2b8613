"""The wrapper finds minimisers, agrees between solvers, and never raises."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.mathematics.quadratic_program import QuadraticProgramSolver


def problem(seed, size=6, rows=8):
    random = np.random.default_rng(seed)
    root = random.normal(size=(size, size))
    inside = random.normal(size=size)
    g, a = random.normal(size=(rows, size)), random.normal(size=(2, size))
    h = g @ inside + random.uniform(0.0, 1.0, rows)
    return root @ root.T + 0.1 * np.eye(size), random.normal(size=size) * 5, g, h, a, a @ inside


@given(st.integers(0, 10_000))
def test_two_exact_solvers_agree_and_the_optimality_conditions_hold(seed):
    p, q, g, h, a, b = problem(seed)
    x = QuadraticProgramSolver("daqp").solve(p, q, g, h, a, b)
    y = QuadraticProgramSolver("quadprog").solve(p, q, g, h, a, b)
    assert x == pytest.approx(y, abs=1e-6)
    assert (g @ x <= h + 1e-7).all()
    assert a @ x == pytest.approx(b, abs=1e-7)
    # The gradient is a combination of the equalities and, with no positive sign, active rows.
    active = g[g @ x > h - 1e-6]
    basis = np.vstack([a, active])
    multipliers = np.linalg.lstsq(basis.T, -(p @ x + q), rcond=None)[0]
    assert basis.T @ multipliers == pytest.approx(-(p @ x + q), abs=1e-5)
    assert multipliers[2:].min(initial=0.0) > -1e-5


@pytest.mark.parametrize("solver", ["daqp", "quadprog"])
def test_an_infeasible_problem_has_no_answer(solver):
    g, h = np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0])
    empty = np.zeros((0, 1))
    found = QuadraticProgramSolver(solver).solve(np.eye(1), np.zeros(1), g, h, empty, np.zeros(0))
    assert found is None


@pytest.mark.parametrize("solver", ["daqp", "quadprog"])
def test_not_a_number_has_no_answer(solver):
    p, q, g, h, a, b = problem(0)
    q[2] = np.nan
    assert QuadraticProgramSolver(solver).solve(p, q, g, h, a, b) is None


def test_an_unknown_solver_is_named_with_those_there_are():
    with pytest.raises(LookupError, match=r"no quadratic-program solver 'magic'.*there is .*daqp"):
        QuadraticProgramSolver("magic")


def test_the_answer_depends_on_the_problem_alone():
    solver = QuadraticProgramSolver("daqp")
    first = solver.solve(*problem(1))
    solver.solve(*problem(2))
    assert solver.solve(*problem(1)).tobytes() == first.tobytes()


@given(st.integers(0, 10_000))
def test_daqp_called_directly_gives_the_same_bits_as_through_qpsolvers(seed):
    qpsolvers = pytest.importorskip("qpsolvers")
    p, q, g, h, a, b = problem(seed)
    through = qpsolvers.solve_problem(qpsolvers.Problem(p, q, g, h, a, b), "daqp")
    assert QuadraticProgramSolver("daqp").solve(p, q, g, h, a, b).tobytes() == through.x.tobytes()


def test_options_reach_daqp():
    assert QuadraticProgramSolver("daqp", {"iter_limit": 1}).solve(*problem(3)) is None
    assert QuadraticProgramSolver("daqp").solve(*problem(3)) is not None


def test_daqp_needs_neither_qpsolvers_nor_scipy():
    code = (
        "import sys; from aloft.mathematics.quadratic_program import QuadraticProgramSolver as S;"
        "S('daqp'); print([name for name in ('qpsolvers', 'scipy') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
