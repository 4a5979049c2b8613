"""The whole-body model at the present state, evaluated once a tick for all controllers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.kernel import kernel
from ...mathematics.rotations import normalise, rotate_back, to_matrix
from ...robots.ball_feet import ball_feet
from ...robots.pinocchio_model import build_pinocchio_model
from ...runtime.language.block import Block, Input, Output
from ..signals import BaseState, DynamicsTerms, JointState, MassEstimate

Array = NDArray[np.float64]

LEAST_SCALE, LEAST_OFFSET = 1e-4, 2e-5
"""The steps in which the model's mass (as a share) and its torso's CoM [m] change."""


class Dynamics(Block):
    """Inertia, contact Jacobians, momentum and their drifts, by Pinocchio (paper, II-B and V).

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
        import pinocchio

        robot = self.robot
        built = build_pinocchio_model(robot)
        self._pinocchio: Any = pinocchio
        self._model: Any = built.model
        self._data: Any = built.model.createData()
        self._rotor_coupling = built.rotor_coupling
        n_velocities: int = built.model.nv
        # What the model has now: the factor on all masses, and the offset of the torso's CoM.
        self._nominal_mass = robot.total_mass
        self._scale, self._offset, self._rest = 1.0, np.zeros(3), np.zeros(3)
        base = self._model.inertias[self._model.getJointId("base")]
        self._lever, self._described_lever = base.lever, np.array(base.lever)
        torso = next(link for link in robot.links if link.name == robot.base)
        self._torso_share = torso.mass / base.mass
        self._armature = np.diag(built.model.armature)
        self._rotors = np.array(self._rotor_coupling)
        self._weighs = "mass" in self.context.wired

        self._position = np.array(pinocchio.neutral(self._model))
        self._velocity = np.zeros(n_velocities)
        self._still = np.zeros(n_velocities)
        joints = [built.model.frames[sole].parentJoint for sole in built.sole_frames]
        # Views of Pinocchio's own memory, which it overwrites in every tick.
        data = self._data
        self._mass_matrix: Array = data.M
        self._jacobian: Array = data.J
        self._momentum: Array = data.hg.vector
        self._momentum_rate: Array = data.dhg.vector
        self._foot_place = [data.oMi[joint].translation for joint in joints]
        self._foot_turn = [data.oMi[joint].rotation for joint in joints]
        self._foot_motion = [
            (
                data.v[joint].linear,
                data.v[joint].angular,
                data.a[joint].linear,
                data.a[joint].angular,
            )
            for joint in joints
        ]
        # Which columns move each foot: Pinocchio's Jacobian holds those of all joints at once.
        self._moves = np.zeros((len(joints), 1, n_velocities))
        for foot, joint in enumerate(joints):
            for support in self._model.supports[joint]:
                if support > 0:
                    start = self._model.joints[support].idx_v
                    self._moves[foot, 0, start : start + self._model.joints[support].nv] = 1.0
        self._soles = [np.array(foot.sole) for foot in robot.feet]
        self._points = [np.array(contact.position) for contact in robot.contacts]
        self._foot_of_point = robot.foot_of_contact()
        self._balls = ball_feet(robot)
        n_feet = len(joints)
        self._foot_jacobian = np.zeros((n_feet, 6, n_velocities))
        self._local = np.zeros((2, 3))
        self._shift = np.zeros((3, 6))
        self._shift[:, :3] = np.eye(3)

    def step(self) -> None:
        base, joints, terms = self.base, self.joints, self.terms
        q, v = self._position, self._velocity
        q[0:3] = base.position
        normalise(base.orientation, q[3:7])
        q[7:] = joints.position
        rotate_back(q[3:7], base.linear_velocity, v[0:3])
        v[3:6] = base.angular_velocity
        v[6:] = joints.velocity

        if self._weighs:
            self._weigh()
        pinocchio, model, data = self._pinocchio, self._model, self._data
        pinocchio.computeAllTerms(model, data, q, v)
        # Also leaves every joint's spatial acceleration at v' = 0 in the model's data.
        pinocchio.computeCentroidalMomentumTimeVariation(model, data, q, v, self._still)

        terms.velocity[...] = v
        np.multiply(self._mass_matrix, self._scale, out=terms.mass_matrix)
        np.add(terms.mass_matrix, self._rotors, out=terms.mass_matrix)
        np.multiply(data.nle, self._scale, out=terms.nonlinear_effects)
        terms.com[...] = data.com[0]
        terms.com_velocity[...] = data.vcom[0]
        np.multiply(data.Ag, self._scale, out=terms.centroidal_matrix)
        np.multiply(self._momentum[0:3], self._scale, out=terms.linear_momentum)
        np.multiply(self._momentum[3:6], self._scale, out=terms.angular_momentum)
        np.multiply(self._momentum_rate, self._scale, out=terms.centroidal_drift)
        terms.base_position[...] = base.position
        to_matrix(q[3:7], terms.base_rotation)

        for ball in self._balls:
            lowest = self._points[ball.point]
            lowest_point(ball.centre, ball.radius, self._foot_turn[ball.foot], lowest)
            self._soles[ball.foot][...] = lowest
        for foot, sole in enumerate(self._soles):
            turn = self._foot_turn[foot]
            terms.foot_rotation[foot] = turn
            np.dot(turn, sole, terms.foot_position[foot])
            terms.foot_position[foot] += self._foot_place[foot]
            np.multiply(self._jacobian, self._moves[foot], out=self._foot_jacobian[foot])
        for point, foot in enumerate(self._foot_of_point):
            position, turn = terms.contact_position[point], self._foot_turn[foot]
            np.dot(turn, self._points[point], position)
            position += self._foot_place[foot]
            move_jacobian(
                self._foot_jacobian[foot], position, self._shift, terms.contact_jacobian[point]
            )
            point_motion(*self._foot_motion[foot], self._points[point], self._local)
            np.dot(turn, self._local[0], terms.contact_velocity[point])
            np.dot(turn, self._local[1], terms.contact_drift[point])
        for ball in self._balls:
            motion, turn = self._foot_motion[ball.foot], self._foot_turn[ball.foot]
            rolling_drift(*motion, ball.centre, self._points[ball.point], self._local)
            np.dot(turn, self._local[1], terms.contact_drift[ball.point])

    def _weigh(self) -> None:
        """Give the model the mass and the torso's centre of mass at the input, if they changed."""
        mass, offset = float(self.mass.mass), self.mass.com_offset
        scale = mass / self._nominal_mass if mass > 0.0 else 1.0
        # In small steps, so that the model is a function of the input and rarely changes.
        scale = round(scale / LEAST_SCALE) * LEAST_SCALE
        np.divide(offset, LEAST_OFFSET, out=self._rest)
        np.rint(self._rest, out=self._rest)
        self._rest *= LEAST_OFFSET
        if scale == self._scale and np.array_equal(self._rest, self._offset):
            return
        self._scale, self._offset[...] = scale, self._rest
        # All masses scale alike, so the terms do; rotors do not. The body that carries the torso may
        # carry links that are welded to it as well.
        np.multiply(self._armature, 1.0 - scale, out=self._rotors)
        np.add(self._rotors, self._rotor_coupling, out=self._rotors)
        np.multiply(self._offset, self._torso_share, out=self._rest)
        np.add(self._described_lever, self._rest, out=self._lever)


@kernel
def move_jacobian(origin_jacobian: Array, point: Array, shift: Array, out: Array) -> None:
    """The Jacobian (3, n) of a body's point, from the body's spatial Jacobian at the origin.

    A body that moves with (v_0, w) at the origin moves with v_0 + w x p at p, so
    J_p = [1 | -[p]x] J_0.

    Args:
        origin_jacobian: spatial velocity at the world's origin per v, linear first, (6, n).
        point: in the world [m].
        shift: scratch (3, 6) whose left half is the identity.
    """
    x, y, z = float(point[0]), float(point[1]), float(point[2])
    shift[0, 4], shift[0, 5], shift[1, 5] = z, -y, x
    shift[1, 3], shift[2, 3], shift[2, 4] = -z, y, -x
    np.dot(shift, origin_jacobian, out)


@kernel
def point_motion(
    linear: Array,
    angular: Array,
    linear_rate: Array,
    angular_rate: Array,
    offset: Array,
    out: Array,
) -> None:
    """Velocity (row 0) and classical acceleration (row 1) of a body's point, in the body's frame.

    From the body's spatial velocity (v, w) and spatial acceleration (a, w') in its own frame:
    v_p = v + w x r, a_p = a + w' x r + w x v_p.

    Args:
        linear, angular, linear_rate, angular_rate: v, w, a, w', (3,).
        offset: r, the point in the body's frame [m].
    """
    x, y, z = float(offset[0]), float(offset[1]), float(offset[2])
    wx, wy, wz = float(angular[0]), float(angular[1]), float(angular[2])
    ax, ay, az = float(angular_rate[0]), float(angular_rate[1]), float(angular_rate[2])
    vx = float(linear[0]) + wy * z - wz * y
    vy = float(linear[1]) + wz * x - wx * z
    vz = float(linear[2]) + wx * y - wy * x
    out[0, 0], out[0, 1], out[0, 2] = vx, vy, vz
    out[1, 0] = float(linear_rate[0]) + ay * z - az * y + wy * vz - wz * vy
    out[1, 1] = float(linear_rate[1]) + az * x - ax * z + wz * vx - wx * vz
    out[1, 2] = float(linear_rate[2]) + ax * y - ay * x + wx * vy - wy * vx


@kernel
def lowest_point(centre: Array, radius: float, rotation: Array, out: Array) -> None:
    """The lowest point (3,) of a ball, in the frame of the body it belongs to.

    Args:
        centre: of the ball [m, body].
        radius: of the ball [m].
        rotation: from the body to the world, (3, 3).
    """
    for k in range(3):
        out[k] = float(centre[k]) - radius * float(rotation[2, k])


@kernel
def rolling_drift(
    linear: Array,
    angular: Array,
    linear_rate: Array,
    angular_rate: Array,
    centre: Array,
    lowest: Array,
    out: Array,
) -> None:
    """The rate of change of the velocity of a ball's lowest point (row 1), in the body's frame.

    The lowest point consists of other material at every instant. So its velocity
    v_c + w x (lowest - centre) has the derivative a_c + w' x (lowest - centre), without the
    centripetal acceleration that a fixed point of the material has.

    Args:
        linear, angular, linear_rate, angular_rate: as for ``point_motion``.
        centre, lowest: the ball's centre and its lowest point in the body's frame [m].
        out: (2, 3); row 0 is the centre's velocity.
    """
    point_motion(linear, angular, linear_rate, angular_rate, centre, out)
    x = float(lowest[0]) - float(centre[0])
    y = float(lowest[1]) - float(centre[1])
    z = float(lowest[2]) - float(centre[2])
    ax, ay, az = float(angular_rate[0]), float(angular_rate[1]), float(angular_rate[2])
    out[1, 0] += ay * z - az * y
    out[1, 1] += az * x - ax * z
    out[1, 2] += ax * y - ay * x
