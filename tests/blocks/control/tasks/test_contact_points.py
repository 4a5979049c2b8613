"""The contact points' rows, each against its equation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from aloft.blocks.control.tasks.contact_points import (
    ContactGains,
    LiftingLegs,
    contact_rows,
    lifting_rows,
    planned_acceleration,
    rolling_joint,
    step_rows,
)
from aloft.mathematics.whole_body_qp import TaskRows
from aloft.robots.description import find_robot

BRUCE = find_robot("bruce")
RANDOM = np.random.default_rng(7)
N = 16
JACOBIAN = RANDOM.normal(size=(4, 3, N))


def rows(value=0.0):
    return TaskRows(np.full((12, N), value), np.full(12, value), np.full(12, value))


def gains(**changes):
    few = {"swing_weight": 10.0, "swing_stiffness": 400.0, "swing_damping": 40.0}
    values = ContactGains(**{**few, "rolling_weight": 0.5, **changes})
    return SimpleNamespace(**{name: np.array(value) for name, value in values})


def points(position=None, drift=None):
    zero = np.zeros((4, 3))
    return SimpleNamespace(
        contact_jacobian=JACOBIAN,
        contact_drift=zero if drift is None else drift,
        contact_position=zero if position is None else position,
        contact_velocity=RANDOM.normal(size=(4, 3)),
    )


def stands(*stance, stepping=(False,) * 4, acceleration=None):
    return SimpleNamespace(
        stance=np.array(stance), stepping=np.array(stepping), step_acceleration=acceleration
    )


def test_stance_points_do_not_accelerate():
    out, at = rows(), points(drift=RANDOM.normal(size=(4, 3)))
    contact_rows(at, stands(True, True, True, True), gains(stance_damping=7.0), out)
    assert (out.jacobian == JACOBIAN.reshape(12, N)).all()
    assert out.desired == pytest.approx((-7.0 * at.contact_velocity - at.contact_drift).ravel())
    assert (out.weights == 1e3).all()


def test_points_without_load_fall_to_the_mean_height_of_the_others():
    place = np.zeros((4, 3))
    place[:, 2] = [0.01, 0.03, 0.05, 0.5]
    out, at = rows(), points(position=place)
    contact_rows(at, stands(True, True, False, False), gains(), out)
    velocity = at.contact_velocity
    assert out.weights.tolist() == [1e3] * 6 + [10.0] * 6
    assert out.desired[8] == pytest.approx(400.0 * (0.02 - 0.05) - 40.0 * velocity[2, 2])
    assert out.desired[11] == pytest.approx(400.0 * (0.02 - 0.5) - 40.0 * velocity[3, 2])
    assert out.desired[[6, 7]] == pytest.approx(-40.0 * velocity[2, :2])


def planned(at):
    """Target and joints at random, and the accelerations that keep the joints on the plan."""
    angle, rate, feedforward, position = RANDOM.normal(size=(4, 10))
    at.velocity = RANDOM.normal(size=N)
    target = SimpleNamespace(
        joint_position=angle, joint_velocity=rate, joint_acceleration=feedforward
    )
    expected = feedforward + 1000.0 * (angle - position) + 60.0 * (rate - at.velocity[6:])
    return target, SimpleNamespace(position=position), expected


def test_points_that_lift_are_free_but_across_their_foot():
    out, at = rows(1.0), points(drift=RANDOM.normal(size=(4, 3)))
    at.foot_rotation = np.array([[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], np.eye(3)])
    legs = LiftingLegs(np.array([0, 0, 1, 1]), np.array([10, 15]), np.full(12, -1))
    target, joints, bends = planned(at)
    lifting_rows(at, target, joints, stands(True, False, True, False), legs, gains(), out)
    velocity, drift = at.contact_velocity, at.contact_drift
    assert out.weights.tolist() == [1.0] * 3 + [10.0, 0.5, 0.0] + [1.0] * 3 + [10.0, 0.5, 0.0]
    assert out.jacobian[4].tolist() == np.eye(N)[10].tolist()
    assert out.jacobian[10].tolist() == np.eye(N)[15].tolist()
    assert out.desired[[4, 10]] == pytest.approx(bends[[4, 9]])
    assert out.jacobian[3] == pytest.approx(-JACOBIAN[1, 0])  # the left foot's y is the world's -x
    assert out.desired[3] == pytest.approx(40.0 * velocity[1, 0] + drift[1, 0])
    assert out.jacobian[9] == pytest.approx(JACOBIAN[3, 1])
    assert out.desired[9] == pytest.approx(-40.0 * velocity[3, 1] - drift[3, 1])
    assert (out.jacobian[[0, 1, 2, 6, 7, 8]] == 1.0).all()
    assert (out.desired[[0, 1, 2, 6, 7, 8]] == 1.0).all()


def test_points_of_a_foot_without_an_ankle_are_damped_while_others_of_it_stand():
    out, at = rows(), points(drift=RANDOM.normal(size=(4, 3)))
    at.foot_rotation = np.tile(np.eye(3), (4, 1, 1))
    stance = stands(True, True, True, False)
    contact_rows(at, stance, gains(), out)
    legs = LiftingLegs(np.array([0, 0, 1, 1]), np.full(2, -1), np.full(12, -1))
    lifting_rows(at, *planned(at)[:2], stance, legs, gains(), out)
    assert (out.jacobian[9:] == JACOBIAN[3]).all()
    assert out.desired[9:] == pytest.approx(-40.0 * at.contact_velocity[3] - at.contact_drift[3])
    assert (out.weights[9:] == 10.0).all()


def test_the_leg_of_a_foot_that_has_left_the_ground_follows_the_plan():
    """In as many joints as its points have rows; the rest of them ask for nothing."""
    out, at = rows(), points()
    stance = stands(True, True, False, False)
    contact_rows(at, stance, gains(), out)
    moved = np.array([-1] * 6 + [11, 12, 13, 14, -1, -1])
    legs = LiftingLegs(np.array([0, 0, 1, 1]), np.array([10, 15]), moved)
    target, joints, bends = planned(at)
    lifting_rows(at, target, joints, stance, legs, gains(raised_weight=3.0), out)
    assert (out.jacobian[6:10] == np.eye(N)[11:15]).all()
    assert out.desired[6:10] == pytest.approx(bends[5:9])
    assert out.weights.tolist() == [1e3] * 6 + [3.0] * 4 + [0.0] * 2


def test_a_joint_follows_the_plan_by_feedforward_and_feedback():
    at = points()
    target, joints, bends = planned(at)
    found = planned_acceleration(10, at, target, joints, gains())
    assert found == pytest.approx(bends[4])


def test_points_of_a_step_get_their_acceleration():
    out, at = rows(), points(drift=RANDOM.normal(size=(4, 3)))
    acceleration = RANDOM.normal(size=(4, 3))
    phase = stands(
        True, True, False, False, stepping=(False, False, True, True), acceleration=acceleration
    )
    contact_rows(at, phase, gains(), out)
    before = out.desired.copy()
    step_rows(at, phase, gains(step_weight=500.0), out)
    assert (out.desired[:6] == before[:6]).all() and out.weights.tolist() == [1e3] * 6 + [500.0] * 6
    assert out.desired[6:] == pytest.approx((acceleration - at.contact_drift)[2:].ravel())


def test_a_line_foot_rolls_with_its_ankle():
    assert [rolling_joint(BRUCE, foot) for foot in (0, 1)] == [4, 9]


def test_a_point_foot_does_not_roll():
    toes = [contact for contact in BRUCE.contacts if contact.name.endswith("toe")]
    points = BRUCE.changed(contacts=tuple(toes))
    assert [rolling_joint(points, foot) for foot in (0, 1)] == [None, None]


def test_an_ankle_that_ends_in_a_roll_axis_rolls_with_the_pitch_axis_before_it():
    joints = list(BRUCE.joints)
    joints[4] = joints[4].model_copy(update={"axis": (1.0, 0.0, 0.0)})
    sideways = BRUCE.changed(joints=tuple(joints))
    assert rolling_joint(sideways, 0) == 3
