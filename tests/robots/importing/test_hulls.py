"""Meshes become capsules where these lie nearly inside, else hulls that lie inside and reach nearly as far."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.robots.importing.capsules import Capsule
from aloft.robots.importing.hulls import INSIDE, Hull, of_points

RANDOM = np.random.default_rng(5)


def rod(angle: float) -> np.ndarray:
    """The corners (8, 3) of a slender box that is turned by an angle [rad] about z."""
    corners = np.array(
        [[x, y, z] for x in (-0.3, 0.3) for y in (-0.05, 0.05) for z in (-0.05, 0.05)]
    )
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(corners @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T)


def bent(count: int = 400) -> np.ndarray:
    """Corners (n, 3) of a bent and tapering tube, as thighs are."""
    share, around = RANDOM.random(count), RANDOM.uniform(0.0, 2.0 * np.pi, count)
    radius = 0.07 - 0.04 * share
    x = 0.15 * np.sin(np.pi * share) + radius * np.cos(around)
    return np.stack([x, radius * np.sin(around), -0.4 * share], axis=1)


def test_a_slender_box_is_a_capsule_along_it() -> None:
    (capsule,) = of_points(rod(0.5) + np.array([1.0, 0.0, 0.0]))
    assert isinstance(capsule, Capsule)
    along = capsule.end - capsule.start
    assert capsule.radius == pytest.approx(0.05, rel=0.01)
    assert abs(along @ [np.cos(0.5), np.sin(0.5), 0.0]) == pytest.approx(0.5, rel=0.01)
    assert 0.5 * (capsule.start + capsule.end) == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)


def test_what_capsules_would_overstate_becomes_a_hull_inside_it() -> None:
    corners = bent()
    (hull,) = of_points(corners)
    assert isinstance(hull, Hull)
    assert len(hull.corners) < 40
    assert {tuple(corner) for corner in hull.corners} <= {tuple(corner) for corner in corners}
    directions = RANDOM.normal(size=(5000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    lack = (corners @ directions.T).max(axis=0) - (hull.corners @ directions.T).max(axis=0)
    # between the directions that were looked along a little more may be lacking
    assert 0.0 <= lack.max() < 1.5 * INSIDE


def test_corners_that_differ_in_signs_alone_are_kept() -> None:
    wedge = ((-0.1, 0.0), (0.1, 0.0), (0.0, 0.2))
    corners = np.array([(x, y, z) for x, z in wedge for y in (-0.15, 0.15)])
    (hull,) = of_points(np.vstack([corners, corners]))
    assert isinstance(hull, Hull)
    assert sorted(hull.corners.tolist()) == sorted(corners.tolist())


def test_mirrored_meshes_have_mirrored_hulls() -> None:
    corners = bent()
    corners = np.vstack([corners, corners * [1.0, -1.0, 1.0]])  # alike on both sides
    corners[:, 1] += 0.1 * corners[:, 2]
    mirror = np.array([1.0, -1.0, 1.0])
    (left,), (right,) = of_points(corners), of_points(corners * mirror)
    assert isinstance(left, Hull) and isinstance(right, Hull)
    assert {tuple(c) for c in left.corners} == {tuple(c) for c in right.corners * mirror}


def test_a_plate_stays_capsules_as_it_spans_no_body() -> None:
    plate = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.3, 0.0], [0.2, 0.25, 0.0]])
    assert all(isinstance(shape, Capsule) for shape in of_points(plate))


def test_moving_and_the_lowest_point() -> None:
    hull = Hull(rod(0.0)).moved(np.eye(3), np.array([0.0, 0.0, 1.0]))
    assert hull.lowest(np.eye(3)) == pytest.approx(0.95)
    assert hull.lowest(np.array([[0, 0, 1.0], [0, 1.0, 0], [1.0, 0, 0]])) == pytest.approx(-0.3)
