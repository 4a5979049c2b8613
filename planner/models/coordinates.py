"""The coordinates a jump is planned in: all of the robot's, or those of a mirrored motion.

A jump straight ahead needs the sagittal plane only: the base's motion in it and the joints of one
leg that turn about y. The other leg mirrors it, and the legs do not splay. The problem is then less
than half as large in states, and in solution time about a tenth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from .symbolic_model import SymbolicModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Coordinates:
    """A linear embedding: the robot's coordinates are ``matrix`` times the reduced ones.

    Attributes:
        name: ``full`` or ``sagittal``.
        matrix: (n_velocities, size); also takes velocities and accelerations.
        limbs: the limbs that are computed; the others mirror them.
        share: how many limbs each computed one stands for.
        rows: of a base wrench (force, moment), those that are not zero by symmetry.
        joints: indices of the joints of the computed limbs; their motors are computed.
        moving: indices of the joints that are coordinates, in their order.
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

    @property
    def free_base(self) -> tuple[int, ...]:
        """Which of the base's six coordinates are reduced coordinates: these come first."""
        return tuple(int(i) for i in range(6) if np.any(self.matrix[i]))

    def expand(self, reduced: Any) -> Any:
        """The robot's coordinates of an expression of reduced ones."""
        import casadi as ca

        return ca.mtimes(ca.DM(self.matrix), reduced)

    def reduce(self, whole: Array) -> Array:
        """The reduced coordinates of a mirrored motion (..., n_velocities)."""
        return np.asarray(whole @ np.linalg.pinv(self.matrix).T)

    def reduce_forces(self, forces: Array) -> Array:
        """The contact force variables from all contact forces (..., 3 n_contacts)."""
        return np.asarray(forces @ np.linalg.pinv(self.force_matrix).T)


def full_coordinates(model: SymbolicModel) -> Coordinates:
    """Everything moves on its own."""
    contacts = len(model.robot.contacts)
    return Coordinates(
        "full", np.eye(model.size), tuple(range(len(model.limbs))), 1, tuple(range(6)),
        tuple(range(model.n_joints)), tuple(range(model.n_joints)), tuple(range(contacts)),
        (0, 1, 2), np.eye(3 * contacts),
    )  # fmt: skip


def sagittal_coordinates(model: SymbolicModel) -> Coordinates | None:
    """Motion in the sagittal plane, or none if the robot is not the same left and right."""
    robot = model.robot
    if len(model.limbs) != 2 or len(model.limbs[0]) != len(model.limbs[1]):
        return None
    first, second = model.limbs
    if not _mirrored(robot, first, second):
        return None
    pairs = [(i, j) for i, j in zip(first, second, strict=True) if robot.joints[i].axis[1]]
    matrix = np.zeros((model.size, 3 + len(pairs)))
    matrix[0, 0] = matrix[2, 1] = matrix[3, 2] = 1.0
    for column, (i, j) in enumerate(pairs, start=3):
        matrix[6 + i, column] = matrix[6 + j, column] = 1.0
    of_first, of_second = ([c for c, limb in _contacts(model) if limb == k] for k in (0, 1))
    forces = np.zeros((3 * len(robot.contacts), 2 * len(of_first)))
    for column, (i, j) in enumerate(zip(of_first, of_second, strict=True)):
        for c in (i, j):
            forces[3 * c, 2 * column] = forces[3 * c + 2, 2 * column + 1] = 1.0
    return Coordinates(
        "sagittal", matrix, (0,), 2, (0, 2, 4), tuple(first), tuple(i for i, _ in pairs),
        tuple(of_first), (0, 2), forces,
    )  # fmt: skip


def _contacts(model: SymbolicModel) -> list[tuple[int, int]]:
    """Every contact's index and limb."""
    link_of = {foot.name: foot.link for foot in model.robot.feet}
    return [
        (index, model.limb_of_link[link_of[contact.foot]])
        for index, contact in enumerate(model.robot.contacts)
    ]


def _mirrored(robot: RobotDescription, first: Sequence[int], second: Sequence[int]) -> bool:
    """Whether the second limb, the base, transmission and feet are the first's mirror image."""
    flip = np.array([1.0, -1.0, 1.0])
    tensor = np.array([1.0, 1.0, 1.0, -1.0, 1.0, -1.0])
    base = robot.link(robot.base)
    pairs: list[tuple[Any, Any]] = [
        (np.array(base.com) * flip, base.com),
        (np.array(base.inertia) * tensor, base.inertia),
    ]
    matrix = robot.joint_to_motor.T @ robot.joint_to_motor
    signs = np.array([1.0 if robot.joints[i].axis[1] else -1.0 for i in first])
    pairs.append((matrix[np.ix_(first, first)] * np.outer(signs, signs),
                  matrix[np.ix_(second, second)]))  # fmt: skip
    for i, j in zip(first, second, strict=True):
        one, other = robot.joints[i], robot.joints[j]
        limits = np.array(one.limits) if one.axis[1] else -np.array(one.limits)[::-1]
        link, twin = robot.link(one.child), robot.link(other.child)
        pairs += [
            (one.axis, other.axis),
            (np.array(one.origin) * flip, other.origin),
            (limits, other.limits),
            (link.mass, twin.mass),
            (np.array(link.com) * flip, twin.com),
            (np.array(link.inertia) * tensor, twin.inertia),
        ]
    links = [{robot.joints[i].child for i in limb} for limb in (first, second)]
    link_of = {foot.name: foot.link for foot in robot.feet}
    points = [[c for c in robot.contacts if link_of[c.foot] in group] for group in links]
    if len(points[0]) != len(points[1]) or len(points[0]) * 2 != len(robot.contacts):
        return False
    pairs += [(np.array(a.position) * flip, b.position) for a, b in zip(*points, strict=True)]
    return all(np.allclose(a, b, rtol=0.0, atol=1e-12) for a, b in pairs)
