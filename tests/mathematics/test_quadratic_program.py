"""The wrapper finds minimisers, agrees between solvers, and never raises."""

from __future__ import annotations

import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.mathematics import quadratic_program
from aloft.mathematics.quadratic_program import (
    PACKAGES,
    Clarabel,
    QuadraticProgramSolver,
    is_optimal,
)


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


@pytest.mark.parametrize("solver", PACKAGES)
def test_every_solver_finds_the_optimum_also_beside_a_bound_that_never_binds(solver):
    for seed in range(3):
        p, q, g, h, a, b = problem(seed)
        h[3] = 1e14
        exact = QuadraticProgramSolver("daqp").solve(p, q, g[h < 1e9], h[h < 1e9], a, b)
        assert QuadraticProgramSolver(solver).solve(p, q, g, h, a, b) == pytest.approx(
            exact, abs=1e-5
        )


@pytest.mark.parametrize("solver", PACKAGES)
def test_an_infeasible_problem_has_no_answer(solver):
    g, h = np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0])
    empty = np.zeros((0, 1))
    found = QuadraticProgramSolver(solver).solve(np.eye(1), np.zeros(1), g, h, empty, np.zeros(0))
    assert found is None


def answer_of(seed, solver="daqp", **change):
    """The optimality conditions of a solver's answer, of which ``change`` replaces a part."""
    qpsolvers = pytest.importorskip("qpsolvers")
    program = problem(seed)
    found = qpsolvers.solve_problem(qpsolvers.Problem(*program), solver)
    answer = SimpleNamespace(x=found.x, y=found.y, z=found.z)
    for name, value in change.items():
        setattr(answer, name, value(getattr(answer, name)))
    return is_optimal(*program, answer)


@pytest.mark.parametrize("solver", ["daqp", "quadprog"])
@given(st.integers(0, 10_000))
def test_the_optimality_conditions_hold_for_exact_answers(solver, seed):
    assert answer_of(seed, solver)


@pytest.mark.parametrize(
    "change",
    [
        {"x": lambda x: x + 1e-3},
        {"z": lambda z: z + 1e-3},
        {"z": lambda z: -z - 1.0},
        {"y": lambda y: y + 1e-3},
        {"y": lambda _: None},
        {"z": lambda _: None},
    ],
)
def test_a_point_beside_the_optimum_is_no_answer(change):
    assert not answer_of(4, **change)


def test_a_solver_that_stops_early_has_no_answer():
    early = {"eps_abs": 1e-2, "check_duality_gap": False}
    x = QuadraticProgramSolver("proxqp", early).solve(*problem(1))
    assert x is None


@pytest.mark.parametrize("status", ["AlmostSolved", "InsufficientProgress", "MaxIterations"])
def test_a_status_of_clarabel_that_is_not_optimal_has_no_answer(status, monkeypatch):
    found = SimpleNamespace(x=np.zeros(6), status=status)
    monkeypatch.setattr(Clarabel, "answer", lambda *_: found)
    assert QuadraticProgramSolver("clarabel").solve(*problem(0)) is None
    found.status = "Solved"
    assert QuadraticProgramSolver("clarabel").solve(*problem(0)) is not None


@pytest.mark.parametrize("solver", PACKAGES)
def test_not_a_number_has_no_answer(solver):
    p, q, g, h, a, b = problem(0)
    q[2] = np.nan
    assert QuadraticProgramSolver(solver).solve(p, q, g, h, a, b) is None


@pytest.mark.parametrize(("solver", "package"), PACKAGES.items())
def test_a_solver_that_is_not_installed_comes_with_the_line_for_pip(solver, package, monkeypatch):
    monkeypatch.setattr("qpsolvers.available_solvers", ["scs"])
    monkeypatch.setattr(quadratic_program, "find_spec", lambda _: None)
    text = f"^the quadratic-program solver '{solver}' is not installed: pip install {package}$"
    with pytest.raises(LookupError, match=text):
        QuadraticProgramSolver(solver)


def test_a_misspelt_solver_is_told_the_nearest():
    with pytest.raises(
        LookupError, match=r"solver 'quadprogg' is installed; did you mean quadprog\?"
    ):
        QuadraticProgramSolver("quadprogg")


def test_an_unknown_solver_is_named_with_those_there_are():
    with pytest.raises(LookupError, match=r"no quadratic-program solver 'magic'.*there is .*daqp"):
        QuadraticProgramSolver("magic")


@pytest.mark.parametrize("name", ["daqp", "clarabel", "quadprog"])
def test_the_answer_depends_on_the_problem_alone(name):
    solver = QuadraticProgramSolver(name)
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
