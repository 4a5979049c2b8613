"""The whole-body model at the present state, evaluated once a tick for all controllers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Array2D,
    Array3D,
    Indices1D,
    Matrix3,
    Rows3,
    Vector3,
)
from ...mathematics.body_dynamics import (
    BodyMotion,
    BodyTree,
    Inertias,
    MotionTerms,
    acceleration_at,
    body_motion,
    equations_of_motion,
    inertias,
    move_bodies,
    place_bodies,
    place_of,
    velocity_at,
)
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...mathematics.rotations import normalise, rotate_back, to_matrix
from ...robots.kinematics import ball_feet, body_tree
from ...runtime.language.block import Input, Output
from ...runtime.language.kernel_block import KernelBlock
from ..signals import BaseState, DynamicsTerms, JointState, MassEstimate

LEAST_SCALE, LEAST_OFFSET = 1e-4, 2e-5
"""The steps in which the model's mass (as a share) and its torso's CoM [m] change."""


class Dynamics(KernelBlock):
    """Inertia, contact Jacobians, momentum and their drifts (paper, II-B and V).

    With generalised velocity v (base linear and angular in the body frame, then joints), contact
    points p_c and momentum h = (l, k) about the centre of mass::

        M(q) v' + n(q, v) = S' tau + sum_c J_c' f_c        mass_matrix, nonlinear_effects
        p_c' = J_c v,   p_c'' = J_c v' + contact_drift     classical, not spatial, acceleration
        h = A(q) v,     h' = A v' + centroidal_drift

    The rotors turn with the joints, so M contains their inertia B' I B, with the coupling of
    differential hips and shared knee motors (B: joint to motor velocities). The gearbox counts a
    rotor's inertia with the square of its ratio in M, but only once in the momentum, so A leaves
    the rotors out. Friction is in none of the terms.

    A foot with one contact point is a ball that rolls: its contact point, and its sole, are the
    ball's lowest point whatever the foot's orientation. While the ball rolls the material at that
    point is at rest; its velocity is that of the centre plus that due to the ball's rotation.
    Contact points of other feet are fixed to the foot.

    With ``mass`` wired, the model has the mass and the torso's centre of mass that are given there:
    all masses and inertias scale alike, and the inertia of the torso about its own centre of mass
    stays. Without it, or where the mass is zero, they are the description's.

    The block does not filter or estimate anything, and knows no ground: contact points are points
    of the feet, loaded or not.
    """

    needs = ("floating base",)

    base = Input(BaseState, text="pose and velocity of the base")
    joints = Input(JointState, text="joint angles and velocities")
    mass = Input(MassEstimate, default={}, text="the robot's mass and its torso's centre of mass")
    terms = Output(DynamicsTerms, text="the model's terms")

    def setup(self) -> None:
        robot, base, joints, mass, terms = (
            self.robot, self.base, self.joints, self.mass, self.terms,
        )  # fmt: skip
        n_joints = len(robot.joints)
        tree = body_tree(robot)
        bodies = {joint.child: k + 1 for k, joint in enumerate(robot.joints)} | {robot.base: 0}
        balls = {ball.point: ball for ball in ball_feet(robot)}
        owners = robot.foot_of_contact()
        feet = Feet(
            np.array([bodies[foot.link] for foot in robot.feet], dtype=np.int64),
            np.array([foot.sole for foot in robot.feet], dtype=np.float64).reshape(-1, 3),
            np.array(owners, dtype=np.int64),
            np.array([contact.position for contact in robot.contacts]).reshape(-1, 3),
            np.array([balls[k].radius if k in balls else -1.0 for k in range(len(owners))]),
            np.array(
                [balls[k].centre if k in balls else np.zeros(3) for k in range(len(owners))]
            ).reshape(-1, 3),
        )
        evaluation = KernelCall(
            evaluate,
            BaseAndJoints(
                base.position, base.orientation, base.linear_velocity, base.angular_velocity,
                joints.position, joints.velocity,
            ),
            Weighing(
                mass.mass, mass.com_offset, robot.total_mass, tree.com[0].copy(), np.zeros(3)
            ),
            tree,
            Scratch(body_motion(n_joints), inertias(n_joints), np.zeros(4), np.zeros((3, 3))),
            np.ascontiguousarray(robot.rotor_matrix),
            feet,
            MotionTerms(*(getattr(terms, name) for name in MotionTerms._fields)),
            FootTerms(*(getattr(terms, name) for name in FootTerms._fields)),
        )  # fmt: skip
        self.kernel_calls = (evaluation,)


class BaseAndJoints(NamedTuple):
    """The pose and velocity of the base, as in ``BaseState``, and the joints' motion."""

    position: Vector3
    orientation: Array1D
    linear_velocity: Vector3
    angular_velocity: Vector3
    joint_position: Array1D
    joint_velocity: Array1D


class Weighing(NamedTuple):
    """The mass to use [kg], without a dimension (zero: the ``nominal`` one), and the offset of the
    torso's centre of mass from the ``described`` one [m], (3,); ``offset`` (3,) is scratch."""

    mass: Array0D
    com_offset: Vector3
    nominal: float
    described: Vector3
    offset: Vector3


class Feet(NamedTuple):
    """The feet and their contact points.

    ``body`` and ``sole`` (n_feet, 3) are a foot's body and the centre of its sole [m, body]; ``foot`` and
    ``point`` (n_contacts, 3) are a contact's foot and its place [m, body]. Where the foot is a ball,
    ``radius`` [m] is not negative, and ``centre`` (n_contacts, 3) [m, body] is the ball's.
    """

    body: Indices1D
    sole: Rows3
    foot: Indices1D
    point: Rows3
    radius: Array1D
    centre: Rows3


class Scratch(NamedTuple):
    """Memory: the bodies' motion and inertias, a unit quaternion, and three places (3, 3)."""

    motion: BodyMotion
    inertias: Inertias
    orientation: Array1D
    places: Matrix3


class FootTerms(NamedTuple):
    """The fields of ``DynamicsTerms`` that the kernel of the feet writes."""

    velocity: Array1D
    base_position: Vector3
    base_rotation: Matrix3
    foot_position: Rows3
    foot_rotation: Array3D
    contact_position: Rows3
    contact_velocity: Rows3
    contact_jacobian: Array3D
    contact_drift: Rows3


@kernel
def weigh_torso(weighing: Weighing, tree: BodyTree) -> float:
    """Put the centre of mass of the torso where it is now; returns the factor on all masses.

    In small steps, so that the model is a function of the input and rarely changes. All masses scale
    alike, so the terms do; rotors do not.
    """
    offset, mass = weighing.offset, float(weighing.mass[()])
    np.divide(weighing.com_offset, LEAST_OFFSET, offset)
    np.rint(offset, offset)
    tree.com[0, :] = weighing.described + offset * LEAST_OFFSET
    if mass > 0.0:
        return round(mass / weighing.nominal / LEAST_SCALE) * LEAST_SCALE
    return 1.0


@kernel
def set_state(state: BaseAndJoints, scratch: Scratch, terms: FootTerms) -> None:
    """Give the base its rotation and velocity, and write the generalised velocity."""
    motion, v, orientation = scratch.motion, terms.velocity, scratch.orientation
    normalise(state.orientation, orientation)
    to_matrix(orientation, terms.base_rotation)
    rotate_back(orientation, state.linear_velocity, v[0:3])
    for row in range(3):
        v[3 + row] = state.angular_velocity[row]
        motion.velocity[0, row] = state.linear_velocity[row]
        spin = 0.0
        for column in range(3):
            turn = terms.base_rotation[row, column]
            motion.rotation[0, row, column] = turn
            spin += turn * state.angular_velocity[column]
        motion.velocity[0, 3 + row] = spin
        terms.base_position[row] = state.position[row]
    for k in range(state.joint_velocity.shape[0]):
        v[6 + k] = state.joint_velocity[k]


@kernel
def write_jacobian(
    tree: BodyTree, motion: BodyMotion, body: int, place: Vector3, out: Array2D
) -> None:
    """The Jacobian (3, n_velocities) of a body's point: v + w x r of every generalised velocity."""
    for row in range(3):
        out[row, :] = 0.0
    x, y, z = place[0], place[1], place[2]
    for k in range(3):
        a, b, c = (
            motion.rotation[0, 0, k],
            motion.rotation[0, 1, k],
            motion.rotation[0, 2, k],
        )
        out[0, k], out[1, k], out[2, k] = a, b, c
        out[0, 3 + k], out[1, 3 + k], out[2, 3 + k] = b * z - c * y, c * x - a * z, a * y - b * x
    while body > 0:
        joint = motion.joint[body - 1]
        a, b, c = joint[3], joint[4], joint[5]
        out[0, 5 + body] = joint[0] + (b * z - c * y)
        out[1, 5 + body] = joint[1] + (c * x - a * z)
        out[2, 5 + body] = joint[2] + (a * y - b * x)
        body = tree.parent[body - 1]


@kernel
def lowest_point(centre: Vector3, radius: float, rotation: Matrix3, out: Vector3) -> None:
    """The lowest point (3,) of a ball, in the frame of the body it belongs to.

    Args:
        centre: of the ball [m, body].
        radius: of the ball [m].
        rotation: from the body to the world, (3, 3).
    """
    out[:] = centre - radius * rotation[2]


@kernel
def rolling_drift(
    motion: BodyMotion, body: int, centre: Array1D, lowest: Array1D, out: Array1D
) -> None:
    """The rate of change (3,) of the velocity of a ball's lowest point, while v' = 0.

    The lowest point consists of other material at every instant. So its velocity
    v_c + w x (lowest - centre) has the derivative a_c + w' x (lowest - centre), without the
    centripetal acceleration that a fixed point of the material has.

    Args:
        centre, lowest: the places of the ball's centre and of its lowest point [m], (3,).
    """
    acceleration_at(motion, body, centre, out)
    x = lowest[0] - centre[0]
    y = lowest[1] - centre[1]
    z = lowest[2] - centre[2]
    spatial = motion.acceleration[body]
    a, b, c = spatial[3], spatial[4], spatial[5]
    out[0] = out[0] + (b * z - c * y)
    out[1] = out[1] + (c * x - a * z)
    out[2] = out[2] + (a * y - b * x)


@kernel
def write_contacts(tree: BodyTree, scratch: Scratch, feet: Feet, terms: FootTerms) -> None:
    """Where the contact points are, how they move, and their Jacobians and drifts."""
    motion, place, centre = scratch.motion, scratch.places[0], scratch.places[1]
    for point in range(feet.foot.shape[0]):
        foot = feet.foot[point]
        body = feet.body[foot]
        if feet.radius[point] >= 0.0:
            lowest_point(
                feet.centre[point], feet.radius[point], motion.rotation[body],
                feet.point[point],
            )  # fmt: skip
            feet.sole[foot, :] = feet.point[point]
        place_of(motion, body, feet.point[point], place)
        velocity_at(motion, body, place, terms.contact_velocity[point])
        acceleration_at(motion, body, place, terms.contact_drift[point])
        if feet.radius[point] >= 0.0:
            place_of(motion, body, feet.centre[point], centre)
            rolling_drift(motion, body, centre, place, terms.contact_drift[point])
        write_jacobian(tree, motion, body, place, terms.contact_jacobian[point])
        terms.contact_position[point, :] = terms.base_position + place


@kernel
def evaluate(
    state: BaseAndJoints,
    weighing: Weighing,
    tree: BodyTree,
    scratch: Scratch,
    rotors: Array2D,
    feet: Feet,
    terms: MotionTerms,
    foot_terms: FootTerms,
) -> None:
    """All terms of the model at a state. ``rotors`` are the rotors' part of the mass matrix."""
    motion, place = scratch.motion, scratch.places[0]
    scale = weigh_torso(weighing, tree)
    set_state(state, scratch, foot_terms)
    place_bodies(tree, state.joint_position, motion)
    move_bodies(tree, state.joint_velocity, motion)
    equations_of_motion(tree, motion, scratch.inertias, rotors, scale, foot_terms.velocity, terms)
    write_contacts(tree, scratch, feet, foot_terms)
    for foot in range(feet.body.shape[0]):
        body = feet.body[foot]
        place_of(motion, body, feet.sole[foot], place)
        for row in range(3):
            foot_terms.foot_position[foot, row] = state.position[row] + place[row]
            for column in range(3):
                turn = motion.rotation[body, row, column]
                foot_terms.foot_rotation[foot, row, column] = turn
    terms.com[:] = terms.com + state.position
