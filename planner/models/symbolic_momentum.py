"""A robot's centroidal momentum as CasADi expressions, in one pass from the links to the base.

Costs about half of the inverse dynamics: what every link carries (mass, momentum) is passed on to
the link that carries it, in that link's frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from .symbolic_frames import (
    Expression,
    base_angular_velocity,
    base_rotation,
    inertia_tensor,
    joint_origin,
    joint_rotation,
)
from .symbolic_model import SymbolicModel


class Centroidal(NamedTuple):
    """The centre of mass, linear momentum and angular momentum about the centre, world axes."""

    com: Expression
    linear: Expression
    angular: Expression


class _Carried(NamedTuple):
    """What a link and all that hangs on it have, in the link's frame: mass, mass times the centre's
    place, linear momentum and angular momentum about the link's origin."""

    mass: float
    moment: Expression
    linear: Expression
    angular: Expression


def centroidal_momentum(
    model: SymbolicModel, q: Expression, v: Expression, limbs: Sequence[int], share: int = 1
) -> Centroidal:
    """The momentum of the base and ``share`` times those limbs.

    Of a mirrored motion, with half of the limbs and a share of two, only what is not zero by
    symmetry means anything: x and z of the centre and of the linear momentum, y of the angular.
    The rotors' own spin is left out, as in the centroidal momentum matrix.
    """
    import casadi as ca

    robot, base = model.robot, model.robot.base
    rotation = base_rotation(q[3:6])
    spins = {base: base_angular_velocity(q[3:6], v[3:6])}
    speeds = {base: ca.mtimes(rotation.T, v[0:3])}
    chosen = sorted(index for limb in limbs for index in model.limbs[limb])
    for index in chosen:
        joint = robot.joints[index]
        back = joint_rotation(joint, q[6 + index]).T
        carried = speeds[joint.parent] + ca.cross(
            spins[joint.parent], joint_origin(joint, q[6 + index])
        )
        rate = ca.DM(list(joint.axis)) * v[6 + index]
        slides = joint.kind == "slide"
        speeds[joint.child] = ca.mtimes(back, carried + rate if slides else carried)
        spin = ca.mtimes(back, spins[joint.parent])
        spins[joint.child] = spin if slides else spin + rate
    held = {name: _own(model, name, spins[name], speeds[name]) for name in spins}
    for index in reversed(chosen):
        joint = robot.joints[index]
        inner, outer = held[joint.parent], held[joint.child]
        turn, origin = joint_rotation(joint, q[6 + index]), joint_origin(joint, q[6 + index])
        times = share if joint.parent == base else 1
        linear: Any = ca.mtimes(turn, outer.linear)
        moment: Any = ca.mtimes(turn, outer.moment) + outer.mass * origin
        angular: Any = ca.mtimes(turn, outer.angular) + ca.cross(origin, linear)
        held[joint.parent] = _Carried(
            inner.mass + times * outer.mass,
            inner.moment + times * moment,
            inner.linear + times * linear,
            inner.angular + times * angular,
        )
    whole = held[base]
    centre = whole.moment / whole.mass
    about = whole.angular - ca.cross(centre, whole.linear)
    return Centroidal(
        q[0:3] + ca.mtimes(rotation, centre),
        ca.mtimes(rotation, whole.linear),
        ca.mtimes(rotation, about),
    )


def _own(model: SymbolicModel, name: str, spin: Expression, speed: Expression) -> _Carried:
    import casadi as ca

    link = model.robot.link(name)
    centre = ca.DM(list(link.com))
    linear = link.mass * (speed + ca.cross(spin, centre))
    angular = ca.mtimes(ca.DM(inertia_tensor(link)), spin) + ca.cross(centre, linear)
    return _Carried(link.mass, link.mass * centre, linear, angular)
