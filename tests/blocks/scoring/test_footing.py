"""Where feet are and point: rigid motions of the robot move and turn them alike."""

import math

import numpy as np
import pytest

from aloft.blocks.scoring.footing import measure_feet, points_of

from ...turns import quaternion_of

LAYOUTS = {
    "two feet of two points": [0, 0, 1, 1],
    "three points and two, in turn": [0, 1, 0, 1, 0],
    "four balls": [0, 1, 2, 3],
    "one ball": [0],
}


def measured(feet: list[int], points: np.ndarray, yaw: float) -> tuple[np.ndarray, np.ndarray]:
    count = max(feet) + 1
    middle, direction = np.zeros((count, 2)), np.zeros((count, 2))
    measure_feet(np.array(feet), points, quaternion_of([0.0, 0.0, yaw]), middle, direction)
    return middle, direction


@pytest.mark.parametrize("feet", LAYOUTS.values(), ids=list(LAYOUTS))
@pytest.mark.parametrize("turn", [0.0, 0.7, -2.5, math.pi])
def test_a_rigid_motion_moves_the_middles_and_turns_the_directions(
    feet: list[int], turn: float
) -> None:
    points = np.random.default_rng(5).normal(size=(len(feet), 3))
    middle, direction = measured(feet, points, 0.3)
    c, s = math.cos(turn), math.sin(turn)
    rotation, shift = np.array([[c, -s], [s, c]]), np.array([0.4, -1.1])
    moved = points.copy()
    moved[:, :2] = points[:, :2] @ rotation.T + shift
    other, turned = measured(feet, moved, 0.3 + turn)
    np.testing.assert_allclose(other, middle @ rotation.T + shift, atol=1e-12)
    np.testing.assert_allclose(turned, direction @ rotation.T, atol=1e-12)
    assert np.linalg.norm(direction, axis=1).min() > 1e-3


@pytest.mark.parametrize("feet", LAYOUTS.values(), ids=list(LAYOUTS))
def test_middles_are_the_means_of_the_points_of_a_foot(feet: list[int]) -> None:
    points = np.random.default_rng(6).normal(size=(len(feet), 3))
    middle, direction = measured(feet, points, 0.3)
    for foot in range(max(feet) + 1):
        own = points[np.array(feet) == foot, :2]
        assert points_of(np.array(feet), foot) == len(own)
        np.testing.assert_allclose(middle[foot], own.mean(axis=0), atol=1e-12)
        if len(own) > 1:
            expected = own[0] - own[-1]
        elif len(points) > 1:
            expected = own[0] - points[:, :2].mean(axis=0)
        else:
            expected = np.array([math.cos(0.3), math.sin(0.3)])
        np.testing.assert_allclose(direction[foot], expected, atol=1e-12)
