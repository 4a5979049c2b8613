"""The triangles of a COLLADA file (1.4 and 1.5), in metres.

Nodes, their transforms, and instances of geometries are followed; skins, lights and colours are
not. As in RViz and other readers of URDF, the file's unit counts and its up axis does not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array

Element = ElementTree.Element
DEEPEST = 32
"""Nodes inside nodes that are followed; a file may name a node within itself."""


def collada_triangles(content: bytes) -> Array:
    """The triangles of a file's content, (n, 3, 3).

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
    found = [
        triangles
        for scene in root.iter()
        if _tag(scene) == "visual_scene"
        for node in _children(scene, "node")
        for triangles in _of_node(node, np.eye(4), named, shapes, 0)
    ]
    return metre * np.concatenate([np.zeros((0, 3, 3)), *found])


def _of_node(
    node: Element, above: Array, named: dict[str, Element], shapes: dict[str, Array], depth: int
) -> Iterator[Array]:
    """The triangles of a node and those within, in the scene's frame; ``above`` (4, 4) leads there."""
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
        yield from _of_node(inner, pose, named, shapes, depth + 1)
    for inner in _children(node, "node"):
        yield from _of_node(inner, pose, named, shapes, depth + 1)


def _transform(element: Element) -> Array:
    """The matrix (4, 4) of a transform of a node; the identity for anything else."""
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
    """The triangles of a geometry, (n, 3, 3), in its own frame."""
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
    """The triangles (n, 3) of polygons whose corners follow one another in ``index``."""
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
    """The corners (n, 3) that a source or the vertices of a mesh have."""
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
    """The name of an element without its namespace."""
    return str(element.tag).rpartition("}")[2]


def _children(element: Element, tag: str) -> Iterator[Element]:
    return (each for each in element if _tag(each) == tag)
