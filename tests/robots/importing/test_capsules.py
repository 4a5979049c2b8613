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


def test_moving_and_the_lowest_point() -> None:
    capsule = capsules.along(2, 0.2, 0.1).moved(np.eye(3), np.array([0.0, 0.0, 1.0]))
    assert capsule.lowest(np.eye(3)) == pytest.approx(0.7)
