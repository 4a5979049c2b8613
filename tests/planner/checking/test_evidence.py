"""Distances: segments against brute force, the ground under a step, the standing robot."""

import numpy as np
import pytest

from aloft.planner.checking.evidence import (
    _gaps,
    body_heights,
    ground_height,
    legs,
    segment_distance,
    step_edge,
)
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot
from aloft.robots.kinematics import link_poses


def test_segments_against_brute_force() -> None:
    a, b, c, d = np.random.default_rng(0).normal(size=(4, 200, 3))
    s = np.linspace(0.0, 1.0, 101)[None, :, None]
    first, second = a[:, None] + s * (b - a)[:, None], c[:, None] + s * (d - c)[:, None]
    brute = np.linalg.norm(first[:, :, None] - second[:, None], axis=3).min(axis=(1, 2))
    found = segment_distance(a, b, c, d)
    assert np.all(found <= brute + 1e-12)
    assert np.abs(found - brute).max() < 5e-3


def test_parallel_crossing_and_point_segments() -> None:
    a = np.zeros((4, 3))
    b = np.array([[1.0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 0, 0]])
    c = np.array([[0.2, 0.3, 0], [2, 0, 0], [0.5, -1, 0.1], [0, 3, 4]])
    d = np.array([[0.7, 0.3, 0], [3, 0, 0], [0.5, 1, 0.1], [0, 3, 4]])
    np.testing.assert_allclose(segment_distance(a, b, c, d), [0.3, 1.0, 0.1, 5.0], atol=1e-12)


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
    heights = body_heights(robot, task, pose, np.zeros(1))
    assert "right_foot" not in heights
    assert heights["torso"][0] == pytest.approx(0.3796 + 0.03 - 0.055)
    # The hips' capsules, of radius 30 mm, are the nearest: 151.7 mm from axis to axis.
    nearest = min(gap[0] for gap in _gaps(robot, pose))
    assert nearest == pytest.approx(0.151711 - 0.06, abs=1e-3)
    assert legs(robot)[0] == [
        "right_hip", "right_hip_shaft", "right_thigh", "right_calf", "right_foot",
    ]  # fmt: skip
