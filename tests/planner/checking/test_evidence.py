"""Distances: segments against brute force, the ground under a step, the standing robot."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import nnls

from aloft.mathematics.rotations import matrices_of_quaternions
from aloft.mathematics.segment_distances import segment_gap
from aloft.planner.checking.evidence import (
    _gaps,
    body_heights,
    ground_height,
    leg_clearance_deficit,
    step_edge,
)
from aloft.planner.models.exact_dynamics import dynamics_of
from aloft.planner.models.link_shapes import FAR, MovingShape, gaps_between, legs, moving_shapes
from aloft.planner.task.task import make_task
from aloft.robots.description import Capsule, Hull, find_robot
from aloft.robots.kinematics import link_poses
from aloft.robots.pinocchio_model import build_pinocchio_model


def test_segments_against_brute_force() -> None:
    a, b, c, d = np.random.default_rng(0).normal(size=(4, 200, 3))
    s = np.linspace(0.0, 1.0, 101)[None, :, None]
    first, second = a[:, None] + s * (b - a)[:, None], c[:, None] + s * (d - c)[:, None]
    brute = np.linalg.norm(first[:, :, None] - second[:, None], axis=3).min(axis=(1, 2))
    found = np.array([segment_gap(*four) for four in zip(a, b, c, d, strict=True)])
    assert np.all(found <= brute + 1e-12)
    assert np.abs(found - brute).max() < 5e-3


def test_parallel_crossing_and_point_segments() -> None:
    a = np.zeros((4, 3))
    b = np.array([[1.0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0]])
    c = np.array([[0.2, 0.3, 0], [2, 0, 0], [0.5, -1, 0.1], [0, 3, 4]])
    d = np.array([[0.7, 0.3, 0], [3, 0, 0], [0.5, 1, 0.1], [0, 3, 4]])
    found = [segment_gap(*four) for four in zip(a, b, c, d, strict=True)]
    np.testing.assert_allclose(found, [0.3, 1.0, 0.1, 5.0], atol=1e-12)


def test_where_the_ground_changes() -> None:
    level = make_task({"name": "a", "rise": 0.1, "distance_x": 0.2})
    assert step_edge(level) is None
    up = make_task({"name": "a", "rise": 0.1, "distance_x": 0.2, "landing_height": 0.05})
    assert step_edge(up) == pytest.approx(0.1)
    np.testing.assert_array_equal(ground_height(up, np.array([0.0, 0.2]), 0.0), [0.0, 0.05])
    back = make_task({"name": "a", "rise": 0.1, "distance_x": -0.2, "landing_height": -0.05,
                      "step_edge": -0.08})  # fmt: skip
    np.testing.assert_array_equal(ground_height(back, np.array([0.0, -0.2]), 0.0), [0.0, -0.05])
    there = make_task({"name": "a", "rise": 0.1, "landing_height": 0.05})
    x = np.zeros(2)
    np.testing.assert_array_equal(ground_height(there, x, np.array([0.4, 0.6])), [0.0, 0.05])


def test_the_standing_robot() -> None:
    robot = find_robot("bruce")
    base = np.array([[0.0, 0.0, 0.3796]])
    pose = link_poses(robot, base, np.array([[0.0, 0, 0, 1]]), robot.standing_position[None])
    task = make_task({"name": "a", "rise": 0.1})
    heights = body_heights(robot, task, moving_shapes(robot, pose), np.zeros(1))
    assert "right_foot" not in heights
    assert heights["torso"][0] == pytest.approx(0.3796 + 0.03 - 0.055)
    # The hips' capsules, of radius 30 mm, are the nearest: 151.7 mm from axis to axis.
    nearest = min(gap[0] for gap in _gaps(robot, moving_shapes(robot, pose)))
    assert nearest == pytest.approx(0.151711 - 0.06, abs=1e-3)
    assert legs(robot)[0] == [
        "right_hip", "right_hip_shaft", "right_thigh", "right_calf", "right_foot",
    ]  # fmt: skip


def test_a_leg_that_ends_in_a_ball_counts_beyond_the_ball() -> None:
    robot = find_robot("solo12")
    place, turn = np.array([[0.0, 0.0, 0.5]]), np.array([[0.0, 0, 0, 1]])
    pose = link_poses(robot, place, turn, np.zeros((1, len(robot.joints))))
    heights = body_heights(
        robot, make_task({"name": "a", "rise": 0.1}), moving_shapes(robot, pose), np.zeros(1)
    )
    # The leg hangs straight down from the hips, 0.32 m long; its knee is halfway.
    assert heights["FL_LOWER_LEG"][0] == pytest.approx(0.5 - 0.16 - 0.013, abs=0.02)


def closest(first: list, second: list, k: int) -> float:  # type: ignore[type-arg]
    """The least distance between the capsules of two legs at an instant, by trying many points."""
    share = np.linspace(0.0, 1.0, 60)[:, None]
    found = np.inf
    for (a, b), radius in ((each.edges()[0], each.shape.radius) for each in first):
        for (c, d), other in ((each.edges()[0], each.shape.radius) for each in second):
            p, q = a[k] + share * (b[k] - a[k]), c[k] + share * (d[k] - c[k])
            gap = np.linalg.norm(p[:, None] - q[None], axis=2).min()
            found = min(found, float(gap) - radius - other)
    return found


@pytest.mark.parametrize("wanted", [0.03, 0.2])
def test_legs_lack_what_is_wanted_or_what_they_had_at_first(wanted: float) -> None:
    robot = find_robot("bruce")
    count = 6
    joints = np.tile(robot.standing_position, (count, 1))
    names = [joint.name for joint in robot.joints]
    for side, sign in (("right", 1.0), ("left", -1.0)):
        roll = next(k for k, name in enumerate(names) if side in name and "roll" in name)
        joints[:, roll] += sign * np.linspace(0.0, 0.25, count)
    poses = link_poses(robot, np.zeros((count, 3)), np.tile([0.0, 0, 0, 1], (count, 1)), joints)
    left, right = ([c for link in chain for c in moving_shapes(robot, poses)[link]]
                   for chain in legs(robot))  # fmt: skip
    gaps = np.array([closest(left, right, k) for k in range(count)])
    assert np.ptp(gaps) > 0.02, "the legs come closer or go apart"
    lack = leg_clearance_deficit(robot, moving_shapes(robot, poses), wanted)
    assert lack is not None
    # what is lacked of the nearest pair; pairs that were close at first may stay so
    assert np.all(lack >= np.minimum(wanted, gaps[0]) - gaps - 1e-3)
    assert np.all(lack <= wanted - gaps + 1e-9)
    assert lack[0] <= 0.0 + max(0.0, wanted - gaps[0])


def test_corners_of_shapes_move_with_their_link() -> None:
    robot = find_robot("bruce")
    random = np.random.default_rng(0)
    quaternion = random.normal(size=(3, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1)[:, None]
    base = random.normal(size=(3, 3))
    joints = robot.standing_position + random.uniform(-0.2, 0.2, (3, 10))
    poses = link_poses(robot, base, quaternion, joints)
    built = build_pinocchio_model(robot)
    data = built.model.createData()
    for k in range(3):
        q = np.concatenate([base[k], quaternion[k], joints[k]])
        pin.forwardKinematics(built.model, data, q)
        for joint in robot.joints:
            place = data.oMi[built.model.getJointId(joint.name)]
            shapes = robot.link(joint.child).shapes
            for shape, moving in zip(shapes, moving_shapes(robot, poses)[joint.child], strict=True):
                expected = [place.act(np.array(corner)) for corner in shape.corners]
                np.testing.assert_allclose(moving.corners[:, k], expected, atol=1e-12)


@pytest.mark.parametrize("name", ["bruce", "a1"])
def test_compiled_distances_of_legs_are_those_of_their_capsules_one_by_one(name: str) -> None:
    robot, random = find_robot(name), np.random.default_rng(4)
    count, joints = 5, len(robot.joints)
    quaternion = random.normal(size=(count, 4))
    quaternion /= np.linalg.norm(quaternion, axis=1)[:, None]
    place = random.normal(size=(count, 3))
    angles = robot.standing_position + random.uniform(-0.3, 0.3, (count, joints))
    plain = link_poses(robot, place, quaternion, angles)
    compiled = dynamics_of(robot).link_poses(np.hstack([place, quaternion, angles]))
    for link in compiled.names:
        for found, expected in zip(compiled.of(link), plain.of(link), strict=True):
            np.testing.assert_allclose(found, expected, atol=1e-12)
    gaps = list(_gaps(robot, moving_shapes(robot, compiled)))
    chains = [
        [c for link in chain for c in moving_shapes(robot, plain)[link]] for chain in legs(robot)
    ]
    pairs = [(one, two) for i, one in enumerate(chains) for two in chains[i + 1 :]]
    assert len(gaps) == len(pairs)
    for found, (one, other) in zip(gaps, pairs, strict=True):
        expected = [
            [
                segment_gap(*(corners[k] for corners in (*a.corners, *b.corners)))
                - (a.shape.radius + b.shape.radius)
                for k in range(count)
            ]
            for a in one
            for b in other
        ]
        np.testing.assert_allclose(found, expected, atol=1e-12)


def test_bodies_over_a_step_are_as_high_as_their_lowest_point() -> None:
    """Points on the surface of the torso's capsules, straight above whichever ground is there."""
    robot = find_robot("bruce")
    task = make_task({"name": "a", "rise": 0.1, "distance_x": 0.1, "landing_height": 0.04})
    edge = step_edge(task)
    assert edge is not None
    share = np.linspace(0.0, 1.0, 200)[:, None]
    for x in np.linspace(edge - 0.15, edge + 0.15, 13):
        pose = link_poses(robot, np.array([[x, 0.0, 0.4]]), np.array([[0.0, 0.6, 0, 0.8]]),
                          robot.standing_position[None])  # fmt: skip
        heights = body_heights(robot, task, moving_shapes(robot, pose), np.zeros(1))
        lowest = np.inf
        for moving in moving_shapes(robot, pose)["torso"]:
            (start, end), radius = moving.edges()[0], moving.shape.radius
            centres = start + share * (end - start)
            for aside in np.linspace(-0.999, 0.999, 201):
                below = centres[:, 2] - radius * np.sqrt(1.0 - aside**2)
                ground = np.where(centres[:, 0] + radius * aside > edge, 0.04, 0.0)
                lowest = min(lowest, float((below - ground).min()))
        assert lowest - 1e-9 <= heights["torso"][0] <= lowest + 0.012


def test_ground_behind_many_flights() -> None:
    up = make_task({"name": "a", "rise": 0.1, "distance_x": 0.2, "landing_height": 0.05})
    x = np.array([0.0, 0.2, 0.0, 0.2, 0.0, 0.2])
    progress = np.array([-1.0, -1.0, 0.5, 0.5, 3.0, 3.0])
    np.testing.assert_array_equal(ground_height(up, x, progress), [0.0, 0.05] * 3)


def least_distance(one: np.ndarray, other: np.ndarray) -> float:
    """Between the hulls of corners (n, 3) and (m, 3), as non-negative least squares: shares of the corners that add up to
    one, with the nearest points."""
    large = 1e4
    ones, others = large * np.ones(len(one)), large * np.ones(len(other))
    zeros, others_zeros = np.zeros(len(one)), np.zeros(len(other))
    matrix = np.vstack(
        [
            np.hstack([one.T, -other.T]),
            np.hstack([ones, others_zeros]),
            np.hstack([zeros, others]),
        ]
    )
    shares, _ = nnls(matrix, np.array([0.0, 0.0, 0.0, large, large]))
    return float(np.linalg.norm(one.T @ shares[: len(one)] - other.T @ shares[len(one) :]))


def random_shape(random: np.random.Generator, hull: bool) -> Hull | Capsule:
    corners = random.uniform(-0.05, 0.05, (8 if hull else 2, 3)).tolist()
    if hull:
        return Hull(corners=tuple(tuple(corner) for corner in corners))
    return Capsule(start=tuple(corners[0]), end=tuple(corners[1]), radius=0.02)


def at_poses(shape: Hull | Capsule, place: np.ndarray, turn: np.ndarray) -> MovingShape:
    corners = np.array([place + turn @ np.array(corner) for corner in shape.corners])
    return MovingShape(shape, place, turn, corners)


@pytest.mark.parametrize(("first", "second"), [(True, True), (True, False), (False, True)])
def test_hulls_are_as_far_apart_as_their_nearest_points(first: bool, second: bool) -> None:
    random = np.random.default_rng(3)
    for _ in range(20):
        quaternions = random.normal(size=(2, 6, 4))
        quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
        turn = matrices_of_quaternions(quaternions)
        place = random.uniform(-0.15, 0.15, (2, 6, 3))
        one, other = (
            at_poses(random_shape(random, hull), place[k], turn[k])
            for k, hull in enumerate((first, second))
        )
        (gaps,) = gaps_between([one], [other])
        for k, gap in enumerate(gaps):
            apart = least_distance(one.corners[:, k], other.corners[:, k])
            expected = apart - one.shape.radius - other.shape.radius
            if gap > FAR:
                assert gap <= expected + 1e-9  # balls around them are that far apart
            elif apart > 1e-6:
                assert gap == pytest.approx(expected, abs=1e-6)
            else:
                assert gap < 1e-6, "they overlap"
