"""Approximates simple collision shapes by capsules; ``hulls`` does so for meshes.

A capsule stands for each shape, lying inside it where the shape is round or slender: a sphere is
a very short capsule, a cylinder loses its edges, and a box is filled by up to three capsules side by
side, as thick as its thinnest side. What a capsule leaves out is at most the corners, so a robot touches things slightly
later with capsules than with its own shapes, never earlier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...mathematics.arrays import Array

SHORTEST = 4e-4
"""The least length of a capsule between the centres of its ends [m]: a ball is that long."""


@dataclass(frozen=True)
class Capsule:
    """Capsule from ``start`` to ``end`` [m], each (3,), of ``radius`` [m]."""

    start: Array
    end: Array
    radius: float

    @property
    def corners(self) -> Array:
        """Both ends (2, 3) [m]."""
        return np.array([self.start, self.end])

    def moved(self, rotation: Array, position: Array) -> Capsule:
        """Return the capsule in another frame, in which its own frame has this rotation and position."""
        return Capsule(
            rotation @ self.start + position, rotation @ self.end + position, self.radius
        )

    def lowest(self, rotation: Array) -> float:
        """Return the height of its lowest point [m] in a frame in which its own has this rotation."""
        return float(min((rotation @ self.start)[2], (rotation @ self.end)[2]) - self.radius)


def coarse(values: Array) -> list[float]:
    """Round lengths [m] to a tenth of a millimetre, the same on every machine.

    The small shift keeps numbers that people write, such as 0.01125, off the edge between two
    roundings, where the last bit of a computation would decide.
    """
    return [float(value) for value in np.round(np.asarray(values) + 1.234e-7, 4) + 0.0]


def along(axis: int, half_length: float, radius: float) -> Capsule:
    """Return a capsule about the origin along coordinate axis ``axis``."""
    end = np.zeros(3)
    end[axis] = max(half_length, 0.5 * SHORTEST)
    return Capsule(-end, end, radius)


def of_sphere(radius: float) -> list[Capsule]:
    """Return the capsule for a sphere."""
    return [along(2, 0.0, radius)]


def of_cylinder(radius: float, half_length: float) -> list[Capsule]:
    """Return the capsule for a cylinder about z; a disc's lies across it."""
    if half_length >= radius:
        return [along(2, half_length - radius, radius)]
    return of_box(np.array([radius, radius, half_length]))


def of_ellipsoid(sizes: Array) -> list[Capsule]:
    """Return the capsule for an ellipsoid of these half axes (3,)."""
    long, middle, short = np.argsort(-sizes, kind="stable")
    radius = float(np.sqrt(sizes[middle] * sizes[short]))
    return [along(int(long), float(sizes[long]) - radius, radius)]


def of_box(sizes: Array) -> list[Capsule]:
    """Return up to three capsules that fill a box of these half lengths (3,)."""
    long, middle, short = (int(k) for k in np.argsort(-sizes, kind="stable"))
    radius = float(sizes[short])
    room = float(sizes[middle]) - radius
    count = 1 if room < 0.5 * radius else 2 if room < 1.5 * radius else 3
    capsule, found = along(long, float(sizes[long]) - radius, radius), []
    for place in np.linspace(-1.0, 1.0, count) if count > 1 else (0.0,):
        offset = np.zeros(3)
        offset[middle] = place * room
        found.append(capsule.moved(np.eye(3), offset))
    return found
