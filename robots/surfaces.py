"""The surfaces that links are drawn as: meshes of files, boxes and turned parts, in triangles with colours.

Nothing that is computed depends on them. Meshes are made coarser until they are small enough to be kept in
every recording; boxes and turned parts have few triangles anyway.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np

from ..mathematics.arrays import Array, Indices
from ..mathematics.rotations import matrices_of_quaternions
from .element import Vector3
from .importing.package_files import find_file
from .robot_description import Appearance, Box, Mesh, RobotDescription, TurnedShape

MOST_TRIANGLES = 24_000
"""Greatest number of triangles of a whole robot's meshes. Such a robot takes half a megabyte in a recording."""
AROUND = 24
"""The flat pieces around a turned part."""


@dataclass(frozen=True)
class Surface:
    """Corners (n, 3) [m, link frame], the triangles (m, 3) between them, counter-clockwise as seen from
    outside, and their colour as 0xRRGGBB; ``None``: whoever draws it chooses one."""

    corners: Array
    triangles: Indices
    color: int | None = None


@dataclass
class RobotSurfaces:
    """The surfaces of each link that is drawn as some and whose meshes could all be read, and a sentence for
    each link of which one could not: such a link is drawn as its collision shapes."""

    links: dict[str, list[Surface]] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)


def missing_meshes(robot: RobotDescription) -> list[str]:
    """Return what to say of meshes that are not there: a sentence for one, and one for several; no mesh is read."""
    absent = [
        (link, mesh)
        for link, look in robot.looks.items()
        for mesh in look.meshes
        if _path(mesh) is None
    ]
    links = list(dict.fromkeys(link for link, _ in absent))
    if len(absent) < 2:
        return [_absent(*each) for each in absent]
    few = ", ".join(links[:3]) + (f" and {len(links) - 3} more" if len(links) > 3 else "")
    which = f"{len(links)} links ({few}) are" if len(links) > 1 else f"link {few} is"
    return [
        f"{which} drawn as collision shapes: {len(absent)} meshes are missing, the first is {absent[0][1].file}"
    ]


def robot_surfaces(robot: RobotDescription) -> RobotSurfaces:
    """Return the surfaces of all links, each mesh made coarser where that is needed to have at most ``MOST_TRIANGLES``
    in all. Files that serve several links are read once.
    """
    result = RobotSurfaces()
    count = sum(len(look.meshes) for look in robot.looks.values())
    most = MOST_TRIANGLES // max(1, count)
    known: dict[Path, Surface] = {}
    for link, look in robot.looks.items():
        try:
            surfaces = [*_meshes(link, look, most, known), *map(box_surface, look.boxes)]
        except (OSError, ValueError) as error:
            result.problems.append(str(error))
            continue
        surfaces += map(turned_surface, look.turned)
        if surfaces:
            result.links[link] = surfaces
    return result


def joined(surfaces: list[Surface]) -> Surface:
    """Return all as one, without colours."""
    starts = np.cumsum([0, *(len(each.corners) for each in surfaces)])
    return Surface(
        np.concatenate([each.corners for each in surfaces]),
        np.concatenate([e.triangles + k for e, k in zip(surfaces, starts, strict=False)]),
    )


def _meshes(
    link: str, look: Appearance, most: int, known: dict[Path, Surface]
) -> Iterator[Surface]:
    """Yield the meshes of a link. Raises ``OSError`` or ``ValueError`` with the sentence for the user."""
    for mesh in look.meshes:
        from .importing.meshes import mesh_triangles, simplified  # which read XML

        path = _path(mesh)
        if path is None:
            raise ValueError(_absent(link, mesh))
        if path not in known:
            try:
                known[path] = Surface(*simplified(mesh_triangles(path), most))
            except (OSError, ValueError) as error:
                raise ValueError(
                    f"link {link} is drawn as its collision shapes: the mesh cannot be read ({error})"
                ) from error
        placed = _placed(mesh, known[path].corners * np.array(mesh.scale))
        yield Surface(placed, known[path].triangles, _color(mesh.color))


def _path(mesh: Mesh) -> Path | None:
    return find_file(mesh.file, Path())


def _absent(link: str, mesh: Mesh) -> str:
    return f"link {link} is drawn as its collision shapes: there is no mesh {mesh.file}"


def _placed(part: Mesh | Box, corners: Array) -> Array:
    """Return the corners (n, 3) of a part in the link's frame."""
    turn = matrices_of_quaternions(np.array(part.orientation))
    placed: Array = corners @ turn.T + np.array(part.position)
    return placed


def _color(text: str | None) -> int | None:
    return None if text is None else int(text.removeprefix("#"), 16)


def box_surface(box: Box) -> Surface:
    """Return the surface of a box whose edges are rounded by ``box.round``.

    A point p of the sharp box's faces goes to q + r (p - q) / |p - q|, with q the point of the inner box, smaller
    by r on all sides, that is nearest to it.
    """
    half = 0.5 * np.array(box.size)
    inner = half - box.round
    corners: list[Array] = []
    triangles: list[tuple[int, int, int]] = []
    for axis in range(3):
        along, across = (axis + 1) % 3, (axis + 2) % 3
        lines = [
            np.unique([-half[k], -inner[k], inner[k], half[k]]) for k in (along, across)
        ]  # fmt: skip
        for sign in (-1.0, 1.0):
            start, columns = len(corners), len(lines[1])
            for u in lines[0]:
                for v in lines[1]:
                    corner = np.empty(3)
                    corner[axis], corner[along], corner[across] = sign * half[axis], u, v
                    corners.append(corner)
            for i in range(len(lines[0]) - 1):
                for j in range(columns - 1):
                    a = start + i * columns + j
                    b, c, d = a + columns, a + columns + 1, a + 1
                    piece = ((a, b, c), (a, c, d))
                    triangles += piece if sign > 0.0 else [(x, z, y) for x, y, z in piece]
    points, pieces = np.array(corners), np.array(triangles)
    if box.round > 0.0:
        nearest = np.clip(points, -inner, inner)
        away = points - nearest
        points = nearest + box.round * away / np.linalg.norm(away, axis=1, keepdims=True)
        # corners that faces share become one, so that the light goes round the edges
        _, first, which = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
        points, pieces = points[first], which.ravel()[pieces]
    return Surface(_placed(box, points), pieces, _color(box.color))


def turned_surface(part: TurnedShape) -> Surface:
    """Return the surface that the part's profile of radius and place along its axis sweeps, closed at both ends.

    Each piece of the profile has corners of its own, so that its ends are seen as edges.
    """
    profile = np.array(part.profile)
    profile = np.concatenate([[[0.0, profile[0, 1]]], profile, [[0.0, profile[-1, 1]]]])
    if profile[-1, 1] < profile[0, 1]:
        profile = profile[::-1]
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corners: list[Array] = []
    triangles: list[Indices] = []
    here = np.arange(AROUND)
    following = (here + 1) % AROUND
    for low, high in pairwise(profile):
        if np.array_equal(low, high):
            continue
        start = sum(len(each) for each in corners)
        for radius, height in (low, high):
            corners.append(np.column_stack([radius * ring, np.full(AROUND, height)]))
        a, b = start + here, start + following
        c, d = b + AROUND, a + AROUND
        if low[0] > 0.0:
            triangles.append(np.stack([a, b, c], axis=1))
        if high[0] > 0.0:
            triangles.append(np.stack([a, c, d], axis=1))
    turn = matrices_of_quaternions(quaternion_from_z(np.array(part.axis)))
    placed = np.concatenate(corners) @ turn.T + np.array(part.position)
    return Surface(placed, np.concatenate(triangles), _color(part.color))


def quaternion_from_z(direction: Array | Vector3) -> Array:
    """Return the shortest rotation x, y, z, w from +z to ``direction``, which need not be a unit vector."""
    length = float(np.linalg.norm(direction))
    if length < 1e-12:
        return np.array([0.0, 0.0, 0.0, 1.0])
    x, y, z = np.asarray(direction) / length
    if z < -1.0 + 1e-12:
        return np.array([1.0, 0.0, 0.0, 0.0])  # straight down: any half turn will do
    quaternion = np.array([-y, x, 0.0, 1.0 + z])
    return quaternion / float(np.linalg.norm(quaternion))


def normals(surface: Surface) -> Array:
    """Return the unit normal at each corner, (n, 3): the mean of those of its triangles by their areas."""
    a, b, c = (surface.corners[surface.triangles[:, k]] for k in range(3))
    each = np.cross(b - a, c - a)
    found = np.zeros_like(surface.corners)
    for k in range(3):
        np.add.at(found, surface.triangles[:, k], each)
    length = np.linalg.norm(found, axis=1, keepdims=True)
    result: Array = np.where(length > 0.0, found / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))
    return result
