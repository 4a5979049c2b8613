"""The simpler models of a robot: a single rigid body (``srbm``), and centroidal quantities (``paper``).

Centroidal quantities and contact points have a quaternion for the base and are CasADi expressions.

Paper, section III-A: q in R^(7+n) is base position, quaternion and joint angles; v in R^(6+n) is the
base's velocity (world), its angular velocity (body) and the joint rates. Seen from the base neither
the centre of mass nor the momentum depends on where the base is, so both come from ``SymbolicModel``
at a base that is not turned, and are turned by the quaternion afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from .euler_angles import pose_of
from .exact_dynamics import ExactDynamics
from .robot_model import Stance
from .symbolic_model import SymbolicModel, centroidal_momentum
from .symmetry import limbs_of

STRAIGHT = 0.985
"""The longest leg by the length of a straight one, where the knee is singular."""
BENT = 0.8
"""The most the body may bend a knee by its limit: the robot's own legs, which weigh something and
so raise its hips over its centre of mass, are bent more or less than the body's."""
BLEND = 0.04
"""s, in which a foot that leaves the ground comes to its course."""
SPARE = 0.008
"""m, of a leg's length, that is kept at lift-off and touchdown."""


@dataclass(frozen=True)
class RigidBody:
    """A robot as one body with legs without mass.

    Attributes:
        inertia: of the whole robot as it stands, about its centre of mass, torso axes (3, 3).
        hips: from the centre of mass, torso axes (n_legs, 3).
        shortest, longest: of a leg from hip to ankle [m].
        standing: its length as the robot stands [m].
    """

    inertia: Array
    hips: Array
    shortest: float
    longest: float
    standing: float

    def at_hop(self, speed: float) -> float:
        """Return the longest leg [m] at lift-off and touchdown with that vertical speed [m/s]: the foot, at rest at
        first, lags behind the body while it gains its speed.
        """
        return min(self.standing, self.longest - SPARE - 0.5 * BLEND * abs(speed))


def composite_inertia(robot: RobotDescription, start: Stance) -> RigidBody:
    """Return the body of a robot in its stance."""
    joints = start.coordinates[6:]
    com, inertia = ExactDynamics(robot).standing_inertia(joints)
    hips, straight, lengths, knees = [], [], [], []
    for leg in limbs_of(robot)[0]:
        origins = [np.array(robot.joints[index].origin) for index in leg]
        hips.append(origins[0] - com)
        bones = [float(np.linalg.norm(o)) for o in origins[1:] if np.any(o)]
        straight.append(sum(bones))
        bent = next(index for index in leg[1:] if np.any(robot.joints[index].origin))
        knees.append((bones, robot.joint_limits[bent], start.coordinates[6 + bent]))
    for bones, limits, angle in knees:
        thigh, calf = bones[0], sum(bones[1:])
        most = BENT * float(np.abs(limits).max())
        lengths.append([np.sqrt(thigh**2 + calf**2 + 2 * thigh * calf * np.cos(bend))
                        for bend in (most, float(angle))])  # fmt: skip
    return RigidBody(
        0.5 * (inertia + inertia.T), np.array(hips), max(x[0] for x in lengths),
        STRAIGHT * min(straight), min(x[1] for x in lengths),
    )  # fmt: skip


def ankles(robot: RobotDescription, stance: Stance) -> Array:
    """Return the places of the ankles in a stance, in the order of the limbs (n_legs, 3)."""
    places = ExactDynamics(robot).joint_places(pose_of(stance.coordinates))
    return places[[leg[-1] for leg in limbs_of(robot)[0]]]


QUATERNION = slice(3, 7)
"""x, y, z, w in q."""


def quaternion_product(a: Any, b: Any) -> Any:
    """Return the product of two quaternions x, y, z, w."""
    import casadi as ca

    vector = a[3] * b[:3] + b[3] * a[:3] + ca.cross(a[:3], b[:3])
    return ca.vertcat(vector, a[3] * b[3] - ca.dot(a[:3], b[:3]))


def quaternion_rotation(q: Any) -> Any:
    """Return the rotation from body to world of a unit quaternion."""
    import casadi as ca

    x, y, z, w = q[0], q[1], q[2], q[3]
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        ca.horzcat(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        ca.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def quaternion_step(q: Any, spin: Any, step: Any) -> Any:
    """Return a unit quaternion after ``step`` seconds of turning with ``spin`` (body).

    Euler's step in the tangent, brought back to length one: q[k] - q[k-1] = v[k] dt on the sphere.
    """
    import casadi as ca

    half = 0.5 * step * spin
    turned = quaternion_product(q, ca.vertcat(half, 1.0))
    return turned / ca.sqrt(1.0 + ca.dot(half, half))


def _at_rest_base(model: SymbolicModel, q: Any) -> Any:
    import casadi as ca

    return ca.vertcat(ca.DM.zeros(6), q[7:])


def com(model: SymbolicModel, q: Any) -> Any:
    """Return f_com of equation (r = f_com(q)), world."""
    import casadi as ca

    seen = model.com(_at_rest_base(model, q))
    return q[:3] + ca.mtimes(quaternion_rotation(q[QUATERNION]), seen)


def contact_points(model: SymbolicModel, q: Any) -> list[Any]:
    """Return f_contact of equation (c = f_contact(q)): of every contact point, world."""
    import casadi as ca

    turn = quaternion_rotation(q[QUATERNION])
    points = model.contact_points(_at_rest_base(model, q))
    return [q[:3] + ca.mtimes(turn, point) for point in points]


def angular_momentum(model: SymbolicModel, q: Any, v: Any) -> Any:
    """Return A(q) v, the rows of the centroidal momentum matrix for the angular momentum, world."""
    import casadi as ca

    # Of the unturned base the rates of pitch, roll and yaw are those about y, x and z. Angular
    # momentum about the centre of mass does not depend on the base's linear velocity.
    spin = v[3:6]
    rates = ca.vertcat(ca.DM.zeros(3), spin[1], spin[0], spin[2], v[6:])
    seen = centroidal_momentum(model, _at_rest_base(model, q), rates)
    return ca.mtimes(quaternion_rotation(q[QUATERNION]), seen.angular)
