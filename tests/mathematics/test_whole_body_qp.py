"""The parts of the whole-body program, each against its equation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.mathematics import whole_body_qp as qp

RANDOM = np.random.default_rng(7)
JOINTS = 10


def limits_of(n, kind=qp.MOTOR_LIMITS):
    return qp.TorqueLimits(
        kind, np.eye(n), np.eye(n), *np.zeros((3, n)), *np.ones((3, n)), *np.zeros((3, n))
    )


def test_torque_rows_bound_the_transmitted_torque():
    to_motors = RANDOM.normal(size=(JOINTS, JOINTS))
    lower, upper = -RANDOM.random(JOINTS), RANDOM.random(JOINTS)
    torque_map, rest = RANDOM.normal(size=(JOINTS, 8)), RANDOM.normal(size=JOINTS)
    matrix, bound = np.zeros((3 + 2 * JOINTS, 8)), np.zeros(3 + 2 * JOINTS)
    motors = limits_of(JOINTS)._replace(to_torque=to_motors, lower=lower, upper=upper)
    assert qp.torque_rows(motors, 8, torque_map, rest, 3, matrix, bound) == 3 + 2 * JOINTS
    x = RANDOM.normal(size=8)
    torque = torque_map @ x + rest
    slack = (bound - matrix @ x)[3:]
    assert slack[:JOINTS] == pytest.approx(upper - to_motors @ torque)
    assert slack[JOINTS:] == pytest.approx(to_motors @ torque - lower)
    inside = bool(slack.min() >= -1e-10)
    assert qp.within_limits(torque, motors) == inside


@given(st.lists(st.floats(-100, 100), min_size=6, max_size=6))
def test_pyramid_rows_hold_exactly_inside_the_pyramid(values):
    matrix, bound, force = np.ones((12, 8)), np.ones(12), np.array(values)
    weights = qp.ProgramWeights(*(np.array([each]) for each in (0.0, 0.0, 0.5, 1.0, 80.0)))
    assert qp.friction_rows(2, 8, weights, matrix, bound) == 12
    x = np.concatenate([force, [9.0, 9.0]])
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


def test_of_a_warm_motor_shares_are_left():
    warm, other = limits_of(2), limits_of(2)
    warm.peak[:], warm.corner[:], warm.no_load[:], warm.speed[:] = 10.0, 18.0, 30.0, [25.0, 0.0]
    warm.peak_share[:], warm.corner_share[:], warm.no_load_share[:] = 0.9, 0.8, 1.1
    other.peak[:], other.corner[:], other.no_load[:], other.speed[:] = 9.0, 14.4, 33.0, [25.0, 0.0]
    for motors in (warm, other):
        qp.motor_limits(motors)
    np.testing.assert_allclose(warm.upper, other.upper)
    np.testing.assert_allclose(warm.lower, other.lower)


def test_a_motor_without_a_speed_limit_gives_its_peak_below_it():
    motors = limits_of(1)
    motors.peak[0], motors.corner[0], motors.no_load[0], motors.speed[0] = 10.0, 60.0, 60.0, 20.0
    qp.motor_limits(motors)
    assert (motors.lower[0], motors.upper[0]) == (-10.0, 10.0)
