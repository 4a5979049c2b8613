"""The contact points' rows, each against its equation."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.blocks.control.tasks.contact_points import (
    Ankles,
    JointMotion,
    Points,
    Steps,
    contact_rows,
    follow_plan,
    lifting_rows,
    step_rows,
)
from aloft.mathematics.whole_body_qp import TaskRows

RANDOM = np.random.default_rng(7)
N = 16
JACOBIAN = RANDOM.normal(size=(4, 3, N))


def rows(value=0.0):
    return TaskRows(np.full((12, N), value), np.full(12, value), np.full(12, value))


def points(position=None, drift=None):
    zero = np.zeros((4, 3))
    return Points(
        JACOBIAN, zero if drift is None else drift, zero if position is None else position,
        RANDOM.normal(size=(4, 3)),
    )  # fmt: skip


def test_stance_points_do_not_accelerate():
    out, at = rows(), points(drift=RANDOM.normal(size=(4, 3)))
    contact_rows(at, np.array([True] * 4), 1e3, 7.0, 10.0, 400.0, 40.0, out)
    assert (out.jacobian == JACOBIAN.reshape(12, N)).all()
    assert out.desired == pytest.approx((-7.0 * at.velocity - at.drift).ravel())
    assert (out.weights == 1e3).all()


def test_points_without_load_fall_to_the_mean_height_of_the_others():
    place = np.zeros((4, 3))
    place[:, 2] = [0.01, 0.03, 0.05, 0.5]
    out, at = rows(), points(position=place)
    stance = np.array([True, True, False, False])
    contact_rows(at, stance, 1e3, 0.0, 10.0, 400.0, 40.0, out)
    assert out.weights.tolist() == [1e3] * 6 + [10.0] * 6
    assert out.desired[8] == pytest.approx(400.0 * (0.02 - 0.05) - 40.0 * at.velocity[2, 2])
    assert out.desired[11] == pytest.approx(400.0 * (0.02 - 0.5) - 40.0 * at.velocity[3, 2])
    assert out.desired[[6, 7]] == pytest.approx(-40.0 * at.velocity[2, :2])


def test_points_that_lift_are_free_but_across_their_foot():
    out, at = rows(1.0), points(drift=RANDOM.normal(size=(4, 3)))
    turns = np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], np.eye(3)])
    ankles = Ankles(np.array([10, 15]), np.array([-3.0, 7.0]))
    lifting_rows(
        at, np.array([True, False, True, False]), np.array([0, 0, 1, 1]), turns, ankles, 10.0, 40.0,
        0.5, out,
    )  # fmt: skip
    assert out.weights.tolist() == [1.0] * 3 + [10.0, 0.5, 0.0] + [1.0] * 3 + [10.0, 0.5, 0.0]
    assert out.jacobian[4].tolist() == np.eye(N)[10].tolist()
    assert out.jacobian[10].tolist() == np.eye(N)[15].tolist()
    assert out.desired[[4, 10]].tolist() == [-3.0, 7.0]
    assert out.jacobian[3] == pytest.approx(-JACOBIAN[1, 0])  # the left foot's y is the world's -x
    assert out.desired[3] == pytest.approx(40.0 * at.velocity[1, 0] + at.drift[1, 0])
    assert out.jacobian[9] == pytest.approx(JACOBIAN[3, 1])
    assert out.desired[9] == pytest.approx(-40.0 * at.velocity[3, 1] - at.drift[3, 1])
    assert (out.jacobian[[0, 1, 2, 6, 7, 8]] == 1.0).all()
    assert (out.desired[[0, 1, 2, 6, 7, 8]] == 1.0).all()


def test_points_of_a_foot_without_an_ankle_are_damped_as_they_lift():
    out, at = rows(), points(drift=RANDOM.normal(size=(4, 3)))
    stance, foot = np.array([True, True, True, False]), np.arange(4)
    contact_rows(at, stance, 1e3, 0.0, 10.0, 400.0, 40.0, out)
    ankles = Ankles(np.full(4, -1), np.zeros(4))
    turns = np.tile(np.eye(3), (4, 1, 1))
    lifting_rows(at, stance, foot, turns, ankles, 10.0, 40.0, 0.5, out)
    assert (out.jacobian[9:] == JACOBIAN[3]).all()
    assert out.desired[9:] == pytest.approx(-40.0 * at.velocity[3] - at.drift[3])
    assert (out.weights[9:] == 10.0).all()


def test_an_ankle_follows_the_plan_and_a_foot_without_one_is_left_out():
    planned = JointMotion(*RANDOM.normal(size=(3, 10)))
    position, velocity = RANDOM.normal(size=10), RANDOM.normal(size=16)
    ankles = Ankles(np.array([10, -1]), np.array([0.0, 5.0]))
    follow_plan(planned, position, velocity, 1000.0, 60.0, ankles)
    wanted = planned.acceleration[4] + 1000.0 * (planned.position[4] - position[4])
    wanted += 60.0 * (planned.velocity[4] - velocity[10])
    assert ankles.acceleration == pytest.approx([wanted, 5.0])


def test_points_of_a_step_get_their_acceleration():
    out, at = rows(), points(drift=RANDOM.normal(size=(4, 3)))
    stance, stepping = np.array([True, True, False, False]), np.array([False, False, True, True])
    contact_rows(at, stance, 1e3, 0.0, 10.0, 400.0, 40.0, out)
    before = out.desired.copy()
    wanted = RANDOM.normal(size=(4, 3))
    step_rows(at, Steps(stepping, wanted), 500.0, out)
    assert (out.desired[:6] == before[:6]).all() and out.weights.tolist() == [1e3] * 6 + [500.0] * 6
    assert out.desired[6:] == pytest.approx((wanted - at.drift)[2:].ravel())
