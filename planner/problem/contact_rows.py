"""Which rows of the ``contact`` piece hold the feet on the ground.

The piece has, for every contact point, its place error along the foot, across it and upwards, with
the errors' velocities before them. A foot is a line: with two points on the ground it is held by
five rows, as it turns about its own line, so ``along`` is held at one point of a foot only.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ..models.coordinates import Coordinates

Indices = NDArray[np.int64]


def reduced_contacts(coordinates: Coordinates, points: Iterable[int]) -> set[int]:
    """Those of the coordinates' own contact points that are among the robot's ``points``."""
    chosen = set(points)
    return {i for i, c in enumerate(coordinates.contacts) if c in chosen}


def is_mirrored(coordinates: Coordinates, points: Iterable[int]) -> bool:
    """Whether a mirrored motion can stand on these of the robot's points."""
    chosen, matrix = set(points), coordinates.force_matrix
    own = reduced_contacts(coordinates, chosen)
    every = len(coordinates.axes)
    reached = {
        c for i in own for c in range(len(matrix) // 3)
        if np.any(matrix[3 * c : 3 * c + 3, every * i : every * (i + 1)])
    }  # fmt: skip
    return reached == chosen


class ContactRows:
    """The rows of the piece for sets of contact points, indices among the coordinates' own."""

    def __init__(self, robot: RobotDescription, coordinates: Coordinates) -> None:
        self._foot = [robot.contacts[c].foot for c in coordinates.contacts]
        self._each = len(coordinates.axes)
        self._errors = self._each * len(self._foot)

    def velocities(self, points: set[int]) -> Indices:
        """Rows of the velocities of points on the ground."""
        return self._rows(points, set())

    def speeds(self, points: set[int], axes: Iterable[int]) -> Indices:
        """Rows of the velocities of points that hit the ground, in those of their axes: the last
        one is upwards, those before it along the foot and across it."""
        rows = [self._each * i + axis for i in sorted(points) for axis in axes]
        return np.array(rows, dtype=np.int64)

    def places(self, points: set[int], held: set[int]) -> Indices:
        """Rows of the places of points that come to the ground while others are ``held`` there."""
        return self._rows(points - held, points & held) + self._errors

    def _rows(self, points: set[int], others: set[int]) -> Indices:
        seen = {self._foot[i] for i in others}
        rows = []
        for i in sorted(points):
            first = self._each * i + (self._foot[i] in seen)
            rows += list(range(first, self._each * (i + 1)))
            seen.add(self._foot[i])
        return np.array(rows, dtype=np.int64)
