"""The whole-body model at the present state, evaluated once a tick for all controllers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.block import Block, Input, Output
from ..runtime.errors import BlockError
from ..runtime.parameters import Parameters, parameter
from .pinocchio_model import build_pinocchio_model
from .rotations import normalise, rotate_back, to_matrix
from .signals import BaseState, DynamicsTerms, JointState

Array = NDArray[np.float64]


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

    Does not filter or estimate anything, and knows no ground: contact points are points of the
    feet, loaded or not. Raises ``BlockError`` at load for an unknown actuator profile.
    """

    class Params(Parameters):
        actuators: str = parameter("koala", text="the profile whose rotor inertia counts")

    params: Params

    base = Input(BaseState, text="pose and velocity of the base")
    joints = Input(JointState, text="joint angles and velocities")
    terms = Output(DynamicsTerms, text="the model's terms")

    def setup(self) -> None:
        import pinocchio

        robot = self.context.robot
        if robot is None:
            raise BlockError("Dynamics needs a robot: name one in the graph, e.g. robot: bruce")
        if self.params.actuators not in robot.profiles:
            raise BlockError(
                f"{robot.name} has no actuator profile {self.params.actuators!r}; there is "
                + ", ".join(robot.profiles)
            )
        built = build_pinocchio_model(robot, self.params.actuators)
        self._pinocchio: Any = pinocchio
        self._model: Any = built.model
        self._data: Any = built.model.createData()
        self._rotor_coupling = built.rotor_coupling
        n_velocities: int = built.model.nv

        self._position = np.array(pinocchio.neutral(self._model))
        self._velocity = np.zeros(n_velocities)
        self._still = np.zeros(n_velocities)
        joints = [built.model.frames[sole].parentJoint for sole in built.sole_frames]
        # Views of Pinocchio's own memory: it writes there again in every tick.
        data = self._data
        self._mass_matrix: Array = data.M
        self._jacobian: Array = data.J
        self._jacobian_rate: Array = data.dJ
        self._momentum: Array = data.hg.vector
        self._momentum_rate: Array = data.dhg.vector
        self._foot_place = [data.oMi[joint].translation for joint in joints]
        self._foot_turn = [data.oMi[joint].rotation for joint in joints]
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
        n_feet = len(joints)
        self._foot_jacobian = np.zeros((n_feet, 6, n_velocities))
        self._foot_jacobian_rate = np.zeros((n_feet, 6, n_velocities))
        self._twist = np.zeros((n_feet, 6))
        self._twist_rate = np.zeros((n_feet, 6))
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

        pinocchio, model, data = self._pinocchio, self._model, self._data
        pinocchio.computeAllTerms(model, data, q, v)
        pinocchio.computeJointJacobiansTimeVariation(model, data, q, v)
        pinocchio.computeCentroidalMomentumTimeVariation(model, data, q, v, self._still)

        terms.velocity[...] = v
        np.add(self._mass_matrix, self._rotor_coupling, out=terms.mass_matrix)
        terms.nonlinear_effects[...] = data.nle
        terms.com[...] = data.com[0]
        terms.com_velocity[...] = data.vcom[0]
        terms.centroidal_matrix[...] = data.Ag
        terms.linear_momentum[...] = self._momentum[0:3]
        terms.angular_momentum[...] = self._momentum[3:6]
        terms.centroidal_drift[...] = self._momentum_rate
        terms.base_position[...] = base.position
        to_matrix(q[3:7], terms.base_rotation)

        for foot, sole in enumerate(self._soles):
            turn = self._foot_turn[foot]
            terms.foot_rotation[foot] = turn
            np.dot(turn, sole, terms.foot_position[foot])
            terms.foot_position[foot] += self._foot_place[foot]
            moves = self._moves[foot]
            np.multiply(self._jacobian, moves, out=self._foot_jacobian[foot])
            np.multiply(self._jacobian_rate, moves, out=self._foot_jacobian_rate[foot])
            np.dot(self._foot_jacobian[foot], v, self._twist[foot])
            np.dot(self._foot_jacobian_rate[foot], v, self._twist_rate[foot])
        for point, foot in enumerate(self._foot_of_point):
            position = terms.contact_position[point]
            np.dot(self._foot_turn[foot], self._points[point], position)
            position += self._foot_place[foot]
            point_motion(
                position,
                self._foot_jacobian[foot],
                self._twist[foot],
                self._twist_rate[foot],
                self._shift,
                terms.contact_jacobian[point],
                terms.contact_velocity[point],
                terms.contact_drift[point],
            )


def point_motion(
    position: Array,
    body_jacobian: Array,
    twist: Array,
    twist_rate: Array,
    shift: Array,
    jacobian: Array,
    velocity: Array,
    drift: Array,
) -> None:
    """The motion of one point of a body whose motion is known at the world's origin.

    A body that moves with (v_0, w) there moves with v_0 + w x p at p, so J_p = [1 | -[p]x] J_0;
    the derivative of that along the moving p is a_0 + w' x p + w x v_p.

    Args:
        position: of the point in the world [m], (3,).
        body_jacobian: spatial velocity at the world's origin per v, linear part first, (6, n).
        twist, twist_rate: that velocity, and its rate at v' = 0, (6,).
        shift: scratch (3, 6) whose left half is the identity.
        jacobian, velocity, drift: results, (3, n), (3,), (3,).
    """
    x, y, z = float(position[0]), float(position[1]), float(position[2])
    shift[0, 4], shift[0, 5], shift[1, 5] = z, -y, x
    shift[1, 3], shift[2, 3], shift[2, 4] = -z, y, -x
    np.dot(shift, body_jacobian, jacobian)
    np.dot(shift, twist, velocity)
    np.dot(shift, twist_rate, drift)
    u, v, w = float(velocity[0]), float(velocity[1]), float(velocity[2])
    rate_x, rate_y, rate_z = float(twist[3]), float(twist[4]), float(twist[5])
    drift[0] += rate_y * w - rate_z * v
    drift[1] += rate_z * u - rate_x * w
    drift[2] += rate_x * v - rate_y * u
