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
CENTROIDAL = RANDOM.normal(size=(6, N))
DRIFT = RANDOM.normal(size=6)


def test_stance_points_do_not_accelerate():
    rows, desired, weights = np.zeros((12, N)), np.zeros(12), np.zeros(12)
    drift, velocity = RANDOM.normal(size=(4, 3)), RANDOM.normal(size=(4, 3))
    stance = np.array([True] * 4)
    qp.contact_tasks(
        JACOBIAN, drift, np.zeros((4, 3)), velocity, stance, 1e3, 7.0, 10.0, 400.0, 40.0,
        rows, desired, weights,
    )  # fmt: skip
    assert (rows == JACOBIAN.reshape(12, N)).all()
    assert desired == pytest.approx((-7.0 * velocity - drift).ravel())
    assert (weights == 1e3).all()


def test_points_without_load_fall_to_the_mean_height_of_the_others():
    rows, desired, weights = np.zeros((12, N)), np.zeros(12), np.zeros(12)
    place = np.zeros((4, 3))
    place[:, 2] = [0.01, 0.03, 0.05, 0.5]
    velocity = RANDOM.normal(size=(4, 3))
    qp.contact_tasks(
        JACOBIAN, np.zeros((4, 3)), place, velocity, np.array([True, True, False, False]),
        1e3, 0.0, 10.0, 400.0, 40.0, rows, desired, weights,
    )  # fmt: skip
    assert weights.tolist() == [1e3] * 6 + [10.0] * 6
    assert desired[8] == pytest.approx(400.0 * (0.02 - 0.05) - 40.0 * velocity[2, 2])
    assert desired[11] == pytest.approx(400.0 * (0.02 - 0.5) - 40.0 * velocity[3, 2])
    assert desired[[6, 7]] == pytest.approx(-40.0 * velocity[2, :2])


def test_points_that_lift_are_free_but_across_their_foot():
    rows, desired, weights = np.ones((12, N)), np.ones(12), np.ones(12)
    drift, velocity = RANDOM.normal(size=(4, 3)), RANDOM.normal(size=(4, 3))
    turns = np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], np.eye(3)])
    qp.lifting_tasks(
        JACOBIAN, drift, velocity, np.array([True, False, True, False]), np.array([0, 0, 1, 1]),
        turns, 10.0, 40.0, np.array([10, 15]), np.array([-3.0, 7.0]), 0.5, rows, desired, weights,
    )  # fmt: skip
    assert weights.tolist() == [1.0] * 3 + [10.0, 0.5, 0.0] + [1.0] * 3 + [10.0, 0.5, 0.0]
    assert rows[4].tolist() == np.eye(N)[10].tolist()
    assert rows[10].tolist() == np.eye(N)[15].tolist()
    assert desired[[4, 10]].tolist() == [-3.0, 7.0]
    assert rows[3] == pytest.approx(-JACOBIAN[1, 0])  # the left foot's y is the world's -x
    assert desired[3] == pytest.approx(40.0 * velocity[1, 0] + drift[1, 0])
    assert rows[9] == pytest.approx(JACOBIAN[3, 1])
    assert desired[9] == pytest.approx(-40.0 * velocity[3, 1] - drift[3, 1])
    assert (rows[[0, 1, 2, 6, 7, 8]] == 1.0).all()
    assert (desired[[0, 1, 2, 6, 7, 8]] == 1.0).all()


def test_linear_task():
    rows, desired = np.zeros((3, N)), np.zeros(3)
    com, speed, goal, goal_speed, push = RANDOM.normal(size=(5, 3))
    stiffness, damping = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])
    qp.linear_task(
        CENTROIDAL, DRIFT, 5.0, com, speed, goal, goal_speed, push, stiffness, damping, rows,
        desired,
    )  # fmt: skip
    assert rows == pytest.approx(CENTROIDAL[:3] / 5.0)
    wanted = push + stiffness * (goal - com) + damping * (goal_speed - speed)
    assert desired == pytest.approx(wanted - DRIFT[:3] / 5.0)


def test_torso_task_acts_on_the_logarithm_in_the_body_frame():
    rows, desired = np.zeros((3, N)), np.zeros(3)
    half = 0.15
    goal = np.array([np.sin(half), 0.0, 0.0, np.cos(half)])
    rate, goal_rate = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.5, 0.0])
    qp.torso_task(
        np.array([0.0, 0.0, 0.0, 1.0]), rate, goal, goal_rate, np.full(3, 200.0), np.full(3, 28.0),
        np.zeros(3), np.zeros(4), rows, desired,
    )  # fmt: skip
    wanted = 200.0 * np.array([0.3, 0.0, 0.0]) + 28.0 * (goal_rate - rate)
    assert desired == pytest.approx(wanted)
    selection = np.zeros((3, N))
    selection[:, 3:6] = np.eye(3)
    assert (rows == selection).all()


def test_angular_task_damps_or_tracks():
    rows, desired = np.zeros((3, N)), np.zeros(3)
    momentum, goal, rate = RANDOM.normal(size=(3, 3))
    damping = np.array([5.0, 6.0, 7.0])
    for track, wanted in ((False, -damping * momentum), (True, rate + damping * (goal - momentum))):
        qp.angular_task(CENTROIDAL, DRIFT, momentum, goal, rate, damping, track, rows, desired)
        assert desired == pytest.approx(wanted - DRIFT[3:])
        assert (rows == CENTROIDAL[3:]).all()


@given(st.integers(0, 1000))
def test_the_cost_is_the_sum_of_weighted_squares(seed):
    random = np.random.default_rng(seed)
    rows, desired, weights = random.normal(size=(9, N)), random.normal(size=9), random.random(9)
    hessian, gradient = np.zeros((N + 6, N + 6)), np.zeros(N + 6)
    qp.assemble_cost(
        rows, desired, weights, 0.1, 0.2, np.zeros((9, N)), np.zeros((N, N)), np.zeros(N),
        hessian, gradient,
    )  # fmt: skip
    x = random.normal(size=N + 6)
    a, f = x[:N], x[N:]
    direct = weights @ (rows @ a - desired) ** 2 + 0.1 * a @ a + 0.2 * f @ f
    quadratic = x @ hessian @ x + 2.0 * gradient @ x + weights @ desired**2
    assert quadratic == pytest.approx(direct, rel=1e-10)


@pytest.mark.parametrize("active", [[0], [1, 3], [0, 1, 2, 3]])
def test_base_rows_and_joint_torque_are_the_equation_of_motion(active):
    points = np.array(active, dtype=np.int64)
    acceleration, force = RANDOM.normal(size=N), np.zeros((4, 3))
    force[active] = RANDOM.normal(size=(len(active), 3))
    matrix, vector = np.zeros((6, N + 3 * len(active))), np.zeros(6)
    qp.base_dynamics(MASS_MATRIX, NONLINEAR, JACOBIAN, points, matrix, vector)
    whole = MASS_MATRIX @ acceleration + NONLINEAR - np.einsum("ikn,ik->n", JACOBIAN, force)
    x = np.concatenate([acceleration, force[active].ravel()])
    assert matrix @ x - vector == pytest.approx(whole[:6])
    torque = np.zeros(JOINTS)
    qp.joint_torque(MASS_MATRIX, NONLINEAR, JACOBIAN, acceleration, force, np.zeros(JOINTS), torque)
    assert torque == pytest.approx(whole[6:])


def test_torque_rows_bound_the_transmitted_torque():
    points = np.array([0, 2], dtype=np.int64)
    transmission = RANDOM.normal(size=(JOINTS, JOINTS))
    lower, upper = -RANDOM.random(JOINTS), RANDOM.random(JOINTS)
    matrix, bound = np.zeros((2 * JOINTS, N + 6)), np.zeros(2 * JOINTS)
    qp.torque_limits(
        MASS_MATRIX, NONLINEAR, JACOBIAN, points, transmission, lower, upper,
        np.zeros((JOINTS, N + 6)), np.zeros(JOINTS), np.zeros((JOINTS, N + 6)), matrix, bound,
    )  # fmt: skip
    x, force, torque = RANDOM.normal(size=N + 6), np.zeros((4, 3)), np.zeros(JOINTS)
    force[[0, 2]] = x[N:].reshape(2, 3)
    qp.joint_torque(MASS_MATRIX, NONLINEAR, JACOBIAN, x[:N], force, np.zeros(JOINTS), torque)
    slack = bound - matrix @ x
    assert slack[:JOINTS] == pytest.approx(upper - transmission @ torque)
    assert slack[JOINTS:] == pytest.approx(transmission @ torque - lower)


@given(st.lists(st.floats(-100, 100), min_size=6, max_size=6))
def test_pyramid_rows_hold_exactly_inside_the_pyramid(values):
    matrix, bound, force = np.zeros((12, 8)), np.zeros(12), np.array(values)
    qp.friction_pyramids(2, 2, 0.5, 1.0, 80.0, matrix, bound)
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
    low, high = np.zeros(1), np.zeros(1)
    qp.motor_limits(np.array([speed]), 10.0, 18.0, 30.0, low, high)
    assert (low[0], high[0]) == pytest.approx((lower, upper))


def test_a_motor_without_a_speed_limit_gives_its_peak_below_it():
    low, high = np.zeros(1), np.zeros(1)
    qp.motor_limits(np.array([20.0]), 10.0, 60.0, 60.0, low, high)
    assert (low[0], high[0]) == (-10.0, 10.0)


def test_weight_is_shared_by_the_points_in_stance():
    force = np.ones((4, 3))
    qp.share_weight(np.array([True, False, False, True]), 50.0, force)
    assert force.tolist() == [[0, 0, 25], [0, 0, 0], [0, 0, 0], [0, 0, 25]]
