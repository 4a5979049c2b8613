"""The triangles of a mesh file (STL, OBJ, COLLADA 1.4 and 1.5), in metres, and the same surface with fewer of them.

Of a COLLADA file nodes, their transforms, and instances of geometries are followed; skins, lights and colours
are not. As in RViz and other readers of URDF, the file's unit counts and its up axis does not.

This reads all 777 meshes of example-robot-data. Of libraries, pycollada refuses one that lacks a texture, which
trimesh, 0.8 s to import, takes for empty; Assimp by way of Coal gives 102 other surfaces; fast-simplification leaves
more triangles than asked for where a part consists of many pieces.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array, Indices

READABLE = (".stl", ".obj", ".dae")
STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
"""A triangle of a binary STL file, behind a header of 80 bytes and the number of triangles in four."""
FINEST = 5000.0
"""Cells along the longest side of a mesh at first, which joins corners at nearly the same place."""
COARSER = 1.15
"""Least factor by which the cells grow from one try to the next."""
_PLACES = np.array([1 << 40, 1 << 20, 1])
"""Factors that make one number of the three of a cell."""
MOST_BYTES = 1 << 28
"""Largest file that is read as a mesh."""
MOST_READ = 4_000_000
"""Triangles of a mesh that is read; a COLLADA file of some lines may ask for 10^9."""


def mesh_triangles(path: Path) -> Array:
    """Return the triangles of an STL, OBJ or COLLADA file [m, or the unit that it declares], (n, 3, 3).

    Raises:
        OSError: the file cannot be read.
        ValueError: it is no mesh of a format that is read here, or has too many triangles.
    """
    kind = path.suffix.lower()
    try:
        if not path.is_file() or path.stat().st_size > MOST_BYTES:
            raise ValueError(f"no file, or one of more than {MOST_BYTES >> 20} MiB")
        if kind == ".stl":
            triangles = stl_corners(path.read_bytes()).reshape(-1, 3, 3)
        elif kind == ".obj":
            triangles = _obj_triangles(path.read_text(encoding="utf-8", errors="replace"))
        elif kind == ".dae":
            triangles = collada_triangles(path.read_bytes())
        else:
            raise ValueError(f"no mesh of the formats {', '.join(READABLE)}")
        if len(triangles) > MOST_READ:
            raise ValueError(_too_many(len(triangles)))
        if not len(triangles) or not np.isfinite(triangles).all():
            raise ValueError(f"a mesh of {len(triangles)} triangles, or not all are finite")
    except (ValueError, IndexError, KeyError) as error:
        raise ValueError(f"{path}: {error}") from error
    return triangles


def _too_many(count: int) -> str:
    return f"a mesh of {count} triangles; expected {MOST_READ} at most, make it coarser"


def _obj_triangles(text: str) -> Array:
    """Return the faces of a Wavefront file; those with more corners become fans of triangles."""
    corners: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for line in text.splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            corners.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            found = [int(word.partition("/")[0]) for word in words[1:]]
            face = [k - 1 if k > 0 else len(corners) + k for k in found]
            faces += [(face[0], face[k], face[k + 1]) for k in range(1, len(face) - 1)]
    if not faces:
        return np.zeros((0, 3, 3))
    triangles: Array = np.array(corners, dtype=float).reshape(-1, 3)[np.array(faces)]
    return triangles


def simplified(triangles: Array, most: int) -> tuple[Array, Indices]:
    """Return corners (n, 3) and triangles (m, 3) of nearly the same surface, of ``most`` triangles or fewer.

    Corners in one cell of a cubic grid become one, at their mean (vertex clustering: Rossignac and
    Borrel, 1993). The cells are as small as the number of triangles allows.
    """
    corners = triangles.reshape(-1, 3)
    faces = np.arange(len(corners)).reshape(-1, 3)
    least = corners.min(axis=0)
    extent = float((corners.max(axis=0) - least).max())
    size = extent / FINEST
    while size > 0.0:
        cell = np.floor((corners - least) / size).astype(np.int64) @ _PLACES
        _, member = np.unique(cell, return_inverse=True)
        count = np.bincount(member)
        means = [np.bincount(member, corners[:, k]) / count for k in range(3)]
        corners, faces = np.column_stack(means), _distinct(member[faces])
        if len(faces) <= most:
            break
        # about as many triangles as cells that the surface crosses, so as the size to the power -2
        size = max(COARSER * size, 0.8 * size * (len(faces) / most) ** 0.5)
    used, faces = np.unique(faces, return_inverse=True)
    return corners[used], faces.reshape(-1, 3).astype(np.int64)


def _distinct(faces: Indices) -> Indices:
    """Return the triangles that have three corners, each once, beginning at its smallest corner."""
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    turn = faces.argmin(axis=1)[:, None]
    rolled = np.take_along_axis(faces, (turn + np.arange(3)) % 3, axis=1)
    number = (rolled[:, 0] << 42) | (rolled[:, 1] << 21) | rolled[:, 2]
    return rolled[np.unique(number, return_index=True)[1]]


def stl_corners(content: bytes) -> Array:
    """Return the corners in binary STL (header, count, 50 bytes a triangle), or in its text form."""
    count = int(np.frombuffer(content[80:84], "<u4")[0]) if len(content) >= 84 else 0
    if len(content) == 84 + 50 * count:
        triangles = np.frombuffer(content, STL_TRIANGLE, count, 84)
        return np.asarray(triangles["corners"], dtype=float).reshape(-1, 3)
    lines = content.decode("ascii", "replace").splitlines()
    rows = [line.split()[1:4] for line in lines if line.split()[:1] == ["vertex"]]
    return np.array(rows, dtype=float).reshape(-1, 3)


Element = ElementTree.Element
DEEPEST = 32
"""Nodes inside nodes that are followed; a file may name a node within itself."""
MOST_NODES = 100_000
"""Nodes of a file that are followed in all."""


def collada_triangles(content: bytes) -> Array:
    """Return the triangles of a file's content, (n, 3, 3).

    Raises:
        ValueError: this is no COLLADA file, or it is not as the standard has it.
    """
    try:
        root = ElementTree.fromstring(content)
    except ElementTree.ParseError as error:
        raise ValueError(f"no XML ({error})") from error
    if _tag(root) != "COLLADA":
        raise ValueError("no COLLADA file")
    unit = next((e for e in root.iter() if _tag(e) == "unit"), None)
    metre = float(unit.get("meter", "1")) if unit is not None else 1.0
    named = {e.get("id", ""): e for e in root.iter() if e.get("id")}
    shapes: dict[str, Array] = {}
    scenes = (scene for scene in root.iter() if _tag(scene) == "visual_scene")
    nodes = (node for scene in scenes for node in _children(scene, "node"))
    found, count, visits = [], 0, Visits()
    for node in nodes:
        for triangles in _of_node(node, np.eye(4), named, shapes, visits, 0):
            count += len(triangles)
            if count > MOST_READ:
                raise ValueError(_too_many(count))
            found.append(triangles)
    return metre * np.concatenate([np.zeros((0, 3, 3)), *found])


class Visits:
    """Counts the nodes that were followed: one of few lines may name another 10^9 times."""

    def __init__(self) -> None:
        self.count = 0

    def add(self) -> None:
        """Count one more. Raises ``ValueError`` from ``MOST_NODES`` on."""
        self.count += 1
        if self.count > MOST_NODES:
            raise ValueError(f"more than {MOST_NODES} nodes in one another")


def _of_node(
    node: Element, above: Array, named: dict[str, Element], shapes: dict[str, Array],
    visits: Visits, depth: int,
) -> Iterator[Array]:  # fmt: skip
    """Yield the triangles of a node and those within, in the scene's frame; ``above`` (4, 4) leads there."""
    visits.add()
    if depth > DEEPEST:
        raise ValueError("nodes are too deep in one another")
    pose = above.copy()
    for each in node:
        pose = pose @ _transform(each)
    for each in _children(node, "instance_geometry"):
        name = each.get("url", "").removeprefix("#")
        if name not in shapes:
            shapes[name] = _of_geometry(named[name], named)
        yield shapes[name] @ pose[:3, :3].T + pose[:3, 3]
    for each in _children(node, "instance_node"):
        inner = named[each.get("url", "").removeprefix("#")]
        yield from _of_node(inner, pose, named, shapes, visits, depth + 1)
    for inner in _children(node, "node"):
        yield from _of_node(inner, pose, named, shapes, visits, depth + 1)


def _transform(element: Element) -> Array:
    """Return the matrix (4, 4) of a transform of a node; the identity for anything else."""
    pose, tag = np.eye(4), _tag(element)
    if tag not in ("matrix", "translate", "rotate", "scale"):
        return pose
    values = _floats(element)
    if tag == "matrix":
        return values.reshape(4, 4)
    if tag == "translate":
        pose[:3, 3] = values
    elif tag == "scale":
        pose[:3, :3] = np.diag(values)
    else:  # about an axis, by an angle in degrees
        x, y, z = values[:3] / np.linalg.norm(values[:3])
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        angle = math.radians(values[3])
        pose[:3, :3] = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    return pose


def _of_geometry(geometry: Element, named: dict[str, Element]) -> Array:
    """Return the triangles of a geometry, (n, 3, 3), in its own frame."""
    found = [np.zeros((0, 3, 3))]
    for kind in ("triangles", "polylist", "polygons"):
        for element in geometry.iter():
            if _tag(element) == kind:
                found.append(_of_primitive(element, kind, named))
    return np.concatenate(found)


def _of_primitive(element: Element, kind: str, named: dict[str, Element]) -> Array:
    inputs = list(_children(element, "input"))
    width = 1 + max(int(each.get("offset", "0")) for each in inputs)
    vertex = next(each for each in inputs if each.get("semantic") == "VERTEX")
    corners = _positions(named[vertex.get("source", "").removeprefix("#")], named)
    lists = [np.array((p.text or "").split(), dtype=np.int64) for p in _children(element, "p")]
    if not lists:
        return np.zeros((0, 3, 3))
    if kind == "polygons":
        counts = np.array([len(each) // width for each in lists])
    else:
        size = sum(len(each) for each in lists) // width
        given = next(_children(element, "vcount"), None)
        counts = (
            np.array((given.text or "").split(), dtype=np.int64)
            if kind == "polylist" and given is not None
            else np.full(size // 3, 3)
        )
    index = np.concatenate(lists).reshape(-1, width)[:, int(vertex.get("offset", "0"))]
    return corners[_fans(index, counts)]


def _fans(index: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the triangles (n, 3) of polygons whose corners follow one another in ``index``."""
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    if counts.sum() > len(index):
        raise ValueError("polygons have more corners than there are")
    found = [np.zeros((0, 3), np.int64)]
    for size in np.unique(counts[counts >= 3]).tolist():
        begin = starts[counts == size]
        for k in range(1, size - 1):
            found.append(index[np.column_stack([begin, begin + k, begin + k + 1])])
    return np.concatenate(found)


def _positions(element: Element, named: dict[str, Element]) -> Array:
    """Return the corners (n, 3) that a source or the vertices of a mesh have."""
    if _tag(element) == "vertices":
        source = next(e for e in _children(element, "input") if e.get("semantic") == "POSITION")
        element = named[source.get("source", "").removeprefix("#")]
    numbers = next(e for e in element.iter() if _tag(e) == "float_array")
    accessor = next((e for e in element.iter() if _tag(e) == "accessor"), None)
    stride = int(accessor.get("stride", "3")) if accessor is not None else 3
    return _floats(numbers).reshape(-1, stride)[:, :3]


def _floats(element: Element) -> Array:
    return np.array((element.text or "").split(), dtype=np.float64)


def _tag(element: Element) -> str:
    """Return the name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def _children(element: Element, tag: str) -> Iterator[Element]:
    return (each for each in element if _tag(each) == tag)
