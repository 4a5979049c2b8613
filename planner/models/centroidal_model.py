"""Centroidal quantities and contact points with a quaternion for the base, as CasADi expressions.

Paper, section III-A: q in R^(7+n) is base position, quaternion and joint angles; v in R^(6+n) is the
base's velocity (world), its angular velocity (body) and the joint rates. Seen from the base neither
the centre of mass nor the momentum depends on where the base is, so both come from ``SymbolicModel``
at a base that is not turned, and are turned by the quaternion afterwards.
"""

from __future__ import annotations

from typing import Any

from .symbolic_model import SymbolicModel

QUATERNION = slice(3, 7)
"""x, y, z, w in q."""


def quaternion_product(a: Any, b: Any) -> Any:
    """Of x, y, z, w."""
    import casadi as ca

    vector = a[3] * b[:3] + b[3] * a[:3] + ca.cross(a[:3], b[:3])
    return ca.vertcat(vector, a[3] * b[3] - ca.dot(a[:3], b[:3]))


def quaternion_rotation(q: Any) -> Any:
    """The rotation from body to world of a unit quaternion."""
    import casadi as ca

    x, y, z, w = q[0], q[1], q[2], q[3]
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        ca.horzcat(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        ca.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def quaternion_step(q: Any, spin: Any, step: Any) -> Any:
    """A unit quaternion after ``step`` seconds of turning with ``spin`` (body).

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
    """f_com of equation (r = f_com(q)), world."""
    import casadi as ca

    seen = model.com(_at_rest_base(model, q))
    return q[:3] + ca.mtimes(quaternion_rotation(q[QUATERNION]), seen)


def contact_points(model: SymbolicModel, q: Any) -> list[Any]:
    """f_contact of equation (c = f_contact(q)): of every contact point, world."""
    import casadi as ca

    turn = quaternion_rotation(q[QUATERNION])
    points = model.contact_points(_at_rest_base(model, q))
    return [q[:3] + ca.mtimes(turn, point) for point in points]


def angular_momentum(model: SymbolicModel, q: Any, v: Any) -> Any:
    """A(q) v, the rows of the centroidal momentum matrix for the angular momentum, world."""
    import casadi as ca

    # Of the unturned base the rates of pitch, roll and yaw are those about y, x and z. Angular
    # momentum about the centre of mass does not depend on the base's linear velocity.
    spin = v[3:6]
    rates = ca.vertcat(ca.DM.zeros(3), spin[1], spin[0], spin[2], v[6:])
    _, angular = model.momentum(_at_rest_base(model, q), rates)
    return ca.mtimes(quaternion_rotation(q[QUATERNION]), angular)
