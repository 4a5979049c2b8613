"""The surface of the ground: how high it is at a place, and which way it faces.

The ground is a level floor with boxes, leaning boxes and height fields on it; the highest surface
counts. ``Terrain`` makes a ``Surface`` of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .arrays import Array1D, Array2D, Vector3
from .kernel import kernel

NOWHERE = -1e9
"""The height of a piece at a place where it is not [m]."""


class Surface(NamedTuple):
    """The pieces of the ground.

    Attributes:
        floor: its height [m], (1,).
        boxes: of each level box from and to in x, from and to in y, and its top [m], (n, 5).
        slopes: of each box that leans its middle [m], its half sizes [m], and its axes in the world, one
            after the other, (n, 15).
        fields: of each height field its least x and y and the sides of a cell [m], the numbers of rows
            (along y) and of columns (along x), and where it begins in ``heights``, (n, 7).
        heights: of the height fields' corners [m], row by row.
    """

    floor: Array1D
    boxes: Array2D
    slopes: Array2D
    fields: Array2D
    heights: Array1D


@kernel
def height_of_slope(box: Array1D, x: float, y: float, normal: Vector3) -> float:
    """Return the height at which a vertical line enters a leaning box from above.

    Args:
        box: a row of ``Surface.slopes``, (15,).
        normal: becomes the face's normal where the line meets the box.
    """
    high, low, entry = -NOWHERE, NOWHERE, 0
    side = 1.0
    for axis in range(3):
        u, v, w = box[6 + 3 * axis], box[7 + 3 * axis], box[8 + 3 * axis]
        start = u * (x - box[0]) + v * (y - box[1])  # along this axis, at the height of the middle
        half = box[3 + axis]
        if abs(w) < 1e-12:
            if abs(start) > half:
                return NOWHERE
        else:
            first, second = (half - start) / w, (-half - start) / w
            upper, lower = max(first, second), min(first, second)
            if upper < high:
                high, entry = upper, axis
                side = 1.0 if w > 0.0 else -1.0
            low = max(low, lower)
    if low > high:
        return NOWHERE
    for k in range(3):
        normal[k] = side * box[6 + 3 * entry + k]
    return float(box[2] + high)


@kernel
def height_of_field(field: Array1D, heights: Array1D, x: float, y: float, normal: Vector3) -> float:
    """Return the height of a height field, whose cells are two triangles each.

    The edge between the triangles goes from a cell's corner of least x and y to the opposite one.

    Args:
        field: a row of ``Surface.fields``, (7,).
        heights: of all fields.
        normal: becomes the normal of the triangle there.
    """
    across, along = (x - field[0]) / field[2], (y - field[1]) / field[3]
    rows, columns = int(field[4]), int(field[5])
    if across < 0.0 or along < 0.0 or across > columns - 1.0 or along > rows - 1.0:
        return NOWHERE
    column, row = min(int(across), columns - 2), min(int(along), rows - 2)
    u, v = across - column, along - row
    at = int(field[6]) + row * columns + column
    here, beyond = heights[at], heights[at + columns + 1]
    ahead, left = heights[at + 1], heights[at + columns]
    if u > v:
        rise, lift = ahead - here, beyond - ahead
    else:
        rise, lift = beyond - left, left - here
    a, b = rise / field[2], lift / field[3]
    length = math.sqrt(a * a + b * b + 1.0)
    normal[0], normal[1], normal[2] = -a / length, -b / length, 1.0 / length
    return float(here + rise * u + lift * v)


@kernel
def height_of_ground(surface: Surface, x: float, y: float, normal: Vector3) -> float:
    """Return the height [m] of the highest surface at a place; ``normal`` becomes its normal,
    (3,)."""
    height = surface.floor[0]
    for box in range(surface.boxes.shape[0]):
        inside = (
            surface.boxes[box, 0] <= x <= surface.boxes[box, 1]
            and surface.boxes[box, 2] <= y <= surface.boxes[box, 3]
        )
        if surface.boxes[box, 4] > height and inside:
            height = surface.boxes[box, 4]
    best, kind = -1, 0
    for box in range(surface.slopes.shape[0]):
        found = height_of_slope(surface.slopes[box], x, y, normal)
        if found > height:
            height, best, kind = found, box, 1
    for field in range(surface.fields.shape[0]):
        found = height_of_field(surface.fields[field], surface.heights, x, y, normal)
        if found > height:
            height, best, kind = found, field, 2
    if kind == 0:
        normal[0], normal[1], normal[2] = 0.0, 0.0, 1.0
    elif kind == 1:
        height = height_of_slope(surface.slopes[best], x, y, normal)
    else:
        height = height_of_field(surface.fields[best], surface.heights, x, y, normal)
    return float(height)
