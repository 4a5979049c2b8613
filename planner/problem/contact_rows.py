"""Which rows of the ``contact`` piece hold the feet on the ground.

The piece has, for every contact point, its place error along the foot, across it and upwards, with
the errors' velocities before them. A foot is rigid, so not all of its points' rows are independent,
and dependent rows make the solver's matrix singular. A point foot is held by its three rows. A line
foot is held by five, as it turns about its own line: ``along`` is held at one of its points only. A
flat foot is held by six. The rows are chosen one after the other, points in their order, each only
if it adds to the rank.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...mathematics.arrays import Array, Indices
from ...robots.description import RobotDescription
from ..models.coordinates import Coordinates

LENGTH = 0.05
"""m; turns of a foot count as velocities at this distance."""
TOLERANCE = 1e-2
"""Points of a foot that are closer to a line than this times ``LENGTH`` are on one."""


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
    """The rows of the piece for sets of contact points, indices among the coordinates' own.

    ``places`` are all contact points as the robot stands (n_contacts, 3), in axes along the feet,
    across them and upwards.
    """

    def __init__(self, robot: RobotDescription, coordinates: Coordinates, places: Array) -> None:
        self._foot = [robot.contacts[c].foot for c in coordinates.contacts]
        self._place = places[list(coordinates.contacts)]
        self._axes = coordinates.axes
        self._each = len(coordinates.axes)
        self._errors = self._each * len(self._foot)
        self._chosen: dict[tuple[frozenset[int], frozenset[int]], Indices] = {}

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
        """The rows of points that say what no row before them does, nor those of the others.
        Few sets occur, but at every knot of a problem; each is worked out once."""
        key = frozenset(points), frozenset(others)
        if key not in self._chosen:
            self._chosen[key] = self._independent(points, others)
        return self._chosen[key].copy()

    def _independent(self, points: set[int], others: set[int]) -> Indices:
        rows = []
        for foot in dict.fromkeys(self._foot):
            here = [i for i in range(len(self._foot)) if self._foot[i] == foot]
            centre = self._place[here].mean(axis=0)
            known = [self._motion(i, axis, centre)
                     for i in here if i in others for axis in self._axes]  # fmt: skip
            rank = _rank(known)
            for i in here:
                if i not in points:
                    continue
                for number, axis in enumerate(self._axes):
                    more = [*known, self._motion(i, axis, centre)]
                    if _rank(more) > rank:
                        known, rank = more, rank + 1
                        rows.append(self._each * i + number)
        return np.array(sorted(rows), dtype=np.int64)

    def _motion(self, point: int, axis: int, centre: Array) -> Array:
        """How a foot's own motion, three velocities and three turns, moves a point along an axis.
        In the sagittal plane a foot turns about y only."""
        direction = np.eye(3)[axis]
        turns = np.cross((self._place[point] - centre) / LENGTH, direction)
        if 1 not in self._axes:
            turns[[0, 2]] = 0.0
        return np.concatenate([direction, turns])


def _rank(rows: list[Array]) -> int:
    return int(np.linalg.matrix_rank(np.array(rows), tol=TOLERANCE)) if rows else 0
