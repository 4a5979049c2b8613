"""Collision shapes of links: capsules and convex hulls, whether corners span a body, and the edges and triangles of hulls.

Faces are found by Coal, and only for what draws a hull, measures from it or looks along its edges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Annotated, Any

import numpy as np
from pydantic import Discriminator, Field, Tag

from ..mathematics.arrays import Array, Indices
from .element import Element, Vector3


class Capsule(Element):
    """A collision capsule from ``start`` to ``end`` [m, link frame] of ``radius`` [m]."""

    start: Vector3
    end: Vector3
    radius: float

    @property
    def corners(self) -> tuple[Vector3, ...]:
        """Both ends: all that is within ``radius`` of the line between them is the capsule's."""
        return (self.start, self.end)

    def moved(self, place: Callable[[Vector3], Vector3]) -> Capsule:
        """Return the capsule in another frame, in which ``place`` gives where a point is."""
        return Capsule(start=place(self.start), end=place(self.end), radius=self.radius)


class Hull(Element):
    """A convex collision body: the hull of its ``corners`` [m, link frame], four or more that lie in no plane."""

    corners: Annotated[tuple[Vector3, ...], Field(min_length=4)]

    @property
    def radius(self) -> float:
        """A hull reaches no farther than its corners [m]."""
        return 0.0

    def moved(self, place: Callable[[Vector3], Vector3]) -> Hull:
        """Return the hull in another frame, in which ``place`` gives where a point is."""
        return Hull(corners=tuple(place(corner) for corner in self.corners))


def _kind_of_shape(shape: Any) -> str:
    """Return the kind of shape data, or of a shape: the keys of a hull are none of a capsule's."""
    is_hull = "corners" in shape if isinstance(shape, Mapping) else isinstance(shape, Hull)
    return "hull" if is_hull else "capsule"


SHAPE_KINDS = ("capsule", "hull")
Shape = Annotated[
    Annotated[Capsule, Tag("capsule")] | Annotated[Hull, Tag("hull")], Discriminator(_kind_of_shape)
]
"""A convex collision shape: all that is within ``radius`` of the hull of its ``corners``."""


THINNEST = 1e-3
"""m; how far the corners of a hull are spread across their best plane, at least."""
Edge = tuple[Vector3, Vector3]
"""Both ends [m]."""


def is_body(hull: Hull) -> bool:
    """Check whether the corners are finite and lie in no plane."""
    corners = np.array(hull.corners)
    return bool(np.isfinite(corners).all()) and spread(corners) >= THINNEST


def spread(corners: Array) -> float:
    """Return the reach of corners (n, 3) across the plane that fits them best [m]."""
    middle = corners - corners.mean(axis=0)
    _, directions = np.linalg.eigh(middle.T @ middle)
    return float(np.ptp(middle @ directions[:, 0]))


def corners_of(shapes: Sequence[Shape]) -> tuple[Array, Array]:
    """Return the corners (n, 3) [m, link frame] of all shapes of a link, and how far these reach beyond each (n,)
    [m].
    """
    corners = [corner for shape in shapes for corner in shape.corners]
    radii = [shape.radius for shape in shapes for _ in shape.corners]
    return np.array(corners).reshape(-1, 3), np.array(radii)


@lru_cache(maxsize=512)
def convex(corners: tuple[Vector3, ...]) -> Any:
    """Return Coal's hull of the corners, from which distances to others follow."""
    import coal

    points = coal.StdVec_Vec3s()
    for corner in corners:
        points.append(np.array(corner))
    return coal.Convex.convexHull(points, True, "Qt")


def surface(hull: Hull) -> tuple[Array, Indices]:
    """Return the corners (n, 3) [m, link frame] that the hull has, and the triangles (m, 3) between them,
    counter-clockwise as seen from outside.
    """
    whole = convex(hull.corners)
    places = np.array(whole.points())
    found = [whole.polygons(k) for k in range(whole.num_polygons)]
    triangles = np.array([[each[0], each[1], each[2]] for each in found], np.int64)
    a, b, c = (places[triangles[:, k]] for k in range(3))
    outwards = (np.cross(b - a, c - a) * (a - places.mean(axis=0))).sum(axis=1) > 0.0
    triangles[~outwards] = triangles[~outwards][:, ::-1]
    return places, triangles


def edges(shape: Shape) -> tuple[Edge, ...]:
    """Return the edges of a hull, among them those across a face of more than three corners; of a capsule its axis."""
    return ((shape.start, shape.end),) if isinstance(shape, Capsule) else _edges(shape.corners)


@lru_cache(maxsize=512)
def _edges(corners: tuple[Vector3, ...]) -> tuple[Edge, ...]:
    places, triangles = surface(Hull(corners=corners))
    sides = np.concatenate([triangles[:, pair] for pair in ([0, 1], [1, 2], [2, 0])])
    once = np.unique(np.sort(sides, axis=1), axis=0)
    ends = [tuple(place) for place in places.tolist()]
    return tuple((ends[i], ends[j]) for i, j in once.tolist())
