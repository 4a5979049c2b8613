"""The ground of a block's world, such as a simulator's: what it is built from, how high it is at a
place, which way it faces there and how slippery it is. For worlds, scores and pictures, never for control.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..mathematics.ground_surface import NOWHERE, Surface, height_of_ground

if TYPE_CHECKING:
    from .description import RobotDescription

Vector = tuple[float, float, float]
Grid = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Ground:
    """A box of ground, given by its ``least`` and ``most`` corners x, y, z [m, world].

    Attributes:
        slope: angles [rad] by which its upper face rises ahead and to the left. A box that leans is
            turned as a whole about the middle of that face, whose sides keep their x and y.
        friction: its coefficient; without one it has the scene's.
        stiffness: factor on the scene's stiffness of contacts.
    """

    least: Vector
    most: Vector
    slope: tuple[float, float] = (0.0, 0.0)
    friction: float | None = None
    stiffness: float = 1.0

    @property
    def level(self) -> bool:
        """True if its faces are normal to the world's axes."""
        return self.slope == (0.0, 0.0)

    @property
    def axes(self) -> tuple[Vector, Vector, Vector]:
        """Its axes [world]; the third is the normal of its upper face."""
        a, b = math.tan(self.slope[0]), math.tan(self.slope[1])
        ahead, up = math.hypot(1.0, a), math.sqrt(a * a + b * b + 1.0)
        x, z = (1.0 / ahead, 0.0, a / ahead), (-a / up, -b / up, 1.0 / up)
        y = (z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0])
        return x, y, z

    @property
    def half_sizes(self) -> Vector:
        """Half of its extents along its own axes [m]."""
        x, y, _ = self.axes
        return (
            0.5 * (self.most[0] - self.least[0]) / x[0],
            0.5 * (self.most[1] - self.least[1]) / y[1],
            0.5 * (self.most[2] - self.least[2]),
        )

    @property
    def middle(self) -> Vector:
        """Its centre [m, world]."""
        z, half = self.axes[2], self.half_sizes[2]
        x, y = (0.5 * (self.least[k] + self.most[k]) for k in range(2))
        return x - half * z[0], y - half * z[1], self.most[2] - half * z[2]

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Its rotation x, y, z, w, from its axes to the world."""
        x, y, z = self.axes
        w = 0.5 * math.sqrt(1.0 + x[0] + y[1] + z[2])
        s = 0.25 / w
        return s * (y[2] - z[1]), s * (z[0] - x[2]), s * (x[1] - y[0]), w

    @property
    def rise(self) -> float:
        """Largest height of its upper face above or below its middle [m]."""
        sides = (0.5 * (self.most[k] - self.least[k]) * math.tan(self.slope[k]) for k in range(2))
        return sum(abs(each) for each in sides)


@dataclass(frozen=True)
class HeightField:
    """Ground of triangles over a grid, from ``least`` to ``most`` x, y [m, world].

    Attributes:
        heights: of the grid's corners [m, world]: rows along y, from the least one, of columns along x.
        friction, stiffness: as those of ``Ground``.
    """

    least: tuple[float, float]
    most: tuple[float, float]
    heights: Grid
    friction: float | None = None
    stiffness: float = 1.0

    @property
    def lowest(self) -> float:
        """The height of its lowest corner [m]."""
        return min(map(min, self.heights))

    @property
    def highest(self) -> float:
        """The height of its highest corner [m]."""
        return max(map(max, self.heights))

    def triangles(self) -> tuple[list[Vector], list[tuple[int, int, int]]]:
        """Its corners [m, world] and the three corners of each triangle, for pictures."""
        rows, columns = len(self.heights), len(self.heights[0])
        xs = np.linspace(self.least[0], self.most[0], columns).tolist()
        ys = np.linspace(self.least[1], self.most[1], rows).tolist()
        corners = [
            (x, y, z)
            for y, row in zip(ys, self.heights, strict=True)
            for x, z in zip(xs, row, strict=True)
        ]
        found = []
        for at in (row * columns + c for row in range(rows - 1) for c in range(columns - 1)):
            opposite = at + columns + 1
            found += [(at, at + 1, opposite), (at, opposite, at + columns)]
        return corners, found


@dataclass(frozen=True)
class Terrain:
    """A level floor at height ``floor`` [m, world], and boxes and height fields that stand on it.

    ``uneven`` is the largest deviation of the ground under a foot from the task's height [m].
    """

    floor: float = 0.0
    blocks: tuple[Ground, ...] = ()
    fields: tuple[HeightField, ...] = ()
    uneven: float = 0.0

    @cached_property
    def surface(self) -> Surface:
        """Its upper surface, for kernels."""
        level = [(b.least[0], b.most[0], b.least[1], b.most[1], b.most[2])
                 for b in self.blocks if b.level]  # fmt: skip
        slopes = [
            (*b.middle, *b.half_sizes, *(v for axis in b.axes for v in axis))
            for b in self.blocks if not b.level
        ]  # fmt: skip
        fields: list[tuple[float, ...]] = []
        heights: list[float] = []
        for field in self.fields:
            rows, columns = len(field.heights), len(field.heights[0])
            sides = [(field.most[k] - field.least[k]) / (n - 1)
                     for k, n in enumerate((columns, rows))]  # fmt: skip
            fields.append((*field.least, *sides, rows, columns, len(heights)))
            heights += [z for row in field.heights for z in row]
        return Surface(
            np.array([self.floor]),
            np.array(level, dtype=np.float64).reshape(-1, 5),
            np.array(slopes, dtype=np.float64).reshape(-1, 15),
            np.array(fields, dtype=np.float64).reshape(-1, 7),
            np.array(heights, dtype=np.float64),
        )

    def height(self, x: float, y: float) -> float:
        """Return the height [m, world] of the highest surface at that place."""
        return height_of_ground(self.surface, x, y, np.zeros(3))

    def normal(self, x: float, y: float) -> Vector:
        """Return the normal [world] of the highest surface at that place."""
        normal = np.zeros(3)
        height_of_ground(self.surface, x, y, normal)
        a, b, c = normal.tolist()
        return a, b, c

    def friction(self, x: float, y: float) -> float | None:
        """Return the friction coefficient there; ``None`` where it is the scene's."""
        best, found = self.floor, None
        for piece, alone in self._pieces():
            height = alone.height(x, y)
            if height > best:
                best, found = height, piece.friction
        return found

    def _pieces(self) -> Iterator[tuple[Ground | HeightField, Terrain]]:
        """Every box and field, and a terrain that has nothing else."""
        for block in self.blocks:
            yield block, Terrain(NOWHERE, (block,))
        for field in self.fields:
            yield field, Terrain(NOWHERE, (), (field,))


class WorldParameters:
    """A base of parameters of a block whose world has ground; recordings draw it."""

    def build_scene(self, robot: RobotDescription | None) -> Terrain:
        """Build the ground that these parameters describe, for a robot; here none."""
        return Terrain(NOWHERE)
