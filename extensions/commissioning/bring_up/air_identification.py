"""Torque constants and friction of a robot whose joints move one after the other, feet in the air."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from ....mathematics.arrays import Array
from ....robots.pinocchio_model import build_pinocchio_model
from ....robots.robot_description import RobotDescription
from ..identification.sensor_identification import slope, smooth

SOFT_SPEED = 0.05
"""The joint speed at which most of the Coulomb friction acts [rad/s]."""
CUTOFF, LIGHT = 30.0, 80.0
"""Cutoffs of the filter of all signals, and of that of the velocities whose sign is taken [Hz]."""
EDGE, EVERY = 100, 8
"""Samples that the filter spoils at both ends, and of the others every eighth is used."""


class AirMotion(NamedTuple):
    """A motion, one row an exchange: the joints' ``position`` and ``velocity`` [rad, rad/s] (n, n_joints), the
    motors' ``torque`` by their nominal constants [N m] (n, n_motors), the base's angular velocity ``rate``
    [rad/s] and specific ``force`` [m/s^2] (n, 3); and the motors that were ``on``."""

    position: Array
    velocity: Array
    torque: Array
    rate: Array
    force: Array
    on: list[int]

    @classmethod
    def allocate(cls, robot: RobotDescription, count: int, on: list[int]) -> Self:
        """Allocate the arrays of a motion of ``count`` exchanges."""
        n = len(robot.joints)
        position, velocity, torque = np.zeros((3, count, n))
        rate, force = np.zeros((2, count, 3))
        return cls(position, velocity, torque, rate, force, on)


class JointFriction(NamedTuple):
    """Coulomb [N m] and viscous [N m s/rad] friction of a joint."""

    coulomb: float
    viscous: float


def joint_inertia(robot: RobotDescription, position: Array) -> Array:
    """Return the inertia that every joint turns while the base and the other joints rest [kg m^2], (n_joints,)."""
    import pinocchio as pin

    model = build_pinocchio_model(robot).model
    q = np.concatenate([np.zeros(6), [1.0], position])
    matrix = pin.crba(model, model.createData(), q)
    inertia: Array = np.diag(matrix)[6:].copy()
    return inertia


def identify_in_air(
    robot: RobotDescription, motions: Sequence[AirMotion], period: float
) -> tuple[list[float], dict[str, JointFriction]]:
    """Factors on the nominal torque constants, by motor, and friction by joint.

    In the air the torque of joint j, of which all motors are on, is that of inverse dynamics with the
    base's measured motion, and friction::

        sum_m A_mj c_m kappa_m = ID_j + f_j sign(q_j') + d_j q_j' + o_j

    Least squares over all motions; ``o_j`` takes up errors of the encoders' zero and of the links' centres.

    Args:
        robot: the description, whose links and rotors are taken for true.
        motions: of every joint.
        period: from row to row [s].
    """
    import pinocchio as pin

    built = build_pinocchio_model(robot)
    model: Any = pin.Model(built.model)
    model.gravity.linear = np.zeros(3)  # the specific force stands for it
    data = model.createData()
    n, to_motor, rotors = len(robot.joints), robot.joint_to_motor, robot.rotor_matrix
    model.armature = np.zeros(6 + n)
    rows: list[Array] = []
    right: list[float] = []
    for motion in motions:
        position, velocity, torque, rate, force = (
            smooth(each, period, CUTOFF) for each in motion[:5]
        )
        light = smooth(motion.velocity, period, LIGHT)
        signs = smooth(np.tanh(light / SOFT_SPEED), period, CUTOFF)  # filtered as all else
        bends, turns = slope(velocity, period), slope(rate, period)
        driven = [j for j in range(n) if set(np.flatnonzero(to_motor[:, j])) <= set(motion.on)]
        q, v, a = np.zeros(7 + n), np.zeros(6 + n), np.zeros(6 + n)
        q[6] = 1.0
        for k in range(EDGE, len(position) - EDGE, EVERY):
            q[7:], v[3:6], v[6:] = position[k], rate[k], velocity[k]
            a[:3], a[3:6], a[6:] = force[k], turns[k], bends[k]
            needed = pin.rnea(model, data, q, v, a)[6:] + rotors @ bends[k]
            for j in driven:
                row = np.zeros(4 * n)
                row[:n] = to_motor[:, j] * torque[k]
                row[n + j] = -signs[k, j]
                row[2 * n + j] = -velocity[k, j]
                row[3 * n + j] = -1.0
                rows.append(row)
                right.append(float(needed[j]))
    found = np.linalg.lstsq(np.array(rows), np.array(right), rcond=None)[0]
    friction = {
        joint.name: JointFriction(found.item(n + j), found.item(2 * n + j))
        for j, joint in enumerate(robot.joints)
    }
    return found[:n].tolist(), friction
