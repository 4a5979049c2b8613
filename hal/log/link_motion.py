"""An IMU on a link that joints carry, such as a chest over a waist, moved to the base.

With the link's pose R, p in the base's axes, and p' the velocity of the IMU's place relative to the base, by the joints' angles and
speeds::

    w_base = R w - w_rel
    f_base = R f - (w' x p + w x (w x p) + 2 w x p' + p'')          with w = w_base

Derivatives by time, w' and p'', are differences of the log's rows: with noisy speeds of the joints the force is noisy, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array
from ...robots.kinematics import link_poses
from ...robots.robot_description import RobotDescription

STEP = 1e-5
"""Time for which joints are moved on and back by their speeds to find the link's [s]."""


class LinkMotion(NamedTuple):
    """A place on a link in the base's axes: ``rotation`` from link to base (n, 3, 3), ``position`` [m], ``velocity`` [m/s] and
    ``rate`` [rad/s] relative to the base (n, 3)."""

    rotation: Array
    position: Array
    velocity: Array
    rate: Array


def link_motion(
    robot: RobotDescription, link: str, place: Array, position: Array, velocity: Array
) -> LinkMotion:
    """Return the motion of a place on a link.

    Args:
        place: in the link's frame [m], (3,).
        position, velocity: of the joints [rad, rad/s], (n, n_joints).
    """

    def at(joints: Array) -> tuple[Array, Array]:
        count = len(joints)
        level = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
        origin, rotation = link_poses(robot, np.zeros((count, 3)), level, joints).of(link)
        return origin + rotation @ place, rotation

    here, rotation = at(position)
    ahead, turned_ahead = at(position + STEP * velocity)
    behind, turned_behind = at(position - STEP * velocity)
    spin = (turned_ahead - turned_behind) / (2.0 * STEP) @ np.swapaxes(rotation, 1, 2)
    rate = 0.5 * np.stack(
        [spin[:, 2, 1] - spin[:, 1, 2], spin[:, 0, 2] - spin[:, 2, 0], spin[:, 1, 0] - spin[:, 0, 1]],
        axis=1,
    )  # fmt: skip
    return LinkMotion(rotation, here, (ahead - behind) / (2.0 * STEP), rate)


def imu_at_base(
    motion: LinkMotion, stamps: Array, rates: Array, forces: Array
) -> tuple[Array, Array]:
    """Return what an IMU at the base's origin would read, (n, 3) each.

    Args:
        motion: of the IMU's place, at the stamps.
        stamps: [s], (n,).
        rates, forces: of the IMU, in its link's axes [rad/s, m/s^2], (n, 3).
    """
    turned = np.einsum("nij,nj->ni", motion.rotation, rates) - motion.rate
    force = np.einsum("nij,nj->ni", motion.rotation, forces)
    turning = np.gradient(turned, stamps, axis=0)
    force = force - np.cross(turning, motion.position)
    force -= np.cross(turned, np.cross(turned, motion.position))
    force -= 2.0 * np.cross(turned, motion.velocity)
    force -= np.gradient(motion.velocity, stamps, axis=0)
    return turned, force
