"""Swing range of arms: ranges of their joints in which they keep clear of the body that carries them.

An arm here is a limb that moves and has no foot. Its distance from trunk and head has corners, so that a
solver would follow it badly. It depends on the arm's own few angles alone, so it is looked up beforehand, and what the
problem gets is a box of angles. Legs move, too: that arms keep clear of them is left to the check of plans.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.kinematics import link_poses
from ..models.link_shapes import arms, clearance_deficit, gaps_between, legs, moving_shapes
from ..task.scaling import per_robot

POSES = 6000
"""Greatest number of poses of an arm that are examined."""
FINEST = 61
"""Angles of a joint of an arm with few joints."""
TURN = np.pi
"""Range examined on either side of a joint without limits [rad]."""


@per_robot
def arm_ranges(robot: RobotDescription, gap: float) -> Mapping[int, tuple[float, float]]:
    """Return by the index of every joint of an arm the angles [rad] around its place in the standing pose in which the
    arm keeps ``gap`` [m] from the links that stand still with the base, and half of it on its own side of the base's
    middle plane, or the distances that it stands in. A box: every pose in it does. Arms have no more joints than can be
    looked at in ``POSES`` poses, three angles each; others are not bounded.
    """
    found: dict[int, tuple[float, float]] = {}
    chains = arms(robot)
    moved = {link for chain in (*chains, *legs(robot)) for link in chain}
    trunk = [link.name for link in robot.links if link.name not in moved and link.shapes]
    for arm in chains:
        joints = [k for k, joint in enumerate(robot.joints) if joint.child in arm]
        joints = [k for k in joints if robot.joints[k].name not in robot.held]
        if trunk and 3 ** len(joints) <= POSES and any(robot.link(name).shapes for name in arm):
            found |= _ranges(robot, arm, joints, trunk, gap)
    return found


def _ranges(
    robot: RobotDescription, arm: list[str], joints: list[int], trunk: list[str], gap: float
) -> dict[int, tuple[float, float]]:
    """Return the ranges of one arm."""
    count = min(FINEST, int(POSES ** (1.0 / len(joints))))
    angles, start = list[Array](), list[int]()
    for k in joints:
        stands = float(robot.standing_position[k])
        low, high = np.clip(robot.joint_limits[k], stands - TURN, stands + TURN)
        own = np.unique([stands, *np.linspace(low, high, count)])
        angles.append(own)
        start.append(int(np.flatnonzero(own == stands)[0]))
    clear = _clear(robot, arm, joints, trunk, gap, angles, tuple(start))
    low, high = start.copy(), start.copy()
    grows = [(axis, way) for axis in range(len(joints)) for way in (-1, 1)]
    while grows:
        for axis, way in tuple(grows):
            to = low[axis] - 1 if way < 0 else high[axis] + 1
            box = [slice(a, b + 1) for a, b in zip(low, high, strict=True)]
            box[axis] = slice(to, to + 1)
            if not 0 <= to < len(angles[axis]) or not clear[tuple(box)].all():
                grows.remove((axis, way))
            elif way < 0:
                low[axis] = to
            else:
                high[axis] = to
    return {
        k: (float(own[a]), float(own[b]))
        for k, own, a, b in zip(joints, angles, low, high, strict=True)
    }


def _clear(
    robot: RobotDescription, arm: list[str], joints: list[int], trunk: list[str], gap: float,
    angles: list[Array], start: tuple[int, ...],
) -> Array:  # fmt: skip
    """Return whether the arm keeps clear, on the grid of its joints' angles."""
    grid = np.stack(np.meshgrid(*angles, indexing="ij"), axis=-1)
    q = np.tile(robot.standing_position, (grid[..., 0].size, 1))
    q[:, joints] = grid.reshape(len(q), -1)
    poses = link_poses(robot, np.zeros((len(q), 3)), np.tile([0.0, 0.0, 0.0, 1.0], (len(q), 1)), q)
    carrier = {joint.child: joint.parent for joint in robot.joints}
    clear = np.ones(len(q), bool)
    here = int(np.ravel_multi_index(start, grid.shape[:-1]))
    side = float(np.sign(poses.of(arm[0])[0][here, 1]))
    shapes = moving_shapes(robot, poses)
    for link in arm:
        for each in shapes[link] if side else ():
            inside = (side * each.corners[:, :, 1]).min(axis=0) - each.shape.radius
            clear &= clearance_deficit(inside[None], 0.5 * gap, here) <= 0.0
        for other in trunk:
            if shapes[link] and shapes[other]:
                gaps = gaps_between(shapes[link], shapes[other])
                clear &= clearance_deficit(gaps, gap, here, carried=other == carrier[link]) <= 0.0
    return np.asarray(clear.reshape(grid.shape[:-1]))
