"""The corners of a mesh, from STL and OBJ files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...mathematics.arrays import Array

READABLE = (".stl", ".obj")


def mesh_corners(path: Path) -> Array:
    """The corners [in the file's unit] of a mesh, (n, 3); none are left out, some stand twice.

    Raises:
        ValueError: the file is no mesh of a format that is read here.
    """
    if path.suffix.lower() == ".obj":
        rows = [line.split()[1:4] for line in path.read_text().splitlines() if line[:2] == "v "]
        corners = np.array(rows, dtype=float).reshape(-1, 3)
    elif path.suffix.lower() == ".stl":
        corners = stl_corners(path.read_bytes())
    else:
        raise ValueError(f"{path}: no mesh of the formats {', '.join(READABLE)}")
    if len(corners) < 4:
        raise ValueError(f"{path}: a mesh of {len(corners)} corners")
    return corners


def stl_corners(content: bytes) -> Array:
    """The corners in binary STL (header, count, 50 bytes a triangle), or in its text form."""
    count = int(np.frombuffer(content[80:84], "<u4")[0]) if len(content) >= 84 else 0
    if len(content) == 84 + 50 * count:
        layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
        triangles = np.frombuffer(content, layout, count, 84)
        return np.asarray(triangles["corners"], dtype=float).reshape(-1, 3)
    lines = content.decode("ascii", "replace").splitlines()
    rows = [line.split()[1:4] for line in lines if line.split()[:1] == ["vertex"]]
    return np.array(rows, dtype=float).reshape(-1, 3)
