"""The feet of a robot of any kind: the quantities that the scores measure on them."""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D, Array2D, Flags1D, Indices1D
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.rotations import rotate, yaw
from ...robots.description import RobotDescription
from ...robots.kinematics import ball_feet, standing_heights
from ...robots.limb import place_limb, read_limb

FALL_SHARE = 0.315
"""A base below this share of its standing height counts as fallen: 0.12 m for BRUCE."""
LOAD_SHARE = 0.4
"""Least load of a foot at rest, as a share of its load when all feet carry the same."""
PLANE = 3
"""The number of loaded points by which a sole with at least as many is flat on the ground."""


class Ball(NamedTuple):
    """A foot that is a ball: its number and its radius [m], the limb that it ends as a ``Limb`` has
    it, and scratch: the ``angles`` (n,) of the limb's joints, their ``anchors`` (n, 6), the ``pose``
    (4, 3) of the foot, and its upward ``axis`` (3,) in the world."""

    foot: int
    radius: float
    joints: Indices1D
    links: Array2D
    tip: Array1D
    angles: Array1D
    anchors: Array2D
    pose: Array2D
    axis: Array1D


class Footing:
    """A robot's feet and contact points, its weight and the height it stands at.

    Attributes:
        foot_of_point: for every contact point the index of its foot, (n_contacts,).
        weight: of the robot [N].
        standing_height: of the base above the contact points in the standing pose [m].
    """

    def __init__(self, robot: RobotDescription) -> None:
        self.foot_of_point = np.array(robot.foot_of_contact(), np.int64)
        self._feet = len(robot.feet)
        self._balls = [
            Ball(
                ball.foot, float(ball.radius), np.array(limb.joints, np.int64), limb.links, limb.tip,
                np.zeros(len(limb.joints)), np.zeros((len(limb.joints), 6)), np.zeros((4, 3)),
                np.zeros(3),
            )
            for ball in ball_feet(robot)
            for limb in (read_limb(robot, ball.foot),)
        ]  # fmt: skip
        self.weight = float(robot.total_mass * GRAVITY)
        self.standing_height = -float(standing_heights(robot).min())

    @property
    def fall_height(self) -> float:
        """A base lower above the ground than this has fallen, unless told otherwise [m]."""
        return float(round(FALL_SHARE * self.standing_height, 3))

    @property
    def load_share(self) -> float:
        """The least share of the weight on each foot at rest, unless told otherwise."""
        return LOAD_SHARE / self._feet

    def measuring(
        self, points: Array, orientation: Array, middle: Array, direction: Array
    ) -> KernelCall:
        """Measures the horizontal position and direction of every foot: see ``measure_feet``."""
        return KernelCall(measure_feet, self.foot_of_point, points, orientation, middle, direction)

    def unrolling(self, joints: Array, orientation: Array, middle: Array) -> tuple[KernelCall, ...]:
        """Subtracts from the positions of ball feet how far they have rolled: see ``unroll``."""
        return tuple(KernelCall(unroll, ball, joints, orientation, middle) for ball in self._balls)


@kernel
def points_of(foot_of_point: Indices1D, foot: int) -> int:
    """The number of contact points of a foot."""
    count = 0
    for point in range(foot_of_point.shape[0]):
        if foot_of_point[point] == foot:
            count += 1
    return count


@kernel
def measure_feet(
    foot_of_point: Indices1D,
    points: Array2D,
    orientation: Array1D,
    middle: Array2D,
    direction: Array2D,
) -> None:
    """Measure the horizontal position and direction of every foot.

    Args:
        foot_of_point: for every contact point the index of its foot, (n_contacts,).
        points: the contact points [m, world], (n_contacts, 3).
        orientation: the base's quaternion x, y, z, w.
        middle: becomes the middle of every foot's points [m], (n_feet, 2).
        direction: becomes the vector from a foot's last point to its first (n_feet, 2). For a
            foot of one point it is the vector from the middle of all feet to the foot, and for
            a robot with a single such foot the heading of the base. Only its rotation counts.
    """
    feet = middle.shape[0]
    for foot in range(feet):
        size = points_of(foot_of_point, foot)
        for axis in range(2):
            total, first, last, found = 0.0, 0.0, 0.0, False
            for point in range(points.shape[0]):
                if foot_of_point[point] == foot:
                    last = points[point, axis]
                    first = first if found else last
                    total, found = total + last, True
            middle[foot, axis] = total / size
            direction[foot, axis] = first - last
    for foot in range(feet):
        if points_of(foot_of_point, foot) > 1:
            continue
        if feet == 1:
            heading = yaw(orientation)
            direction[foot, 0], direction[foot, 1] = cos(heading), sin(heading)
            continue
        for axis in range(2):
            total = 0.0
            for other in range(feet):
                total += middle[other, axis]
            direction[foot, axis] = middle[foot, axis] - total / feet


@kernel
def unroll(ball: Ball, joints: Array1D, orientation: Array1D, middle: Array2D) -> None:
    """Subtract from the position of a ball foot how far it has rolled.

    A ball that rolls without sliding moves by its radius times the angle by which its foot
    leans, in the direction of the lean. The remaining position changes only if the foot slides.

    Args:
        joints: positions of the joints [rad or m], (n_joints,).
        orientation: of the base, quaternion x, y, z, w.
        middle: the middle of every foot's points (n_feet, 2), changed for this foot.
    """
    for k in range(ball.joints.shape[0]):
        ball.angles[k] = joints[ball.joints[k]]
    place_limb(ball.links, ball.tip, ball.angles, ball.anchors, ball.pose)
    rotate(orientation, ball.pose[1:, 2], ball.axis)
    x, y, z = ball.axis[0], ball.axis[1], ball.axis[2]
    leaning = sqrt(x * x + y * y)
    way = ball.radius
    if leaning > 1e-12:
        way = ball.radius * atan2(leaning, z) / leaning
    middle[ball.foot, 0] -= way * x
    middle[ball.foot, 1] -= way * y


@kernel
def points_missing(foot_of_point: Indices1D, touched: Flags1D, feet: int) -> int:
    """The number of further points that must carry load for every sole to be flat.

    A point or line foot needs all of its points, a foot with more points needs three.
    """
    missing = 0
    for foot in range(feet):
        loaded = 0
        for point in range(foot_of_point.shape[0]):
            if foot_of_point[point] == foot and touched[point]:
                loaded += 1
        missing += max(0, min(points_of(foot_of_point, foot), PLANE) - loaded)
    return missing


@kernel
def least_load(foot_of_point: Indices1D, force: Array2D, feet: int, weight: float) -> float:
    """The least loaded foot's share of the ``weight`` [N]; ``force`` on each point [N, world]."""
    least = 0.0
    for foot in range(feet):
        load = 0.0
        for point in range(foot_of_point.shape[0]):
            if foot_of_point[point] == foot:
                load += force[point, 2]
        if foot == 0 or load < least:
            least = load
    return least / weight
