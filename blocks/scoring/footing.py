"""The feet of a robot of any kind: the quantities that the scores measure on them."""

from __future__ import annotations

from math import atan2, cos, hypot, sin

import numpy as np

from ...mathematics.arrays import Array, Flags
from ...mathematics.constants import GRAVITY
from ...mathematics.rotations import rotate, yaw
from ...robots.ball_feet import ball_feet
from ...robots.description import RobotDescription
from ...robots.limb import place_limb, read_limb
from ...robots.link_poses import standing_heights

FALL_SHARE = 0.315
"""A base below this share of its standing height counts as fallen: 0.12 m for BRUCE."""
LOAD_SHARE = 0.4
"""Least load of a foot at rest, as a share of its load when all feet carry the same."""
PLANE = 3
"""The number of loaded points by which a sole with at least as many is flat on the ground."""


class Footing:
    """A robot's feet and contact points, its weight and the height it stands at.

    Attributes:
        points_of_foot: for every foot the indices of its contact points.
        weight: of the robot [N].
        standing_height: of the base above the contact points in the standing pose [m].
    """

    def __init__(self, robot: RobotDescription) -> None:
        foot_of_contact = robot.foot_of_contact()
        self.points_of_foot = [
            [k for k, foot in enumerate(foot_of_contact) if foot == number]
            for number in range(len(robot.feet))
        ]
        self._balls = [
            (ball, limb, np.zeros(len(limb.joints)), np.zeros((len(limb.joints), 6)))
            for ball in ball_feet(robot)
            for limb in (read_limb(robot, ball.foot),)
        ]
        self._pose, self._axis = np.zeros((4, 3)), np.zeros(3)
        self.weight = robot.total_mass * GRAVITY
        self.standing_height = -float(standing_heights(robot).min())

    @property
    def fall_height(self) -> float:
        """A base lower above the ground than this has fallen, unless told otherwise [m]."""
        return float(round(FALL_SHARE * self.standing_height, 3))

    @property
    def load_share(self) -> float:
        """The least share of the weight on each foot at rest, unless told otherwise."""
        return LOAD_SHARE / len(self.points_of_foot)

    def measure(self, points: Array, orientation: Array, middle: Array, direction: Array) -> None:
        """Measure the horizontal position and direction of every foot.

        Args:
            points: the contact points [m, world], (n_contacts, 3).
            orientation: the base's quaternion x, y, z, w.
            middle: becomes the middle of every foot's points [m], (n_feet, 2).
            direction: becomes the vector from a foot's last point to its first (n_feet, 2). For a
                foot of one point it is the vector from the middle of all feet to the foot, and for
                a robot with a single such foot the heading of the base. Only its rotation counts.
        """
        count = len(self.points_of_foot)
        for number, indices in enumerate(self.points_of_foot):
            for axis in range(2):
                ends = points[indices[0]].item(axis), points[indices[-1]].item(axis)
                middle[number, axis] = sum(points[k].item(axis) for k in indices) / len(indices)
                direction[number, axis] = ends[0] - ends[1]
        for number, indices in enumerate(self.points_of_foot):
            if len(indices) > 1:
                continue
            if count == 1:
                heading = yaw(orientation)
                direction[number, 0], direction[number, 1] = cos(heading), sin(heading)
                continue
            for axis in range(2):
                mean = sum(middle[k].item(axis) for k in range(count)) / count
                direction[number, axis] = middle[number].item(axis) - mean

    def unroll(self, joints: Array, orientation: Array, middle: Array) -> None:
        """Subtract from the positions of ball feet how far they have rolled.

        A ball that rolls without sliding moves by its radius times the angle by which its foot
        leans, in the direction of the lean. The remaining position changes only if the foot slides.

        Args:
            joints: positions of the joints [rad or m], (n_joints,).
            orientation: of the base, quaternion x, y, z, w.
            middle: the middle of every foot's points (n_feet, 2), changed.
        """
        for ball, limb, angles, anchors in self._balls:
            for k, joint in enumerate(limb.joints):
                angles[k] = joints[joint]
            place_limb(limb.links, limb.tip, angles, anchors, self._pose)
            rotate(orientation, self._pose[1:, 2], self._axis)
            x, y, z = self._axis.tolist()
            leaning = hypot(x, y)
            way = ball.radius * atan2(leaning, z) / leaning if leaning > 1e-12 else ball.radius
            middle[ball.foot, 0] -= way * x
            middle[ball.foot, 1] -= way * y

    def points_missing(self, touched: Flags) -> int:
        """The number of further points that must carry load for every sole to be flat.

        A point or line foot needs all of its points, a foot with more points needs three.
        """
        loaded = touched.tolist()
        return sum(
            max(0, min(len(indices), PLANE) - sum(loaded[k] for k in indices))
            for indices in self.points_of_foot
        )

    def least_load(self, force: Array) -> float:
        """The least loaded foot's share of the weight; ``force`` on each point [N, world]."""
        loads = [sum(force[k].item(2) for k in indices) for indices in self.points_of_foot]
        return float(min(loads)) / self.weight
