"""Capsules lie inside the shapes they stand for, and reach nearly as far along them."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.robots.importing import capsules


def surface(capsule: capsules.Capsule) -> np.ndarray:
    """Points on a capsule's surface, (n, 3)."""
    random = np.random.default_rng(0)
    directions = random.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ends = np.where(random.random((2000, 1)) < 0.5, capsule.start, capsule.end)
    return ends + capsule.radius * directions


@pytest.mark.parametrize(
    "sizes", [(0.1, 0.1, 0.1), (0.3, 0.1, 0.1), (0.1, 0.02, 0.3), (1, 0.5, 0.1)]
)
def test_a_box(sizes: tuple[float, float, float]) -> None:
    found = capsules.of_box(np.array(sizes))
    assert 1 <= len(found) <= 3
    for capsule in found:
        assert np.all(np.abs(surface(capsule)) <= np.array(sizes) + 3e-4)
    reach = max(float(np.abs(surface(capsule)).max()) for capsule in found)
    assert reach == pytest.approx(max(sizes), rel=0.02)


@pytest.mark.parametrize(("radius", "half"), [(0.1, 0.3), (0.1, 0.1), (0.3, 0.05)])
def test_a_cylinder(radius: float, half: float) -> None:
    for capsule in capsules.of_cylinder(radius, half):
        points = surface(capsule)
        assert np.abs(points[:, 2]).max() <= half + 3e-4
        assert np.hypot(points[:, 0], points[:, 1]).max() <= np.hypot(radius, radius)


def test_a_ball_is_a_very_short_capsule() -> None:
    (ball,) = capsules.of_sphere(0.05)
    assert ball.radius == 0.05 and 0.0 < np.linalg.norm(ball.end - ball.start) < 1e-3


def test_a_mesh_is_taken_for_the_box_along_it() -> None:
    corners = np.array(
        [[x, y, z] for x in (-0.3, 0.3) for y in (-0.05, 0.05) for z in (-0.05, 0.05)]
    )
    angle = 0.5
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    (capsule,) = capsules.of_points(corners @ turn.T + [1.0, 0.0, 0.0])
    along = capsule.end - capsule.start
    assert capsule.radius == pytest.approx(0.05, rel=0.01)
    assert abs(along @ turn[:, 0]) == pytest.approx(0.5, rel=0.01)
    assert 0.5 * (capsule.start + capsule.end) == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)


def test_moving_and_the_lowest_point() -> None:
    capsule = capsules.along(2, 0.2, 0.1).moved(np.eye(3), np.array([0.0, 0.0, 1.0]))
    assert capsule.lowest(np.eye(3)) == pytest.approx(0.7)
