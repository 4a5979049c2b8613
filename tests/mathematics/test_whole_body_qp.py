"""The parts of the whole-body program, each against its equation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.mathematics import whole_body_qp as qp

RANDOM = np.random.default_rng(7)
N, JOINTS = 16, 10
ROOT = RANDOM.normal(size=(N, N))
MASS_MATRIX = ROOT @ ROOT.T + np.eye(N)
NONLINEAR = RANDOM.normal(size=N)
JACOBIAN = RANDOM.normal(size=(4, 3, N))
TERMS = qp.RigidBodyTerms(MASS_MATRIX, NONLINEAR, JACOBIAN)


@given(st.integers(0, 1000))
def test_the_cost_is_the_sum_of_weighted_squares(seed):
    random = np.random.default_rng(seed)
    rows, desired, weights = random.normal(size=(9, N)), random.normal(size=9), random.random(9)
    cost = qp.Cost(np.zeros((N + 6, N + 6)), np.zeros(N + 6))
    scratch = qp.CostScratch(np.zeros((9, N)), np.zeros((N, N)), np.zeros(N))
    qp.assemble_cost(qp.TaskRows(rows, desired, weights), 0.1, 0.2, scratch, cost)
    x = random.normal(size=N + 6)
    a, f = x[:N], x[N:]
    direct = weights @ (rows @ a - desired) ** 2 + 0.1 * a @ a + 0.2 * f @ f
    quadratic = x @ cost.hessian @ x + 2.0 * cost.gradient @ x + weights @ desired**2
    assert quadratic == pytest.approx(direct, rel=1e-10)


@pytest.mark.parametrize("active", [[0], [1, 3], [0, 1, 2, 3]])
def test_base_rows_and_joint_torque_are_the_equation_of_motion(active):
    points = np.array(active, dtype=np.int64)
    acceleration, force = RANDOM.normal(size=N), np.zeros((4, 3))
    force[active] = RANDOM.normal(size=(len(active), 3))
    matrix, vector = np.zeros((6, N + 3 * len(active))), np.zeros(6)
    qp.base_dynamics(TERMS, points, qp.Constraints(matrix, vector))
    whole = MASS_MATRIX @ acceleration + NONLINEAR - np.einsum("ikn,ik->n", JACOBIAN, force)
    x = np.concatenate([acceleration, force[active].ravel()])
    assert matrix @ x - vector == pytest.approx(whole[:6])
    torque = np.zeros(JOINTS)
    qp.joint_torque(TERMS, acceleration, force, np.zeros(JOINTS), torque)
    assert torque == pytest.approx(whole[6:])


def limits_of(n):
    return qp.TorqueLimits(np.eye(n), np.eye(n), *(np.zeros(n) for _ in range(6)))


def test_torque_rows_bound_the_transmitted_torque():
    points = np.array([0, 2], dtype=np.int64)
    transmission = RANDOM.normal(size=(JOINTS, JOINTS))
    lower, upper = -RANDOM.random(JOINTS), RANDOM.random(JOINTS)
    matrix, bound = np.zeros((2 * JOINTS, N + 6)), np.zeros(2 * JOINTS)
    scratch = qp.TorqueScratch(
        np.zeros((JOINTS, N + 6)), np.zeros((JOINTS, N + 6)), np.zeros(JOINTS)
    )
    rows = qp.Constraints(matrix, bound)
    motors = limits_of(JOINTS)._replace(to_torque=transmission, lower=lower, upper=upper)
    qp.torque_limits(TERMS, points, motors, scratch, rows)
    x, force, torque = RANDOM.normal(size=N + 6), np.zeros((4, 3)), np.zeros(JOINTS)
    force[[0, 2]] = x[N:].reshape(2, 3)
    qp.joint_torque(TERMS, x[:N], force, np.zeros(JOINTS), torque)
    slack = bound - matrix @ x
    assert slack[:JOINTS] == pytest.approx(upper - transmission @ torque)
    assert slack[JOINTS:] == pytest.approx(transmission @ torque - lower)


@given(st.lists(st.floats(-100, 100), min_size=6, max_size=6))
def test_pyramid_rows_hold_exactly_inside_the_pyramid(values):
    matrix, bound, force = np.zeros((12, 8)), np.zeros(12), np.array(values)
    qp.friction_pyramids(2, 2, 0.5, 1.0, 80.0, qp.Constraints(matrix, bound))
    x = np.concatenate([[9.0, 9.0], force])
    inside = all(
        max(abs(fx), abs(fy)) <= 0.5 * fz and 1.0 <= fz <= 80.0
        for fx, fy, fz in force.reshape(2, 3)
    )
    margin = (bound - matrix @ x).min()
    assert inside == (margin >= 0.0) or abs(margin) < 1e-12


@pytest.mark.parametrize(
    ("speed", "lower", "upper"),
    [
        (0.0, -10.0, 10.0),
        (18.0, -10.0, 10.0),
        (24.0, -10.0, 5.0),
        (-27.0, -2.5, 10.0),
        (30.0, -10.0, 0.0),
        (-45.0, 0.0, 10.0),
    ],
)
def test_motor_limits(speed, lower, upper):
    motors = limits_of(2)
    motors.peak[:], motors.corner[:], motors.no_load[:] = [10.0, 1.0], [18.0, 5.0], [30.0, 6.0]
    motors.speed[0] = speed
    qp.motor_limits(motors)
    assert (motors.lower[0], motors.upper[0]) == pytest.approx((lower, upper))
    assert (motors.lower[1], motors.upper[1]) == (-1.0, 1.0)  # every motor has its own curve


def test_a_motor_without_a_speed_limit_gives_its_peak_below_it():
    motors = limits_of(1)
    motors.peak[0], motors.corner[0], motors.no_load[0], motors.speed[0] = 10.0, 60.0, 60.0, 20.0
    qp.motor_limits(motors)
    assert (motors.lower[0], motors.upper[0]) == (-10.0, 10.0)


def test_weight_is_shared_by_the_points_in_stance():
    force = np.ones((4, 3))
    qp.share_weight(np.array([True, False, False, True]), 50.0, force)
    assert force.tolist() == [[0, 0, 25], [0, 0, 0], [0, 0, 0], [0, 0, 25]]
