"""Positions and velocities of the contact points relative to the base, from the tree of a robot's bodies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..mathematics.arrays import (
    Array,
    Array1D,
    Array2D,
    Array3D,
    Indices1D,
    Matrix3,
    Rows3,
    Vector3,
)
from ..mathematics.body_dynamics import (
    BodyMotion,
    BodyTree,
    body_motion,
    move_bodies,
    point_position,
    set_body_poses,
    velocity_at,
)
from ..mathematics.kernel import kernel
from ..mathematics.rotations import rotate_back
from .kinematics import ball_feet, body_tree, contact_centres, link_poses_in_base
from .robot_description import RobotDescription


class ContactGeometry(NamedTuple):
    """The feet and the round rubber of their contact points.

    ``body`` and ``sole`` (n_feet, 3) are a foot's body and the centre of its sole [m, body]; ``ball``
    (n_feet,) is the contact point of a foot that is a ball, and -1 of others. ``foot``, ``centre``
    (n_contacts, 3) [m, body] and ``radius`` (n_contacts,) [m] are a contact's. ``pattern``
    (2, n_contacts) gives the direction ahead of a robot all of whose feet are balls, ``patterned``.
    """

    body: Indices1D
    sole: Rows3
    ball: Indices1D
    foot: Indices1D
    centre: Rows3
    radius: Array1D
    pattern: Array2D
    patterned: bool


class ContactMotion(NamedTuple):
    """Results of ``contact_motion``: see the attributes of ``ContactKinematics``."""

    points: Rows3
    rates: Rows3
    soles: Rows3
    forward: Vector3
    com_velocity: Vector3


class RigidBodies(NamedTuple):
    """The robot's bodies, their motion while the base only turns, and scratch: three places (3, 3)."""

    tree: BodyTree
    motion: BodyMotion
    scratch: Matrix3


@kernel
def contact_motion(
    bodies: RigidBodies,
    contacts: ContactGeometry,
    orientation: Array1D,
    angular_velocity: Vector3,
    position: Array1D,
    velocity: Array1D,
    out: ContactMotion,
) -> None:
    """Compute the motion of the contact points relative to the base, which is held in place but turns.

    Args:
        orientation: the base's quaternion, which gives the vertical.
        angular_velocity: of the base [rad/s, body].
        position, velocity: of the joints [rad, rad/s], (n_joints,).
    """
    tree, motion, down, arm = bodies.tree, bodies.motion, bodies.scratch[0], bodies.scratch[1]
    motion.velocity[0, 3:6] = angular_velocity
    down[:] = 0.0
    set_body_poses(tree, position, motion)
    move_bodies(tree, velocity, motion)
    down[2] = -1.0
    rotate_back(orientation, down, down)
    for i in range(contacts.foot.shape[0]):
        body = contacts.body[contacts.foot[i]]
        point = out.points[i]
        point_position(motion, body, contacts.centre[i], point)
        point[:] = point + contacts.radius[i] * down
        velocity_at(motion, body, point, out.rates[i])
    out.forward[:] = 0.0
    for foot in range(contacts.body.shape[0]):
        body, ball = contacts.body[foot], contacts.ball[foot]
        point_position(motion, body, contacts.sole[foot], out.soles[foot])
        for k in range(3):
            out.forward[k] = out.forward[k] + motion.rotation[body, k, 0]
            if ball >= 0:
                out.soles[foot, k] = out.points[ball, k]
    if contacts.patterned:
        pattern_direction(contacts.pattern, out.points, down, arm, out.forward)
    relative_com_velocity(bodies, out.com_velocity)


@kernel
def pattern_direction(
    pattern: Array2D, points: Rows3, down: Vector3, aside: Vector3, forward: Vector3
) -> None:
    """Compute the direction ahead (3,) from the places of the points: see ``_pattern``.

    Args:
        down: the direction of gravity [body], (3,).
        aside: scratch (3,).
    """
    for k in range(3):
        forward[k] = aside[k] = 0.0
        for i in range(points.shape[0]):
            forward[k] = forward[k] + pattern[0, i] * points[i, k]
            aside[k] = aside[k] + pattern[1, i] * points[i, k]
    x, y, z = aside[0], aside[1], aside[2]
    u, v, w = down[0], down[1], down[2]
    forward[0] = forward[0] + (v * z - w * y)
    forward[1] = forward[1] + (w * x - u * z)
    forward[2] = forward[2] + (u * y - v * x)


@kernel
def relative_com_velocity(bodies: RigidBodies, out: Vector3) -> None:
    """Compute the velocity (3,) of the centre of mass relative to the base's origin [m/s, body]."""
    tree, motion, place, velocity = bodies.tree, bodies.motion, bodies.scratch[1], bodies.scratch[2]
    total = 0.0
    out[0] = out[1] = out[2] = 0.0
    for body in range(tree.mass.shape[0]):
        mass = tree.mass[body]
        point_position(motion, body, tree.com[body], place)
        velocity_at(motion, body, place, velocity)
        total += mass
        out[:] = out + mass * velocity
    out[:] = out / total


@kernel
def differentiate_contacts(
    bodies: RigidBodies, contacts: ContactGeometry, centres: Array2D, jacobians: Array3D
) -> None:
    """Compute the centres of the contacts' rubber (n_contacts, 3) [m, body], and their Jacobians by the joints
    (n_contacts, 3, n_joints), with the bodies where ``contact_motion`` has left them.
    """
    for i in range(contacts.foot.shape[0]):
        body = contacts.body[contacts.foot[i]]
        centre, jacobian = centres[i], jacobians[i]
        point_position(bodies.motion, body, contacts.centre[i], centre)
        for k in range(jacobian.shape[1]):
            jacobian[0, k] = jacobian[1, k] = jacobian[2, k] = 0.0
        x, y, z = centre[0], centre[1], centre[2]
        while body > 0:
            joint = bodies.motion.joint[body - 1]
            u, v, w = joint[3], joint[4], joint[5]
            jacobian[0, body - 1] = joint[0] + (v * z - w * y)
            jacobian[1, body - 1] = joint[1] + (w * x - u * z)
            jacobian[2, body - 1] = joint[2] + (u * y - v * x)
            body = bodies.tree.parent[body - 1]


class ContactKinematics:
    """The robot with its base held in place but turning.

    The rubber of a contact point is round: what touches the ground is its lowest point, however
    the foot is turned, and that part of the foot is what stands still while the foot rolls.

    Attributes:
        points: the lowest point of each contact [m, body], (n_contacts, 3).
        rates: their velocities with the joints' and the base's turning [m/s, body].
        soles: the sole centres [m, body], (n_feet, 3).
        forward: the sum of the feet's forward directions [body], (3,); of feet that are balls
            the direction in which their pattern points, x where they stand as in the standing pose.
        com_velocity: of the centre of mass relative to the base's origin [m/s, body], (3,).
        centres: the centres of the contacts' round rubber [m, body], (n_contacts, 3).
        jacobians: of the centres by the joints [m, body], (n_contacts, 3, n_joints).
        heading_levers: horizontal positions of the contact points relative to a middle, which
            rotate with the feet's heading [m], (n_contacts, 2): the middle of each foot, or of the
            pattern that feet of one point make. They are constant, and zero where the points have
            no heading.

    ``centres`` and ``jacobians`` are updated by ``differentiate`` only. A kernel that calls
    ``contact_motion`` itself takes ``bodies``, ``contacts`` and ``motion``.
    """

    def __init__(self, robot: RobotDescription) -> None:
        n_joints, n_contacts = len(robot.joints), len(robot.contacts)
        owners, balls = robot.foot_of_contact(), ball_feet(robot)
        bodies = {robot.base: 0} | {joint.child: k + 1 for k, joint in enumerate(robot.joints)}
        ball_of_foot = {ball.foot: ball.point for ball in balls}
        self._foot_of_point, self._centres = owners, list(contact_centres(robot))
        self._pattern = _pattern(robot) if len(balls) == len(robot.feet) > 1 else None
        self.bodies = RigidBodies(body_tree(robot), body_motion(n_joints), np.zeros((3, 3)))
        self.contacts = ContactGeometry(
            np.array([bodies[foot.link] for foot in robot.feet], dtype=np.int64),
            np.array([foot.sole for foot in robot.feet], dtype=np.float64).reshape(-1, 3),
            np.array([ball_of_foot.get(k, -1) for k in range(len(robot.feet))], dtype=np.int64),
            np.array(owners, dtype=np.int64),
            contact_centres(robot),
            np.array([contact.radius for contact in robot.contacts], dtype=np.float64),
            np.zeros((2, n_contacts)) if self._pattern is None else self._pattern,
            self._pattern is not None,
        )
        self.points, self.rates = np.zeros((n_contacts, 3)), np.zeros((n_contacts, 3))
        self.soles = np.zeros((len(robot.feet), 3))
        self.forward, self.com_velocity = np.zeros(3), np.zeros(3)
        self.motion = ContactMotion(
            self.points, self.rates, self.soles, self.forward, self.com_velocity
        )
        self.centres = np.zeros((n_contacts, 3))
        self.jacobians = np.zeros((n_contacts, 3, n_joints))
        self.heading_levers = self._find_heading_levers()

    def _find_heading_levers(self) -> Array:
        levers = np.zeros((len(self._centres), 2))
        if self._pattern is not None:
            levers[...] = self._pattern.T
            return levers
        for point, foot in enumerate(self._foot_of_point):
            ahead = [
                float(centre[0])
                for centre, other in zip(self._centres, self._foot_of_point, strict=True)
                if other == foot
            ]
            levers[point, 0] = float(self._centres[point][0]) - sum(ahead) / len(ahead)
        return levers

    def evaluate(
        self, orientation: Array, angular_velocity: Array, position: Array, velocity: Array
    ) -> None:
        """Update all attributes but ``centres`` and ``jacobians``.

        Args:
            orientation: the base's quaternion x, y, z, w, which gives the vertical.
            angular_velocity: of the base [rad/s, body], (3,).
            position, velocity: of the joints [rad, rad/s], (n_joints,).
        """
        contact_motion(
            self.bodies,
            self.contacts,
            orientation,
            angular_velocity,
            position,
            velocity,
            self.motion,
        )

    def differentiate(self) -> None:
        """Update ``centres`` and ``jacobians`` for the joints of the last ``evaluate``.

        The centre of the rubber is its radius above the ground, whatever the base's orientation.
        """
        differentiate_contacts(self.bodies, self.contacts, self.centres, self.jacobians)


def _pattern(robot: RobotDescription) -> Array:
    """Return the distances of the contact points ahead and to the left of their middle in the standing pose [m], (2,
    n_contacts).

    Where the points p_i stand so, turned by a heading, the sum over x_i p_i + y_i (p_i x up)
    points ahead, as far as the pattern is symmetric.
    """
    poses = link_poses_in_base(robot, robot.standing_position)
    places = np.zeros((len(robot.contacts), 3))
    for ball in ball_feet(robot):
        turn, place = poses[robot.feet[ball.foot].link]
        places[ball.point] = place + turn @ ball.centre
    return np.ascontiguousarray((places - places.mean(axis=0))[:, :2].T)
