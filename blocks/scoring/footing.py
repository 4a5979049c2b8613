"""The feet of a robot of any kind: the quantities that the scores measure on them."""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array1D, Array2D, Array3D, Flags1D, Indices1D, Indices2D, Vector3
from ...mathematics.elementary import sincos
from ...mathematics.kernel import kernel
from ...mathematics.rotations import rotate, yaw
from ...robots.description import RobotDescription
from ...robots.kinematics import ball_feet, fall_height
from ...robots.limb import read_limb, set_limb_pose

LOAD_SHARE = 0.4
"""Least load of a foot at rest, as a share of its load when all feet carry the same."""
PLANE = 3
"""The number of loaded points by which a sole with at least as many is flat on the ground."""


class BallFeet(NamedTuple):
    """The n feet that are balls, and what their positions are computed with.

    Attributes:
        foot, radius, size: of each its index, its radius [m], and the number of joints of the limb that
            it ends, (n,) each; a limb has at most m joints.
        joints, links, tip: of each limb as ``Limb`` has them, (n, m), (n, m, 7), (n, 7).
        angles, anchors, pose, axis: memory for the joints of a limb (m,) and (m, 6), for the pose of the
            foot (4, 3) and for one of its axes in the world (3,).
    """

    foot: Indices1D
    radius: Array1D
    size: Indices1D
    joints: Indices2D
    links: Array3D
    tip: Array2D
    angles: Array1D
    anchors: Array2D
    pose: Array2D
    axis: Array1D


class Footing:
    """A robot's feet and contact points, and its weight.

    Attributes:
        foot_of_point: for every contact point the index of its foot, (n_contacts,).
        weight: of the robot [N].
        fall_height: by default a base lower above the ground than this has fallen [m].
    """

    def __init__(self, robot: RobotDescription) -> None:
        self.foot_of_point = np.array(robot.foot_of_contact(), np.int64)
        self.weight = robot.weight
        self.fall_height = fall_height(robot)
        self._robot = robot

    @property
    def load_share(self) -> float:
        """The default of the least share of the weight on each foot at rest."""
        return LOAD_SHARE / len(self._robot.feet)

    def ball_feet(self) -> BallFeet:
        """Return the feet that are balls."""
        balls = ball_feet(self._robot)
        limbs = [read_limb(self._robot, ball.foot) for ball in balls]
        n, m = len(balls), max((len(limb.joints) for limb in limbs), default=0)
        feet = BallFeet(
            np.array([ball.foot for ball in balls], np.int64),
            np.array([ball.radius for ball in balls], np.float64),
            np.array([len(limb.joints) for limb in limbs], np.int64),
            np.zeros((n, m), np.int64), np.zeros((n, m, 7)), np.zeros((n, 7)),
            np.zeros(m), np.zeros((m, 6)), np.zeros((4, 3)), np.zeros(3),
        )  # fmt: skip
        for k, limb in enumerate(limbs):
            size = len(limb.joints)
            feet.joints[k, :size], feet.links[k, :size], feet.tip[k] = (
                limb.joints, limb.links, limb.tip,
            )  # fmt: skip
        return feet


@kernel
def points_of(foot_of_point: Indices1D, foot: int) -> int:
    """Count the contact points of a foot."""
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
            direction[foot, 1], direction[foot, 0] = sincos(heading)
            continue
        for axis in range(2):
            total = 0.0
            for other in range(feet):
                total += middle[other, axis]
            direction[foot, axis] = middle[foot, axis] - total / feet


@kernel
def add_roll(
    balls: BallFeet, joints: Array1D, orientation: Array1D, turned: Array3D, rolled: Array2D
) -> None:
    """Add to ``rolled`` how far ball feet have rolled since the last call.

    A ball of radius r that turns by the small rotation d rolls by r d x z. What turns it about the vertical
    moves it nowhere, so the way follows from all of its rotation and not from how its foot leans in the end.

    Args:
        joints: positions of the joints [rad or m], (n_joints,).
        orientation: of the base, quaternion x, y, z, w.
        turned: the axes of every foot in the world at the last call, one a row, (n_feet, 3, 3); zero before
            the first. They become those of now.
        rolled: the way of every foot [m], (n_feet, 2).
    """
    for ball in range(balls.foot.shape[0]):
        size, foot = balls.size[ball], balls.foot[ball]
        for k in range(size):
            balls.angles[k] = joints[balls.joints[ball, k]]
        links, tip = balls.links[ball, :size], balls.tip[ball]
        set_limb_pose(links, tip, balls.angles, balls.anchors, balls.pose)
        radius = 0.5 * balls.radius[ball]  # a rotation is half the sum of old x new axis
        for k in range(3):
            old, new = turned[foot, k], balls.axis
            rotate(orientation, balls.pose[1:, k], new)
            rolled[foot, 0] += radius * (old[2] * new[0] - old[0] * new[2])
            rolled[foot, 1] += radius * (old[2] * new[1] - old[1] * new[2])
            turned[foot, k, :] = new


@kernel
def points_missing(foot_of_point: Indices1D, touched: Flags1D, feet: int) -> int:
    """Count the further points that must carry load for every sole to be flat.

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
    """Return the least loaded foot's share of the ``weight`` [N]; ``force`` on each point [N, world]."""
    least = 0.0
    for foot in range(feet):
        load = 0.0
        for point in range(foot_of_point.shape[0]):
            if foot_of_point[point] == foot:
                load += force[point, 2]
        if foot == 0 or load < least:
            least = load
    return least / weight


@kernel
def any_loaded(touched: Flags1D) -> bool:
    """Check whether any contact point carries load."""
    found = False
    for point in range(touched.shape[0]):
        found = found or bool(touched[point])
    return found


@kernel
def magnitude(vector: Vector3) -> float:
    """Return the Euclidean norm of a vector."""
    return sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
