"""The coordinates a jump is planned in: all joints of the robot, or one side of a mirrored motion.

A jump straight ahead is the same left and right, so half of the limbs need to be computed and the
others mirror them. Where the robot stands with its legs upright, only the joints that turn about y
move: that is the sagittal plane, and the problem is then less than half as large in states and
takes about a tenth of the time. Where the legs splay, all joints of the computed limbs move.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from .symbolic_model import SymbolicModel
from .symmetry import Pair, mirrored_pairs


@dataclass(frozen=True)
class Coordinates:
    """A linear embedding: the robot's coordinates are ``matrix`` times the reduced ones.

    Attributes:
        name: ``full``, ``sagittal`` or ``mirrored``.
        matrix: (n_velocities, size); also takes velocities and accelerations.
        limbs: the limbs that are computed; the others mirror them.
        share: how many limbs each computed one stands for.
        rows: of a base wrench (force, moment), those that are not zero by symmetry.
        joints: indices of the joints of the computed limbs; their motors are computed.
        moving: indices of the joints that are coordinates, in their order.
        twins: of mirrored joints that are not computed those that they mirror.
        contacts: indices of the contact points on the computed limbs.
        axes: the components of a contact force that are variables.
        force_matrix: all contact forces (3 n_contacts) = this times those variables.
    """

    name: str
    matrix: Array
    limbs: tuple[int, ...]
    share: int
    rows: tuple[int, ...]
    joints: tuple[int, ...]
    moving: tuple[int, ...]
    twins: Mapping[int, int]
    contacts: tuple[int, ...]
    axes: tuple[int, ...]
    force_matrix: Array

    @property
    def size(self) -> int:
        """The number of reduced coordinates."""
        return int(self.matrix.shape[1])

    @property
    def forces(self) -> int:
        """The number of contact force variables."""
        return len(self.contacts) * len(self.axes)

    @cached_property
    def free_base(self) -> tuple[int, ...]:
        """Indices of the base's six coordinates that are reduced coordinates: these come first."""
        return tuple(int(i) for i in range(6) if np.any(self.matrix[i]))

    @cached_property
    def turning(self) -> tuple[int, ...]:
        """Indices of the reduced coordinates that are angles of the base."""
        return tuple(i for i, axis in enumerate(self.free_base) if axis >= 3)

    def expand(self, reduced: Any) -> Any:
        """Return the robot's coordinates of an expression of reduced ones."""
        import casadi as ca

        return ca.mtimes(ca.DM(self.matrix), reduced)

    def reduce(self, whole: Array) -> Array:
        """Return the reduced coordinates of a mirrored motion (..., n_velocities)."""
        return np.asarray(whole @ self._reduction)

    def reduce_forces(self, forces: Array) -> Array:
        """Return the contact force variables from all contact forces (..., 3 n_contacts)."""
        return np.asarray(forces @ self._force_reduction)

    @cached_property
    def _reduction(self) -> Array:
        return np.asarray(np.linalg.pinv(self.matrix).T)

    @cached_property
    def _force_reduction(self) -> Array:
        return np.asarray(np.linalg.pinv(self.force_matrix).T)

    def contains(self, whole: Array) -> bool:
        """Check whether the coordinates can take these positions (..., n_velocities)."""
        return bool(np.allclose(self.reduce(whole) @ self.matrix.T, whole, rtol=0.0, atol=1e-12))


def full_coordinates(model: SymbolicModel) -> Coordinates:
    """Return coordinates in which everything moves on its own."""
    contacts = len(model.robot.contacts)
    return Coordinates(
        "full", np.eye(model.size), tuple(range(len(model.limbs))), 1, tuple(range(6)),
        tuple(range(model.n_joints)), tuple(range(model.n_joints)), {}, tuple(range(contacts)),
        (0, 1, 2), np.eye(3 * contacts),
    )  # fmt: skip


def sagittal_coordinates(model: SymbolicModel) -> Coordinates | None:
    """Return coordinates of motion in the sagittal plane: the joints about y move, left and right alike, and all others
    keep their zero; ``None`` if the robot is not the same left and right.
    """
    return _mirrored(model, "sagittal")


def mirrored_coordinates(model: SymbolicModel) -> Coordinates | None:
    """Return coordinates of motion that is the same left and right, with all joints of the computed limbs; ``None`` if
    the robot is not the same left and right.
    """
    return _mirrored(model, "mirrored")


def _mirrored(model: SymbolicModel, name: str) -> Coordinates | None:
    robot = model.robot
    pairs = mirrored_pairs(robot)
    if pairs is None:
        return None
    flat = name == "sagittal"
    twins = [twin for pair in pairs for twin in pair.joints]
    moving = [
        (i, j, sign) for i, j, sign in twins
        if not flat or (robot.joints[i].kind == "hinge" and abs(robot.joints[i].axis[1]) == 1.0)
    ]  # fmt: skip
    matrix = np.zeros((model.size, 3 + len(moving)))
    matrix[0, 0] = matrix[2, 1] = matrix[3, 2] = 1.0
    for column, (i, j, sign) in enumerate(moving, start=3):
        matrix[6 + i, column], matrix[6 + j, column] = 1.0, sign
    axes = (0, 2) if flat else (0, 1, 2)
    return Coordinates(
        name, matrix, tuple(pair.limbs[0] for pair in pairs), 2, (0, 2, 4),
        tuple(i for i, _, _ in twins), tuple(i for i, _, _ in moving), {j: i for i, j, _ in twins},
        tuple(c for pair in pairs for c, _ in pair.contacts), axes,
        _force_matrix(len(robot.contacts), pairs, axes),
    )  # fmt: skip


def _force_matrix(contacts: int, pairs: Sequence[Pair], axes: tuple[int, ...]) -> Array:
    """Return all contact forces by those on the computed limbs; mirrored forces push the other way sideways."""
    twins = [twin for pair in pairs for twin in pair.contacts]
    forces = np.zeros((3 * contacts, len(axes) * len(twins)))
    for number, (c, d) in enumerate(twins):
        for place, axis in enumerate(axes):
            column = len(axes) * number + place
            forces[3 * c + axis, column] = 1.0
            forces[3 * d + axis, column] = -1.0 if axis == 1 else 1.0
    return forces
