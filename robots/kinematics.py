"""The forward kinematics of a robot from its description, for many instants at once.

For pictures and tests, not for control: plain NumPy, vectorised over the instants and
independent of the libraries that the controller and the simulator use.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..mathematics.arrays import Array
from ..mathematics.linear_algebra import product
from .parts import Joint
from .robot_description import RobotDescription


@dataclass(frozen=True)
class LinkPoses:
    """Link frames in the world at ``n`` instants, links in the order of the description.

    ``position`` [m] is (n, n_links, 3), ``rotation`` from link to world (n, n_links, 3, 3).
    """

    names: tuple[str, ...]
    position: Array
    rotation: Array

    def of(self, link: str) -> tuple[Array, Array]:
        """The position (n, 3) and rotation (n, 3, 3) of one link. Raises ``ValueError``."""
        index = self.names.index(link)
        return self.position[:, index], self.rotation[:, index]


def matrices_of_quaternions(quaternions: Array) -> Array:
    """Rotation matrices (n, 3, 3) of unit quaternions x, y, z, w (n, 4)."""
    x, y, z, w = np.moveaxis(quaternions, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), -1, 0))


def quaternions_of_matrices(matrices: Array) -> Array:
    """Unit quaternions x, y, z, w (..., 4) of rotation matrices (..., 3, 3)."""
    m = matrices
    diagonal = np.einsum("...ii->...i", m)
    trace = diagonal.sum(axis=-1)
    # four times the square of each component; the largest gives the most exact result
    squares = np.stack(
        [1.0 - trace + 2.0 * diagonal[..., k] for k in range(3)] + [1.0 + trace], axis=-1
    )
    off = {(i, j): m[..., i, j] for i in range(3) for j in range(3)}
    x, y, z = (off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1])
    xy, xz, yz = (off[0, 1] + off[1, 0], off[0, 2] + off[2, 0], off[1, 2] + off[2, 1])
    rows = np.stack(
        [
            np.stack([squares[..., 0], xy, xz, x], axis=-1),
            np.stack([xy, squares[..., 1], yz, y], axis=-1),
            np.stack([xz, yz, squares[..., 2], z], axis=-1),
            np.stack([x, y, z, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    best = squares.argmax(axis=-1)
    picked = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
    unit: Array = picked / np.linalg.norm(picked, axis=-1, keepdims=True)
    return unit


def rotations_about(axis: tuple[float, float, float], angles: Array) -> Array:
    """Rotation matrices (n, 3, 3) by ``angles`` [rad] (n,) about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    turns: Array = np.eye(3) + sine * cross + (1.0 - cosine) * product(cross, cross)
    return turns


def from_base_outwards(robot: RobotDescription) -> list[tuple[int, Joint]]:
    """The joints with their index, each behind the one that carries its parent link.

    Raises:
        ValueError: some joints are not connected to the base.
    """
    reached = {robot.base}
    remaining = list(enumerate(robot.joints))
    ordered: list[tuple[int, Joint]] = []
    while remaining:
        ready = [(k, joint) for k, joint in remaining if joint.parent in reached]
        if not ready:
            names = ", ".join(joint.name for _, joint in remaining)
            raise ValueError(f"joints {names} are not connected to the base {robot.base!r}")
        ordered += ready
        reached |= {joint.child for _, joint in ready}
        remaining = [(k, joint) for k, joint in remaining if joint.child not in reached]
    return ordered


def link_poses(
    robot: RobotDescription, base_position: Array, base_orientation: Array, joint_position: Array
) -> LinkPoses:
    """The pose of every link.

    Args:
        robot: the description; all its frames are parallel to the base's at the zero pose.
        base_position: base origin in the world [m], (n, 3).
        base_orientation: unit quaternions x, y, z, w from base to world, (n, 4).
        joint_position: joint angles [rad], of slides positions [m], (n, n_joints), in the order of
            the description.
    """
    names = tuple(link.name for link in robot.links)
    index = {name: k for k, name in enumerate(names)}
    instants = len(base_position)
    position = np.zeros((instants, len(names), 3))
    rotation = np.zeros((instants, len(names), 3, 3))
    position[:, index[robot.base]] = base_position
    rotation[:, index[robot.base]] = matrices_of_quaternions(base_orientation)
    for k, joint in from_base_outwards(robot):
        parent, child = index[joint.parent], index[joint.child]
        offset = np.array(joint.origin)
        if joint.kind == "slide":
            offset = offset + joint_position[:, k, None] * np.array(joint.axis)
            position[:, child] = position[:, parent]
            position[:, child] += product(rotation[:, parent], offset[:, :, None])[:, :, 0]
            rotation[:, child] = rotation[:, parent]
            continue
        position[:, child] = position[:, parent] + product(rotation[:, parent], offset)
        turn = rotations_about(joint.axis, joint_position[:, k])
        rotation[:, child] = product(rotation[:, parent], turn)
    return LinkPoses(names, position, rotation)
