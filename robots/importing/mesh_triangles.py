"""The triangles of a mesh file, and the same surface with fewer of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...mathematics.arrays import Array, Indices
from .collada import collada_triangles
from .mesh_files import stl_corners

DRAWABLE = (".stl", ".obj", ".dae")
FINEST = 5000.0
"""Cells along the longest side of a mesh at first, which joins corners at nearly the same place."""
COARSER = 1.15
"""How much larger the cells become from one try to the next, at least."""
_PLACES = np.array([1 << 40, 1 << 20, 1])
"""Makes one number of the three of a cell."""


def mesh_triangles(path: Path) -> Array:
    """The triangles of an STL, OBJ or COLLADA file [m, as it says or else as it is], (n, 3, 3).

    Raises:
        OSError: the file cannot be read.
        ValueError: it is no mesh of a format that is read here.
    """
    kind = path.suffix.lower()
    try:
        if kind == ".stl":
            triangles = stl_corners(path.read_bytes()).reshape(-1, 3, 3)
        elif kind == ".obj":
            triangles = _obj_triangles(path.read_text(encoding="utf-8", errors="replace"))
        elif kind == ".dae":
            triangles = collada_triangles(path.read_bytes())
        else:
            raise ValueError(f"no mesh of the formats {', '.join(DRAWABLE)}")
        if not len(triangles) or not np.isfinite(triangles).all():
            raise ValueError(f"a mesh of {len(triangles)} triangles, or not all are finite")
    except (ValueError, IndexError, KeyError) as error:
        raise ValueError(f"{path}: {error}") from error
    return triangles


def _obj_triangles(text: str) -> Array:
    """The faces of a Wavefront file; those with more corners become fans of triangles."""
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
    """Corners (n, 3) and triangles (m, 3) of nearly the same surface, of ``most`` triangles or fewer.

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
    """The triangles that have three corners, each once, beginning at its smallest corner."""
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    turn = faces.argmin(axis=1)[:, None]
    rolled = np.take_along_axis(faces, (turn + np.arange(3)) % 3, axis=1)
    number = (rolled[:, 0] << 42) | (rolled[:, 1] << 21) | rolled[:, 2]
    return rolled[np.unique(number, return_index=True)[1]]
