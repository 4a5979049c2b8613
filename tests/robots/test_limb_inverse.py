"""Inverse kinematics of any chain: it finds what can be reached, and the nearest of what cannot."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from aloft.mathematics.arrays import Array1D, Array2D
from aloft.mathematics.kernel import kernel
from aloft.robots import five_joint_leg
from aloft.robots.description import find_robot
from aloft.robots.limb import FootKind, aim, foot_error, read_limb, set_limb_pose, turning
from aloft.robots.limb_inverse import (
    REACHED,
    approach,
    limb_scratch,
    limb_velocity,
    reach,
)

from ..compiled import run_compiled
from .limbed_robots import LIGHT_QUADRUPED, SEVEN_JOINTS, humanoid, quadruped, slider

BRUCE = find_robot("bruce")
LIMBS = {
    "quadruped": (quadruped(), 1),
    "light quadruped": (quadruped(LIGHT_QUADRUPED), 2),
    "humanoid": (humanoid(), 1),
    "seven joints": (humanoid(SEVEN_JOINTS), 0),
    "slider": (slider(), 0),
    "bruce": (BRUCE, 0),
}
WEIGHTS = np.array([1.0, 1.0, 0.3])
any_number = st.floats(allow_nan=False, allow_infinity=False)
kinds = pytest.mark.parametrize("name", LIMBS)


def pose_of(limb, angles):
    pose = np.zeros((4, 3))
    set_limb_pose(limb.links, limb.tip, np.asarray(angles, float), np.zeros((len(angles), 6)), pose)
    return pose


def starts_of(robot, limb, count, seed=5):
    """The standing joints, and others spread over all that the limits allow."""
    random = np.random.default_rng(seed)
    n = len(limb.joints)
    spread = limb.limits[:, 1] - limb.limits[:, 0]
    rows = limb.limits[:, 0] + random.random((count, n)) * spread
    rows[0] = robot.standing_position[list(limb.joints)]
    return np.hstack([rows, np.zeros((count, 1))])


def error(limb, pose, target):
    return math.sqrt(foot_error(limb.tip, pose, target, WEIGHTS, np.zeros(6)))


@pytest.mark.long
@kinds
def test_every_place_that_can_be_reached_is_found(name):
    """Targets drawn from all joint positions, from a start that knows nothing of them."""
    robot, foot = LIMBS[name]
    limb = read_limb(robot, foot)
    n, random = len(limb.joints), np.random.default_rng(0)
    starts, work, out = starts_of(robot, limb, 500), limb_scratch(len(limb.joints)), np.zeros(n)
    found, count = 0, 50
    for _ in range(count):
        angles = limb.limits[:, 0] + random.random(n) * (limb.limits[:, 1] - limb.limits[:, 0])
        target = pose_of(limb, angles)
        square = reach(
            limb.links, limb.tip, limb.limits, target, WEIGHTS, starts, 128, 40, work, out
        )
        found += square <= REACHED and error(limb, pose_of(limb, out), target) < 1.0000001e-9
        assert (out >= limb.limits[:, 0]).all() and (out <= limb.limits[:, 1]).all()
    assert found == count


@kernel
def follow(
    links: Array2D, tip: Array1D, limits: Array2D, weights: Array1D, path: Array2D,
    anchors: Array2D, target: Array2D, work: Array2D, angles: Array1D, squares: Array1D,
    found: Array2D,
) -> None:  # fmt: skip
    for k in range(path.shape[0]):
        set_limb_pose(links, tip, path[k], anchors, target)
        squares[k] = approach(links, tip, limits, target, weights, 8, work, angles)
        found[k] = angles


@kinds
def test_a_target_that_moves_is_followed_in_a_few_steps(name):
    robot, foot = LIMBS[name]
    limb = read_limb(robot, foot)
    n = len(limb.joints)
    middle = robot.standing_position[list(limb.joints)]
    waves = np.sin(9.0 * 0.002 * np.arange(300)[:, None] + np.arange(n))
    path = np.clip(middle + 0.25 * waves, limb.limits[:, 0], limb.limits[:, 1])
    squares, found = np.full(300, np.inf), np.zeros((300, n))
    run_compiled(
        follow, limb.links, limb.tip, limb.limits, WEIGHTS, path, np.zeros((n, 6)),
        np.zeros((4, 3)), limb_scratch(n), middle.copy(), squares, found,
    )  # fmt: skip
    assert squares.max() <= REACHED
    assert np.abs(np.diff(found, axis=0)).max() < 0.1


@settings(deadline=None)
@given(st.sampled_from([0, 1]), arrays(np.float64, 5, elements=st.floats(0.02, 0.98)))
def test_agrees_with_the_closed_form_of_a_five_joint_leg(foot, fraction):
    leg, limb = five_joint_leg.read_leg(BRUCE, foot), read_limb(BRUCE, foot)
    angles = leg.limits[:, 0] + fraction * (leg.limits[:, 1] - leg.limits[:, 0])
    sole, rotation, closed = np.zeros(3), np.zeros((3, 3)), np.zeros(5)
    five_joint_leg.forward(leg, angles, sole, rotation)
    inside, _ = five_joint_leg.inverse(
        leg, sole, rotation[:, 0], 0.0, angles[0],
        five_joint_leg.LEVEL, closed,
    )  # fmt: skip
    if not inside:
        return
    target, out = np.zeros((4, 3)), closed + 0.02 * np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    aim(sole, rotation, target)
    square = approach(limb.links, limb.tip, limb.limits, target, WEIGHTS, 40, limb_scratch(5), out)
    assert square <= REACHED
    rows = _rows(limb, out)
    if np.linalg.svd(rows)[1][-1] > 0.01:  # away from where two answers meet
        assert np.abs(out - closed).max() < 1e-7
    assert error(limb, pose_of(limb, out), pose_of(limb, closed)) < 3e-9


def _rows(limb, angles):
    """The rows that count, as finite differences."""
    columns = []
    for k in range(len(angles)):
        pose = pose_of(limb, angles)
        moved = np.array(angles)
        moved[k] += 1e-6
        error = np.zeros(6)
        foot_error(limb.tip, pose, pose_of(limb, moved), WEIGHTS, error)
        columns.append(error / 1e-6)
    return np.array(columns).T


@kernel
def reach_it(
    links: Array2D, tip: Array1D, limits: Array2D, target: Array2D, weights: Array1D,
    starts: Array2D, tries: int, steps: int, work: Array2D, angles: Array1D, square: Array1D,
) -> None:  # fmt: skip
    square[0] = reach(links, tip, limits, target, weights, starts, tries, steps, work, angles)


@kernel
def errors_at(
    links: Array2D, tip: Array1D, target: Array2D, weights: Array1D, angles: Array2D,
    anchors: Array2D, pose: Array2D, scratch: Array1D, errors: Array1D,
) -> None:  # fmt: skip
    for k in range(errors.shape[0]):
        set_limb_pose(links, tip, angles[k], anchors, pose)
        errors[k] = math.sqrt(foot_error(tip, pose, target, weights, scratch))


@kinds
def test_out_of_reach_the_nearest_place_within_the_limits(name):
    """No joint position close to the answer brings the foot nearer."""
    robot, foot = LIMBS[name]
    limb = read_limb(robot, foot, margin=0.05)
    n, random = len(limb.joints), np.random.default_rng(1)
    starts, work, out = starts_of(robot, limb, 20), limb_scratch(n), np.zeros(n)
    middle = robot.standing_position[list(limb.joints)]
    for _ in range(10):
        target = pose_of(limb, middle)
        target[0] += random.normal(0.0, 1.0, 3)
        target[0] *= 1.5 / np.linalg.norm(target[0])
        square, errors = np.zeros(1), np.zeros(60)
        run_compiled(
            reach_it, limb.links, limb.tip, limb.limits, target, WEIGHTS, starts, 3, 60, work, out,
            square,
        )  # fmt: skip
        assert square[0] > REACHED
        assert error(limb, pose_of(limb, out), target) == pytest.approx(math.sqrt(square[0]))
        near = out + random.normal(0.0, 0.01, (len(errors), n))
        run_compiled(
            errors_at, limb.links, limb.tip, target, WEIGHTS,
            np.clip(near, limb.limits[:, 0], limb.limits[:, 1]), np.zeros((n, 6)),
            np.zeros((4, 3)), np.zeros(6), errors,
        )  # fmt: skip
        assert errors.min() > math.sqrt(square[0]) - 1e-4


@settings(deadline=None, max_examples=60)
@given(
    st.sampled_from(list(LIMBS)),
    arrays(np.float64, 3, elements=any_number),
    arrays(np.float64, (3, 3), elements=any_number),
    arrays(np.float64, 7, elements=st.floats(-100.0, 100.0)),
    arrays(np.float64, 6, elements=st.floats(-100.0, 100.0)),
)
def test_anything_finite_gives_finite_joints_within_limits(name, place, rotation, start, twist):
    robot, foot = LIMBS[name]
    limb = read_limb(robot, foot)
    n = len(limb.joints)
    target, out, work, speeds = np.zeros((4, 3)), start[:n].copy(), limb_scratch(n), np.zeros(n)
    aim(place, rotation, target)
    assert target[1:] @ target[1:].T == pytest.approx(np.eye(3), abs=1e-9)
    approach(limb.links, limb.tip, limb.limits, target, WEIGHTS, 30, work, out)
    assert (out >= limb.limits[:, 0]).all() and (out <= limb.limits[:, 1]).all()
    limb_velocity(
        limb.links, limb.tip, limb.limits, target, WEIGHTS, out, twist, 3e-4, work, speeds
    )
    assert np.isfinite(speeds).all()


@kinds
def test_velocities_move_the_foot_as_asked(name):
    robot, foot = LIMBS[name]
    limb = read_limb(robot, foot)
    n, random = len(limb.joints), np.random.default_rng(2)
    angles = robot.standing_position[list(limb.joints)] + 0.05
    rate, step = random.uniform(-1.0, 1.0, n), 1e-6
    target, before = pose_of(limb, angles), pose_of(limb, angles - step * rate)
    twist, speeds = np.zeros(6), np.zeros(n)
    twist[:3] = (target[0] - before[0]) / step
    turning(limb.tip, before, target, step, 0.1, twist[3:])
    limb_velocity(
        limb.links, limb.tip, limb.limits, target, WEIGHTS, angles, twist, 1e-6,
        limb_scratch(n), speeds,
    )  # fmt: skip
    after, wanted = pose_of(limb, angles + step * speeds), pose_of(limb, angles + step * rate)
    assert error(limb, after, wanted) / step < 1e-4


def test_a_joint_at_its_limit_stands_still_and_the_others_do_what_they_can():
    limb = read_limb(quadruped(), 0)
    angles = np.array([0.0, 0.8, -0.84])
    target, speeds = pose_of(limb, angles), np.zeros(3)
    away = np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0])
    limb_velocity(
        limb.links, limb.tip, limb.limits, target, WEIGHTS, angles, away, 3e-4, limb_scratch(3),
        speeds,
    )  # fmt: skip
    assert speeds[2] == 0.0
    assert abs(speeds[1]) > 0.1


def test_a_point_foot_and_a_line_foot_ignore_what_they_cannot_hold():
    for name, axis in (("quadruped", [0.3, -1.0, 0.5]), ("bruce", [1.0, 0.0, 0.0])):
        robot, foot = LIMBS[name]
        limb = read_limb(robot, foot)
        target = pose_of(limb, robot.standing_position[list(limb.joints)])
        turned, unit = target.copy(), np.array(axis) / np.linalg.norm(axis)
        cross = np.cross(np.eye(3), unit)
        turn = np.eye(3) + math.sin(0.7) * cross.T + (1 - math.cos(0.7)) * cross @ cross
        turned[1:] = target[1:] @ turn
        assert error(limb, target, turned) < 1e-12
    flat = read_limb(humanoid(), 0)
    assert flat.kind == FootKind.FLAT
    target = pose_of(flat, np.zeros(6))
    turned = target.copy()
    turned[1:] = target[1:] @ turn
    assert error(flat, target, turned) == pytest.approx(0.3 * 0.7)


@pytest.mark.parametrize("axis", range(3))
def test_half_a_turn_has_an_axis(axis):
    """Where the foot points the opposite way the error is half a turn, not nothing."""
    diagonal = -np.ones(3)
    diagonal[axis] = 1.0
    for name in ("bruce", "humanoid"):
        robot, foot = LIMBS[name]
        limb = read_limb(robot, foot)
        pose = np.vstack([np.zeros(3), np.eye(3)])
        target = np.vstack([np.zeros(3), np.diag(diagonal)])
        expected = 0.0 if name == "bruce" and axis == 0 else 0.3 * math.pi
        assert error(limb, pose, target) == pytest.approx(expected)
