"""Approximates meshes: by capsules where these lie nearly inside, else by convex hulls.

A mesh is first taken for the box along its principal directions, and that for capsules. Where they reach beyond the mesh's
own hull by more than 5 mm, as where a thigh is bent or wider at one end, the hull of some of the mesh's corners takes their
place. It lies inside the mesh's hull and reaches nearly as far in every direction, so a robot touches things slightly later
than with its own shapes, never earlier by more than that. Hollows are filled.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from ...mathematics.arrays import Array
from ..shapes import THINNEST, spread
from .capsules import Capsule, of_box

BEYOND = 0.005
"""m; how far capsules may reach beyond the hull of the mesh that they stand for."""
INSIDE = 0.01
"""m; how far a hull of some of its corners may stay inside the mesh's own one."""
TIED = 1e-6
"""m; how nearly alike two directions lack reach, to be served together, so that mirrored meshes have mirrored hulls."""
UNEVEN = 1e-4
"""Share by which a mesh's spread is made uneven, so that round ones have directions too."""
AT_ONCE = 16
"""Directions looked along together: a mesh may have a hundred thousand corners."""


def _directions() -> Array:
    """Return directions (n, 3) all around. With each there are its mirror images in all coordinate planes, and none is
    at right angles to a coordinate axis or plane, which whole faces of meshes are along.
    """
    found = list[tuple[float, ...]]()
    for one in ((0.12, 0.31, 0.95), (0.17, 0.58, 0.79), (0.43, 0.52, 0.74), (0.06, 0.13, 0.99)):
        for turned in permutations(one):
            found += [tuple(np.multiply(turned, signs)) for signs in product((-1, 1), repeat=3)]
    directions = np.array(found)
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


DIRECTIONS = _directions()


@dataclass(frozen=True)
class Hull:
    """The hull of its ``corners`` (n, 3) [m]."""

    corners: Array

    def moved(self, rotation: Array, position: Array) -> Hull:
        """Return the hull in another frame, in which its own frame has this rotation and position."""
        return Hull(self.corners @ rotation.T + position)

    def lowest(self, rotation: Array) -> float:
        """Return the height of its lowest point [m] in a frame in which its own has this rotation."""
        return float((self.corners @ rotation[2]).min())


RawShape = Capsule | Hull


def of_points(points: Array) -> list[RawShape]:
    """Return the shapes for a mesh with these corners (n, 3): capsules, or one hull where they would overstate it."""
    corners = _once(points)
    capsules = _in_box(corners)
    most = np.concatenate([
        (corners @ DIRECTIONS[k : k + AT_ONCE].T).max(axis=0)
        for k in range(0, len(DIRECTIONS), AT_ONCE)
    ])  # fmt: skip
    reach = np.max([(c.corners @ DIRECTIONS.T).max(axis=0) + c.radius for c in capsules], axis=0)
    if (reach - most).max() <= BEYOND:
        return [*capsules]
    hull = _some_corners(corners, most)
    return [Hull(hull)] if len(hull) >= 4 and spread(hull) >= THINNEST else [*capsules]


def _some_corners(corners: Array, most: Array) -> Array:
    """Return as few of the corners as reach nearly as far as ``most`` [m] in each direction, those first that add
    most.
    """
    found = corners[:0]
    ahead = DIRECTIONS[:8]
    while True:
        found = np.unique([*found, *corners[(corners @ ahead.T).argmax(axis=0)]], axis=0)
        lack = most - (found @ DIRECTIONS.T).max(axis=0)
        if lack.max() <= INSIDE:
            return found
        ahead = DIRECTIONS[lack >= lack.max() - TIED]


def _in_box(corners: Array) -> list[Capsule]:
    """Return the capsules of the box about a mesh along its principal directions."""
    spreads = np.cov((corners - corners.mean(axis=0)).T)
    # Every machine must find the same directions, also where all across a mesh are alike.
    spreads += UNEVEN * np.trace(spreads) * np.diag([0.0, 0.5, 1.0])
    _, directions = np.linalg.eigh(spreads)
    turn = directions * np.sign(directions[np.abs(directions).argmax(axis=0), range(3)])
    places = corners @ turn
    low, high = places.min(axis=0), places.max(axis=0)
    sizes = np.maximum(0.5 * (high - low), 1e-3)
    return [capsule.moved(turn, turn @ (0.5 * (low + high))) for capsule in of_box(sizes)]


def _once(points: Array) -> Array:
    """Return the points (n, 3) without those that stand there again, as corners of triangles do.

    They are told apart by a number made of their bits, which is much faster to sort than rows.
    """
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)
    # Else two signs that differ would cancel, as in a mesh that is alike on both sides.
    bits ^= bits >> np.uint64(33)
    factors = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
    _, first = np.unique((bits * factors).sum(axis=1, dtype=np.uint64), return_index=True)
    return points[first]
