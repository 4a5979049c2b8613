"""The reduced program against the program in accelerations and forces, and solvers against each other."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.whole_body_solver import solver_call
from aloft.mathematics import whole_body_qp as qp
from aloft.mathematics.whole_body_reduction import (
    equality_program,
    recover_solution,
    reduce_program,
    reduction_memory,
    write_program,
)

N, JOINTS, POINTS = 16, 10, 4


def program(seed, stance=(True, False, True, True), kind=qp.JOINT_LIMITS, peak=200.0):
    """A random program."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(N, N))
    tasks = qp.TaskRows(random.normal(size=(9, N)), random.normal(size=9), random.random(9))
    terms = qp.RigidBodyTerms(
        root @ root.T + np.eye(N), random.normal(size=N), random.normal(size=(POINTS, 3, N))
    )
    weights = qp.ProgramWeights(*(np.array([each]) for each in (0.1, 0.01, 0.5, 0.0, 80.0)))
    limits = [np.full(JOINTS, peak), *np.ones((5, JOINTS)), *np.zeros((3, JOINTS))]
    motors = qp.TorqueLimits(kind, np.eye(JOINTS), np.eye(JOINTS), *limits)
    return qp.WholeBodyProgram(tasks, terms, np.array(stance), np.zeros(JOINTS), weights, motors)


def empty_solution():
    return qp.WholeBodySolution(
        np.zeros(JOINTS), np.zeros(N), np.zeros((POINTS, 3)), np.zeros(1, np.int64)
    )


def direct_cost(data, a, f):
    tasks, w = data.tasks, data.weights
    errors = tasks.weights @ (tasks.jacobian @ a - tasks.desired) ** 2
    return float(errors + w.acceleration[0] * a @ a + w.force[0] * (f**2).sum())


@pytest.mark.parametrize("stance", [(True, False, False, False), (True, False, True, True)])
def test_cost_dynamics_torques_and_limits_are_those_of_the_program_in_accelerations(stance):
    data, solution = program(7, stance), empty_solution()
    reduction, whole = reduction_memory(N, POINTS), equality_program(N, POINTS)
    reduce_program(data, reduction, solution)
    write_program(data, reduction, whole)
    n, rows = whole.size
    random, active, differences = np.random.default_rng(3), np.flatnonzero(stance), []
    for _ in range(5):
        x = random.normal(size=n)
        x[n - 6 :] = whole.matrix[:, : n - 6] @ x[: n - 6] - whole.bound  # K f - r = k
        assert whole.matrix[:, :n] @ x == pytest.approx(whole.bound)
        recover_solution(data, reduction, x, solution)
        a, f, terms = solution.acceleration, solution.force, data.terms
        assert f[active].ravel().tolist() == x[: 3 * len(active)].tolist()
        motion = terms.mass_matrix @ a + terms.nonlinear - np.einsum("ikn,ik->n", terms.jacobian, f)
        assert motion[:6] == pytest.approx(np.zeros(6), abs=1e-9)
        assert motion[6:] == pytest.approx(solution.torque)
        cost = 0.5 * x @ whole.limits.hessian[:n, :n] @ x + whole.limits.gradient[:n] @ x
        differences.append(direct_cost(data, a, f) - 2.0 * cost)
        slack = (whole.limits.bound[:rows] - whole.limits.matrix[:rows, :n] @ x)[6 * len(active) :]
        assert slack[:JOINTS] == pytest.approx(200.0 - solution.torque)
        assert slack[JOINTS:] == pytest.approx(200.0 + solution.torque)
    assert np.ptp(differences) == pytest.approx(0.0, abs=1e-9 * max(differences))


def solved(name, cones, data):
    solution, reduction = empty_solution(), reduction_memory(N, POINTS)
    reduce_program(data, reduction, solution)
    solver_call(name, cones, data, reduction, solution).run()
    assert int(solution.code[0]) == qp.SOLVED
    return solution


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("peak", [200.0, 8.0])
def test_solvers_agree(seed, peak):
    data = program(seed, peak=peak)
    own = solved("active_set", "pyramid", data)
    assert np.abs(own.torque).max() <= peak + 1e-9
    for name, error in {"daqp": 1e-8, "quadprog": 1e-8, "clarabel": 1e-4}.items():
        assert solved(name, "pyramid", data).torque == pytest.approx(own.torque, abs=error), name


@pytest.mark.parametrize("seed", range(6))
def test_the_round_cone_costs_more_than_the_pyramid_around_it(seed):
    data = program(seed)
    own, pyramid = solved("active_set", "round", data), solved("active_set", "pyramid", data)
    other = solved("clarabel", "round", data)
    assert other.torque == pytest.approx(own.torque, abs=1e-4)
    sizes = np.hypot(own.force[:, 0], own.force[:, 1])
    assert (sizes <= 0.5 * own.force[:, 2] + 1e-9).all()
    costs = [direct_cost(data, each.acceleration, each.force) for each in (pyramid, own)]
    assert costs[0] <= costs[1] * (1.0 + 1e-12)


def test_nothing_is_solved_without_contact_or_with_numbers_that_are_not_finite():
    for name in ("active_set", "daqp"):
        for stance, spoilt, code in (
            ((False,) * 4, False, qp.NO_CONTACT),
            ((True,) * 4, True, qp.ILL_POSED),
        ):
            data, solution = program(1, stance), empty_solution()
            if spoilt:
                data.terms.mass_matrix[2, 3] = np.nan
            reduction = reduction_memory(N, POINTS)
            reduce_program(data, reduction, solution)
            solver_call(name, "pyramid", data, reduction, solution).run()
            assert int(solution.code[0]) == code
