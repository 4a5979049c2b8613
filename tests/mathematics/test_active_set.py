"""The dual active-set method agrees with another solver on programs of many kinds."""

import numpy as np
import pytest
import quadprog

from aloft.mathematics.active_set import (
    INFEASIBLE,
    NOT_CONVEX,
    QuadraticProgram,
    active_set_memory,
    polish,
    solve_program,
)
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.kernel import kernel


@kernel
def solve_into(sizes: np.ndarray, program: QuadraticProgram, memory: tuple, x: np.ndarray) -> None:
    """Solves for the sizes n and m in an array, into which it writes its result."""
    sizes[2] = solve_program(int(sizes[0]), int(sizes[1]), program, memory, x)


def contact_program(random):
    """Forces of one to four points in friction pyramids, with limits on ten torques."""
    n = int(random.choice([3, 6, 9, 12]))
    lever = random.standard_normal((6, n)) * 10.0 ** random.uniform(-2, 2)
    hessian = lever.T @ lever + 10.0 ** random.uniform(-4, -2) * np.eye(n)
    gradient = lever.T @ random.standard_normal(6) * 10.0 ** random.uniform(-1, 2.5)
    mu, rows, bound = random.uniform(0.1, 1.0), [], []
    for point in range(n // 3):
        for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
            row = np.zeros(n)
            row[3 * point + axis], row[3 * point + 2] = sign, -mu
            rows.append(row)
            bound.append(0.0)
        for sign, limit in ((1.0, 400.0), (-1.0, random.choice([0.0, -1.0]))):
            row = np.zeros(n)
            row[3 * point + 2] = sign
            rows.append(row)
            bound.append(limit)
    torque, rest = 0.2 * random.standard_normal((10, n)), 4.0 * random.standard_normal(10)
    limit = random.uniform(1.0, 11.0)
    matrix = np.vstack([rows, torque, -torque])
    return hessian, gradient, matrix, np.concatenate([bound, limit - rest, limit + rest])


@pytest.fixture(scope="module")
def solver():
    """The method as machine code, on memory that is used again and again."""
    program = QuadraticProgram(np.zeros((12, 12)), np.zeros(12), np.zeros((44, 12)), np.zeros(44))
    sizes, x = np.zeros(3, np.int64), np.zeros(12)
    call = KernelCall(solve_into, sizes, program, active_set_memory(12, 44), x)
    assert compile_calls([call]) == ""

    def solve(hessian, gradient, matrix, bound):
        m, n = matrix.shape
        program.hessian[:n, :n], program.gradient[:n] = hessian, gradient
        program.matrix[:m, :n], program.bound[:m] = matrix, bound
        sizes[:2] = n, m
        call.run()
        return int(sizes[2]), x[:n].copy()

    return solve


def compare(solver, seed, count):
    random = np.random.default_rng(seed)
    infeasible = 0
    for _ in range(count):
        hessian, gradient, matrix, bound = contact_program(random)
        code, x = solver(hessian, gradient, matrix, bound)
        try:
            other = quadprog.solve_qp(hessian, -gradient, -matrix.T, -bound)[0]
        except ValueError:
            assert code == INFEASIBLE
            infeasible += 1
            continue
        assert code >= 0
        size = 1.0 + np.abs(other).max()
        assert (matrix @ x - bound).max() < 1e-8 * size
        # In the flattest directions two exact answers differ by rounding times P's condition, up
        # to 1e10; what counts is that none is better than the other.
        mine, theirs = (0.5 * y @ hessian @ y + gradient @ y for y in (x, other))
        assert mine - theirs < 1e-9 * (1.0 + abs(theirs))
        assert np.abs(x - other).max() < 1e-2 * size
    return infeasible


def test_it_agrees_with_quadprog(solver):
    assert 50 < compare(solver, 0, 500) < 300


@pytest.mark.long
def test_it_agrees_with_quadprog_on_ten_thousand_programs(solver):
    assert compare(solver, 1, 10_000) > 1_000


def test_the_answer_does_not_depend_on_what_was_solved_before(solver):
    random = np.random.default_rng(7)
    first = contact_program(random)
    _, x = solver(*first)
    for _ in range(20):
        solver(*contact_program(random))
    assert solver(*first)[1].tobytes() == x.tobytes()


def plain(hessian, gradient, matrix, bound):
    n, m = len(gradient), len(bound)
    memory, x = active_set_memory(n, m), np.zeros(n)
    program = QuadraticProgram(hessian, gradient, matrix, bound)
    return solve_program(n, m, program, memory, x), x, memory


def test_plain_python_finds_the_same_bits(solver):
    random = np.random.default_rng(3)
    for _ in range(10):
        program = contact_program(random)
        code, x = solver(*program)
        expected, y, _ = plain(*program)
        assert code == expected
        if code >= 0:
            assert x.tobytes() == y.tobytes()


def test_an_empty_set_and_a_wrong_hessian_are_reported():
    rows, bound = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([-1.0, -1.0])
    assert plain(np.eye(2), np.zeros(2), rows, bound)[0] == INFEASIBLE
    assert plain(-np.eye(2), np.zeros(2), rows, bound)[0] == NOT_CONVEX
    assert plain(np.full((2, 2), np.nan), np.zeros(2), rows, bound)[0] == NOT_CONVEX
    impossible = np.zeros((1, 2)), np.array([-1.0])
    assert plain(np.eye(2), np.zeros(2), *impossible)[0] == INFEASIBLE


def test_a_step_along_the_active_constraints_mends_a_wrong_gradient():
    rows, bound = np.array([[1.0, 1.0]]), np.array([-2.0])
    code, x, memory = plain(np.diag([1.0, 3.0]), np.array([0.0, 1e-3]), rows, bound)
    assert code == 1
    right = np.diag([1.0, 3.0])  # without the gradient's error
    polish(2, right @ x, memory, x)
    assert x == pytest.approx([-1.5, -0.5], abs=1e-15)
