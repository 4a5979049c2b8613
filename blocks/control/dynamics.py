"""The equations of motion, evaluated once a tick for all controllers, and the torques against gravity."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...mathematics.arrays import Array1D, Array2D, Matrix3, Vector3
from ...mathematics.body_dynamics import (
    BodyMotion,
    BodyTree,
    Inertias,
    acceleration_at,
    body_motion,
    composite_inertias,
    inertias,
    inner,
    momentum_of,
    move_bodies,
    point_jacobian,
    point_position,
    set_body_poses,
    velocity_at,
)
from ...mathematics.compiling.expressions import cross
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.rotations import normalise, rotate_back, to_matrix
from ...robots.kinematics import ball_feet, body_tree
from ...robots.pinocchio_model import build_pinocchio_model
from ...runtime.language.block import Block, Context, Input, Output, UnmetRequirement
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.per_joint import PerJoint
from ...runtime.language.signals import Field, Signal
from ..signals import BaseState, DynamicsTerms, JointState, JointTorque, MassEstimate

LEAST_SCALE, LEAST_OFFSET = 1e-4, 2e-5
"""The steps in which the model's mass (as a share) and its torso's CoM [m] change."""


class DynamicsParameters(Parameters):
    """The parameters of ``Dynamics``."""

    rotor_inertia: PerJoint = parameter(
        PerJoint(1.0), ge=0.0,
        text="factor on the rotor inertia of each motor, by the name of its joint",
    )  # fmt: skip


class DynamicsConstants(Signal):
    """The robot's feet, rotors and mass."""

    foot_body = Field("n_feet", dtype="int64", text="the body of each foot")
    sole = Field(("n_feet", 3), unit="m", text="centre of its sole, in the foot's frame")
    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    point = Field(("n_contacts", 3), unit="m", text="the contact point in its foot's frame")
    radius = Field("n_contacts", unit="m", text="of a foot that is a ball; -1 of others")
    centre = Field(("n_contacts", 3), unit="m", text="the ball's centre in its foot's frame")
    rotors = Field(("n_joints", "n_joints"), text="the rotors' part of the mass matrix")
    mass = Field(unit="kg", text="the mass by the description")
    torso_com = Field(3, unit="m", frame="body", text="the torso's centre of mass by it")


class DynamicsScratch(Signal):
    """Scratch memory of one step of ``Dynamics``."""

    orientation = Field(4, text="unit quaternion of the base")
    offset = Field(3, text="of the torso's centre of mass, in least steps")
    point = Field(3, unit="m", text="a contact point in its foot's frame")
    sole = Field(("n_feet", 3), unit="m", text="centres of the soles in their frames")
    place = Field(3, unit="m", frame="world", text="a point relative to the base")
    centre = Field(3, unit="m", frame="world", text="a ball's centre relative to the base")


class Dynamics(Block):
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

    Params = DynamicsParameters
    Constants = DynamicsConstants
    Scratch = DynamicsScratch
    needs = ("floating base",)
    params: DynamicsParameters
    constants: DynamicsConstants

    base = Input(BaseState, text="pose and velocity of the base")
    joints = Input(JointState, text="joint angles and velocities")
    mass = Input(MassEstimate, default={}, text="the robot's mass and its torso's centre of mass")
    terms = Output(DynamicsTerms, text="the model's terms")

    def setup(self) -> None:
        robot, constants = self.robot, self.constants
        self.tree, n_joints = body_tree(robot), len(robot.joints)
        self.motion, self.inertias = body_motion(n_joints), inertias(n_joints)
        bodies = {joint.child: k + 1 for k, joint in enumerate(robot.joints)} | {robot.base: 0}
        for number, foot in enumerate(robot.feet):
            constants.foot_body[number], constants.sole[number] = bodies[foot.link], foot.sole
        constants.foot_of_point[:] = robot.foot_of_contact()
        constants.radius[:] = -1.0
        for k, contact in enumerate(robot.contacts):
            constants.point[k] = contact.position
        for ball in ball_feet(robot):
            constants.radius[ball.point], constants.centre[ball.point] = ball.radius, ball.centre
        constants.rotors[:] = robot.rotor_matrix_of(self.params.rotor_inertia.resolve(robot))
        constants.mass, constants.torso_com[:] = robot.total_mass, self.tree.com[0]

    @kernel
    @staticmethod
    def step(
        base: BaseState,
        joints: JointState,
        mass: MassEstimate,
        terms: DynamicsTerms,
        tree: BodyTree,
        motion: BodyMotion,
        inertias: Inertias,
        constants: DynamicsConstants,
        scratch: DynamicsScratch,
    ) -> None:
        scale = apply_payload(mass, tree, constants, scratch)
        set_base(base, joints, terms, motion, scratch)
        set_body_poses(tree, joints.position, motion)
        move_bodies(tree, joints.velocity, motion)
        equations_of_motion(tree, motion, inertias, constants.rotors, scale, terms)
        write_contacts(tree, motion, terms, constants, scratch)
        write_soles(motion, terms, constants, scratch)
        terms.com[:] = terms.com + base.position


class GravityCompensation(Block):
    """The joint torques g(q) that balance gravity at the measured joint positions, by Pinocchio.

    With these torques alone a robot at rest stays at rest. For a slide the torque is the force
    along its axis. It is computed also for joints without a motor, whose drives cannot produce it.
    The block compensates neither friction nor a load that the robot carries; add a load as a link
    to the robot's description.

    It needs a fixed base: the torques that hold up a robot with a floating base depend on its
    contacts, and the whole-body controller computes them.
    """

    needs = ("robot",)

    joints = Input(JointState, text="measured joint positions")
    torque = Output(JointTorque, text="torques that hold the robot still")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a base that is not fixed."""
        robot = context.robot
        if robot is not None and robot.base_joint != "fixed":
            yield UnmetRequirement(
                f"it needs a robot on a fixed base; {robot.name} has a {robot.base_joint} one",
                fix="use: blocks.WholeBodyController",
            )

    def setup(self) -> None:
        """Build the model."""
        import pinocchio

        self._model: Any = build_pinocchio_model(self.robot).model
        self._data: Any = self._model.createData()
        self._evaluate: Any = pinocchio.computeAllTerms
        self._position = np.array(pinocchio.neutral(self._model))
        self._still = np.zeros(self._model.nv)
        self._gravity = self._data.nle  # Pinocchio's own memory, written in every evaluation

    def step(self) -> None:
        """Evaluate the model at rest in the measured position."""
        self._position[:] = self.joints.position
        # The function for gravity alone returns it as a new array.
        self._evaluate(self._model, self._data, self._position, self._still)
        self.torque.torque[:] = self._gravity


# The state


@kernel
def apply_payload(
    mass: MassEstimate, tree: BodyTree, constants: DynamicsConstants, scratch: DynamicsScratch
) -> float:
    """Move the torso's centre of mass by the estimated offset; returns the factor on all masses.

    In small steps, so that the model is a function of the input and rarely changes. All masses scale
    alike, so the terms do; rotors do not.
    """
    np.divide(mass.com_offset, LEAST_OFFSET, scratch.offset)
    np.rint(scratch.offset, scratch.offset)
    tree.com[0, :] = constants.torso_com + scratch.offset * LEAST_OFFSET
    if mass.mass > 0.0:
        return float(round(mass.mass / constants.mass / LEAST_SCALE) * LEAST_SCALE)
    return 1.0


@kernel
def set_base(
    base: BaseState,
    joints: JointState,
    terms: DynamicsTerms,
    motion: BodyMotion,
    scratch: DynamicsScratch,
) -> None:
    """Give the base its rotation and velocity, and write the generalised velocity."""
    v, orientation = terms.velocity, scratch.orientation
    normalise(base.orientation, orientation)
    to_matrix(orientation, terms.base_rotation)
    rotate_back(orientation, base.linear_velocity, v[0:3])
    v[3:6] = base.angular_velocity
    v[6 : v.shape[0]] = joints.velocity
    terms.base_position[:] = base.position
    motion.rotation[0, :, :] = terms.base_rotation
    motion.velocity[0, 0:3] = base.linear_velocity
    motion.velocity[0, 3:6] = terms.base_rotation @ base.angular_velocity


# The equations of motion


@kernel
def write_column(
    column: int,
    spatial: Array1D,
    com: Vector3,
    rotation: Matrix3,
    scale: float,
    terms: DynamicsTerms,
) -> None:
    """Write one column of the mass matrix's base rows and of the centroidal matrix.

    Args:
        spatial: the robot's spatial momentum per unit of that generalised velocity, (6,).
        com: the place of the centre of mass, (3,).
        rotation: of the base, (3, 3).
    """
    a, b, c = spatial[0] * scale, spatial[1] * scale, spatial[2] * scale
    p, q, r = spatial[3] * scale, spatial[4] * scale, spatial[5] * scale
    x, y, z = com[0], com[1], com[2]
    centroidal = terms.centroidal_matrix
    centroidal[0, column], centroidal[1, column], centroidal[2, column] = a, b, c
    centroidal[3, column] = p - (y * c - z * b)
    centroidal[4, column] = q - (z * a - x * c)
    centroidal[5, column] = r - (x * b - y * a)
    for k in range(3):
        u, v, w = rotation[0, k], rotation[1, k], rotation[2, k]
        linear, angular = u * a + v * b + w * c, u * p + v * q + w * r
        terms.mass_matrix[k, column] = terms.mass_matrix[column, k] = linear
        terms.mass_matrix[3 + k, column] = terms.mass_matrix[column, 3 + k] = angular


@kernel
def write_matrices(
    tree: BodyTree, motion: BodyMotion, composite: Inertias, rotors: Array2D, scale: float,
    terms: DynamicsTerms,
) -> None:  # fmt: skip
    """Write the mass matrix, with the inertia of the rotors, and the centroidal matrix.

    Args:
        rotors: the rotors' part of the mass matrix, in the joints' rows and columns.
        scale: the factor on all masses and inertias but the rotors'.
    """
    n, first = motion.joint.shape[0], 6
    rotation, spatial = motion.rotation[0], composite.spatial
    base = composite.turned[0]
    for k in range(3):
        for row in range(3):
            base[row] = rotation[row, k]
        a, b, c = base[0], base[1], base[2]
        moment, inertia = composite.moment[0], composite.inertia[0]
        x, y, z = moment[0], moment[1], moment[2]
        mass = composite.mass[0]
        spatial[0], spatial[1], spatial[2] = mass * a, mass * b, mass * c
        spatial[3], spatial[4], spatial[5] = y * c - z * b, z * a - x * c, x * b - y * a
        write_column(k, spatial, terms.com, rotation, scale, terms)
        spatial[0], spatial[1], spatial[2] = b * z - c * y, c * x - a * z, a * y - b * x
        xx, yy, zz = inertia[0], inertia[1], inertia[2]
        xy, xz, yz = inertia[3], inertia[4], inertia[5]
        spatial[3] = xx * a + xy * b + xz * c
        spatial[4] = xy * a + yy * b + yz * c
        spatial[5] = xz * a + yz * b + zz * c
        write_column(3 + k, spatial, terms.com, rotation, scale, terms)
    for i in range(n):
        for j in range(n):
            terms.mass_matrix[first + i, first + j] = rotors[i, j]
    for j in range(n):
        momentum_of(composite, j + 1, motion.joint[j], spatial)
        write_column(first + j, spatial, terms.com, rotation, scale, terms)
        i = j
        while i >= 0:
            shared = scale * inner(motion.joint[i], spatial)
            terms.mass_matrix[first + i, first + j] = rotors[i, j] + shared
            terms.mass_matrix[first + j, first + i] = rotors[j, i] + shared
            i = tree.parent[i] - 1


@kernel
def write_forces(
    motion: BodyMotion, composite: Inertias, scale: float, terms: DynamicsTerms
) -> None:
    """Bias forces, gravity included, the drift of the momentum, and the momentum itself."""
    rotation, spatial, force = motion.rotation[0], composite.spatial, composite.force[0]
    x, y, z = terms.com[0], terms.com[1], terms.com[2]
    a, b, c = force[0], force[1], force[2]
    drift = terms.centroidal_drift
    drift[0], drift[1], drift[2] = scale * a, scale * b, scale * c
    drift[3] = scale * (force[3] - (y * c - z * b))
    drift[4] = scale * (force[4] - (z * a - x * c))
    drift[5] = scale * (force[5] - (x * b - y * a))
    for body in range(motion.joint.shape[0] + 1):
        # Weight pulls down, so what carries it pushes up, at the centre of mass.
        moment, carried = composite.moment[body], composite.force[body]
        for k in range(6):
            spatial[k] = carried[k]
        spatial[2] = spatial[2] + GRAVITY * composite.mass[body]
        spatial[3] = spatial[3] + GRAVITY * moment[1]
        spatial[4] = spatial[4] - GRAVITY * moment[0]
        if body > 0:
            terms.nonlinear_effects[5 + body] = scale * inner(motion.joint[body - 1], spatial)
            continue
        for k in range(3):
            u, v, w = rotation[0, k], rotation[1, k], rotation[2, k]
            linear = u * spatial[0] + v * spatial[1] + w * spatial[2]
            angular = u * spatial[3] + v * spatial[4] + w * spatial[5]
            terms.nonlinear_effects[k] = scale * linear
            terms.nonlinear_effects[3 + k] = scale * angular


@kernel
def write_momentum(scale: float, mass: float, terms: DynamicsTerms) -> None:
    """Write the momentum about the centre of mass, and its velocity, from the centroidal matrix.

    Args:
        scale, mass: the factor on all masses, and their sum without it [kg].
    """
    for k in range(3):
        linear, angular = 0.0, 0.0
        for j in range(terms.velocity.shape[0]):
            linear += terms.centroidal_matrix[k, j] * terms.velocity[j]
            angular += terms.centroidal_matrix[3 + k, j] * terms.velocity[j]
        terms.linear_momentum[k], terms.angular_momentum[k] = linear, angular
        terms.com_velocity[k] = linear / (scale * mass)


@kernel
def equations_of_motion(
    tree: BodyTree,
    motion: BodyMotion,
    composite: Inertias,
    rotors: Array2D,
    scale: float,
    terms: DynamicsTerms,
) -> None:
    """All terms of the equations of motion, of bodies that have been placed and moved.

    Args:
        rotors: the rotors' part of the mass matrix (n_joints, n_joints).
        scale: the factor on all masses and inertias but the rotors'.
    """
    composite_inertias(tree, motion, composite)
    terms.com[:] = composite.moment[0] / composite.mass[0]
    write_matrices(tree, motion, composite, rotors, scale, terms)
    write_forces(motion, composite, scale, terms)
    write_momentum(scale, composite.mass[0], terms)


# Feet


@kernel
def lowest_point(centre: Vector3, radius: float, rotation: Matrix3, out: Vector3) -> None:
    """Compute the lowest point (3,) of a ball, in the frame of the body it belongs to.

    Args:
        centre: of the ball [m, body].
        radius: of the ball [m].
        rotation: from the body to the world, (3, 3).
    """
    out[:] = centre - radius * rotation[2]


@kernel
def rolling_drift(
    motion: BodyMotion, body: int, centre: Vector3, lowest: Vector3, out: Vector3
) -> None:
    """Compute the rate of change (3,) of the velocity of a ball's lowest point, while v' = 0.

    The lowest point consists of other material at every instant. So its velocity
    v_c + w x (lowest - centre) has the derivative a_c + w' x (lowest - centre), without the
    centripetal acceleration that a fixed point of the material has.

    Args:
        centre, lowest: the places of the ball's centre and of its lowest point [m], (3,).
    """
    acceleration_at(motion, body, centre, out)
    angular = motion.acceleration[body, 3:6]
    out[:] = out + cross(angular, lowest - centre)


@kernel
def write_contacts(
    tree: BodyTree,
    motion: BodyMotion,
    terms: DynamicsTerms,
    constants: DynamicsConstants,
    scratch: DynamicsScratch,
) -> None:
    """Write the contact points with their motion, Jacobians and drifts; the sole of a ball is its lowest point."""
    local, place, centre = scratch.point, scratch.place, scratch.centre
    scratch.sole[:, :] = constants.sole
    for point in range(constants.foot_of_point.shape[0]):
        foot, radius = constants.foot_of_point[point], constants.radius[point]
        body = constants.foot_body[foot]
        local[:] = constants.point[point]
        if radius >= 0.0:
            lowest_point(constants.centre[point], radius, motion.rotation[body], local)
            scratch.sole[foot, :] = local
        point_position(motion, body, local, place)
        velocity_at(motion, body, place, terms.contact_velocity[point])
        acceleration_at(motion, body, place, terms.contact_drift[point])
        if radius >= 0.0:
            point_position(motion, body, constants.centre[point], centre)
            rolling_drift(motion, body, centre, place, terms.contact_drift[point])
        point_jacobian(tree, motion, body, place, terms.contact_jacobian[point])
        terms.contact_position[point, :] = terms.base_position + place


@kernel
def write_soles(
    motion: BodyMotion,
    terms: DynamicsTerms,
    constants: DynamicsConstants,
    scratch: DynamicsScratch,
) -> None:
    """Write the places and rotations of the soles."""
    for foot in range(constants.foot_body.shape[0]):
        body = constants.foot_body[foot]
        point_position(motion, body, scratch.sole[foot], scratch.place)
        terms.foot_position[foot, :] = terms.base_position + scratch.place
        terms.foot_rotation[foot, :, :] = motion.rotation[body]
