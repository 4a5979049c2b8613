"""A robot that stands at the end of a run sits down before its drives are damped.

Drives in damping hardly carry a robot: it would sink at once. So its joints first follow a path on which
the torso comes down level, with the centre of mass over the feet, until a joint is near its limit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..blocks.signals import (
    CommandMode,
    ContactSwitches,
    ImuReading,
    JointCommand,
    JointState,
)
from ..mathematics.arrays import Array
from ..mathematics.elementary import cos
from ..robots.kinematics import contact_centres, link_poses
from ..robots.robot_description import RobotDescription

_STEP, _SMALLEST_STEP = 0.02, 0.001
"""The torso's descent between two poses of a path, and near the end of it [m]."""
_LOWEST = 0.6
"""The share of the standing height by which the torso comes down at most."""
_MARGIN = 0.005
"""Margin of every joint to its limits [rad]."""
_OFF = 0.002
"""Largest distance of contact points from their places on the path [m]."""
_SINKING = 0.1
"""Yielding of a leg under the robot's weight with the gains of the way down [rad]."""
_DAMPING = 0.02
"""The damping of these gains, for one unit of stiffness [s]."""
_STILL = 1.0
"""A robot whose joints are faster does not stand [rad/s]."""
_NEAR = 0.6
"""Nor does one with a joint further from the standing pose [rad]."""
_UPRIGHT = 0.9
"""Nor one whose vertical axis measures a smaller share of the weight."""


class SittingPath(NamedTuple):
    """``depth`` (n,): how far the torso has come down [m]; ``pose`` (n, n_joints): the joint angles there [rad].
    The first is the standing pose, and the only one where the robot cannot sit down."""

    depth: Array
    pose: Array


def sitting_path(robot: RobotDescription) -> SittingPath:
    """Compute the joints' way from the standing pose to the lowest one."""
    start = robot.standing_position
    depths, poses = [0.0], [start]
    standing = _places(robot, start[None])[0]
    lower = np.minimum(robot.joint_limits[:, 0] + _MARGIN, start)
    upper = np.maximum(robot.joint_limits[:, 1] - _MARGIN, start)
    can_sit = bool(robot.contacts) and robot.base_joint == "floating"
    lowest = -_LOWEST * float(standing[:, 2].min()) if can_sit else 0.0
    step = _STEP
    while step >= _SMALLEST_STEP and depths[-1] + step < lowest:
        wanted = standing + np.array([0.0, 0.0, depths[-1] + step])
        pose = poses[-1]
        for _ in range(3):
            pose = pose + _towards(robot, pose, wanted)
        off = np.abs(_places(robot, pose[None])[0] - wanted).max()
        if off > _OFF or (pose < lower).any() or (pose > upper).any():
            step /= 2.0
            continue
        depths.append(depths[-1] + step)
        poses.append(pose)
    return SittingPath(np.array(depths), np.array(poses))


def _places(robot: RobotDescription, positions: Array) -> Array:
    """Compute the contact points under a level torso, (n, n_contacts, 3) [m]: ahead of the centre of mass, left of it,
    above the torso's origin."""
    count = len(positions)
    level = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    poses = link_poses(robot, np.zeros((count, 3)), level, positions)
    com = np.zeros((count, 3))
    for link in robot.links:
        place, turn = poses.of(link.name)
        com += link.mass / robot.total_mass * (place + turn @ np.array(link.com))
    com[:, 2] = 0.0
    links = {foot.name: foot.link for foot in robot.feet}
    points = np.zeros((count, len(robot.contacts), 3))
    for k, (contact, centre) in enumerate(zip(robot.contacts, contact_centres(robot), strict=True)):
        place, turn = poses.of(links[contact.foot])
        points[:, k] = place + turn @ centre - com
    return points


def _towards(robot: RobotDescription, pose: Array, wanted: Array) -> Array:
    """Compute a step of the joints towards contact points at their ``wanted`` places."""
    n, small = len(pose), 1e-5
    found = _places(robot, pose + small * np.vstack([np.zeros(n), np.eye(n)]))
    slopes = ((found[1:] - found[0]) / small).reshape(n, -1).T
    rows = np.vstack([slopes, 1e-3 * np.eye(n)])
    error = np.concatenate([(wanted - found[0]).ravel(), np.zeros(n)])
    step: Array = np.linalg.lstsq(rows, error, rcond=None)[0]
    return step


def stands(
    robot: RobotDescription, imu: ImuReading, joints: JointState, contacts: ContactSwitches
) -> bool:
    """Check whether a robot stands still and upright on all its feet."""
    still = bool((np.abs(joints.velocity) < _STILL).all())
    near = bool((np.abs(joints.position - robot.standing_position) < _NEAR).all())
    upright = on_feet = True
    if robot.sensors.imu:
        force = imu.specific_force
        upright = force[2] > _UPRIGHT * max(9.0, math.sqrt(float(force @ force)))
    if robot.sensors.switches:
        owners = np.array(robot.foot_of_contact())
        closed = set(owners[np.asarray(contacts.closed)].tolist())
        on_feet = len(closed) == len(robot.feet)
    return still and near and upright and on_feet


class SitDown:
    """The commands with which a robot sits down, one for each tick.

    Args:
        robot: the description.
        path: its ``sitting_path``, of more than one pose.
        speed: of the torso, at most [m/s].
        period: of the ticks [s].
        joints: measured now: the way begins there, with these torques.

    Attributes:
        ticks: how many commands there are.
    """

    def __init__(
        self,
        robot: RobotDescription,
        path: SittingPath,
        speed: float,
        period: float,
        joints: JointState,
    ) -> None:
        self._path = path
        self.ticks = math.ceil(0.5 * math.pi * float(path.depth[-1]) / (speed * period))
        self._period = period
        self._start = np.array(joints.position)
        self._torque = np.array(joints.torque)
        height = -float(_places(robot, path.pose[:1])[0, :, 2].min())
        weight = robot.weight / max(1, len(robot.feet))
        self._stiffness = weight * height / _SINKING
        self._last = self._start.copy()

    def command(self, tick: int, command: JointCommand) -> None:
        """Write the command of a tick, from 1 to ``ticks``."""
        share = 0.5 - 0.5 * cos(math.pi * tick / self.ticks)
        depths, poses = self._path
        depth = share * depths[-1]
        k = max(1, int(np.searchsorted(depths, depth)))
        between = (depth - depths[k - 1]) / (depths[k] - depths[k - 1])
        pose = poses[k - 1] + between * (poses[k] - poses[k - 1])
        command.mode[()] = CommandMode.ACTIVE
        command.position[:] = self._start + pose - poses[0]
        command.velocity[:] = (command.position - self._last) / self._period
        command.torque[:] = self._torque
        command.stiffness[:] = self._stiffness
        command.damping[:] = _DAMPING * self._stiffness
        self._last[:] = command.position
