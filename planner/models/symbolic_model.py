"""The robot's kinematics and dynamics as CasADi expressions, from its description.

Coordinates (n_velocities): base position in the world, the Euler angles pitch, roll, yaw of
``R = Ry(pitch) Rx(roll) Rz(yaw)``, joint angles. Velocities and accelerations are their time
derivatives, so integrating them is linear. The pitch may turn without limit; the coordinates are
singular at a roll of 90 degrees only. Links whose joints lead to the base through the same first
joint form a limb.

Agrees with Pinocchio's model of the same robot to rounding (the tests say 1e-10), rotors included.

The centroidal momentum takes one pass from the links to the base and about half as long as the inverse
dynamics: what every link carries (mass, momentum) is passed on to the link that carries it, in that link's frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...mathematics.constants import GRAVITY
from ...robots.description import ContactPoint, Joint, Link, RobotDescription
from ...robots.kinematics import ball_feet, inertia_tensor
from ...robots.welding import HeldLoad
from .symmetry import limbs_of

Expression = Any
"""A CasADi SX or DM; the library has no types of its own."""

MIRRORED_WRENCH = [1.0, -1.0, 1.0, -1.0, 1.0, -1.0]
"""The mirror image of a force and a moment, by the base's x-z plane."""
NO_TWINS: Mapping[int, int] = {}


def base_rotation(angles: Expression) -> Expression:
    """Return the rotation from body to world of pitch, roll, yaw."""
    import casadi as ca

    sp, cp = ca.sin(angles[0]), ca.cos(angles[0])
    sr, cr = ca.sin(angles[1]), ca.cos(angles[1])
    sy, cy = ca.sin(angles[2]), ca.cos(angles[2])
    return ca.vertcat(
        ca.horzcat(cp * cy + sp * sr * sy, -cp * sy + sp * sr * cy, sp * cr),
        ca.horzcat(cr * sy, cr * cy, -sr),
        ca.horzcat(-sp * cy + cp * sr * sy, sp * sy + cp * sr * cy, cp * cr),
    )


def base_angular_velocity(angles: Expression, rates: Expression) -> Expression:
    """Return the base's angular velocity in the body frame."""
    import casadi as ca

    sr, cr = ca.sin(angles[1]), ca.cos(angles[1])
    sy, cy = ca.sin(angles[2]), ca.cos(angles[2])
    return ca.vertcat(
        cr * sy * rates[0] + cy * rates[1],
        cr * cy * rates[0] - sy * rates[1],
        -sr * rates[0] + rates[2],
    )


def base_angular_acceleration(
    angles: Expression, rates: Expression, accelerations: Expression
) -> Expression:
    """Return the time derivative of ``base_angular_velocity``, in the body frame."""
    import casadi as ca

    sr, cr = ca.sin(angles[1]), ca.cos(angles[1])
    sy, cy = ca.sin(angles[2]), ca.cos(angles[2])
    _, roll, yaw = rates[0], rates[1], rates[2]
    drift = ca.vertcat(
        (-sr * sy * roll + cr * cy * yaw) * rates[0] - sy * yaw * roll,
        (-sr * cy * roll - cr * sy * yaw) * rates[0] - cy * yaw * roll,
        -cr * roll * rates[0],
    )
    return base_angular_velocity(angles, accelerations) + drift


def joint_origin(joint: Joint, place: Expression) -> Expression:
    """Return the child's origin in the parent's frame; a slide carries it along its axis."""
    import casadi as ca

    origin = ca.DM(list(joint.origin))
    return origin + ca.DM(list(joint.axis)) * place if joint.kind == "slide" else origin


def joint_rotation(joint: Joint, angle: Expression) -> Expression:
    """Return the rotation from child to parent: none for a slide, Rodrigues' formula for a hinge.

    A hinge about a coordinate axis gets a matrix with structural zeros, which is far cheaper.
    """
    import casadi as ca

    if joint.kind == "slide":
        return ca.SX.eye(3)
    axis = int(np.argmax(np.abs(joint.axis)))
    if abs(joint.axis[axis]) != 1.0:
        x, y, z = joint.axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turned = ca.DM(cross) * ca.sin(angle) + ca.DM(cross @ cross) * (1.0 - ca.cos(angle))
        return ca.SX.eye(3) + turned
    sine, cosine = joint.axis[axis] * ca.sin(angle), ca.cos(angle)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    rotation = ca.SX(3, 3)
    rotation[axis, axis] = 1
    rotation[first, first] = rotation[second, second] = cosine
    rotation[first, second], rotation[second, first] = -sine, sine
    return rotation


class SymbolicModel:
    """Expressions of a robot's motion, with the rotors of its actuator profile in use.

    Joints may be hinges or slides with any axis. ``loads`` are what hangs on joints that are held
    and so are none of this robot's. Every method takes CasADi expressions and returns
    expressions.

    Raises:
        ValueError: a joint is listed before the one that carries it.
    """

    def __init__(self, robot: RobotDescription, loads: Sequence[HeldLoad] = ()) -> None:
        self.robot, self.loads = robot, tuple(loads)
        self.n_joints = len(robot.joints)
        self.size = self.n_joints + 6
        self.rotors = robot.rotor_matrix
        self._balls = {robot.contacts[ball.point].name: ball for ball in ball_feet(robot)}
        self.limbs, self.limb_of_link = limbs_of(robot)
        self._joint_of = {joint.child: index for index, joint in enumerate(robot.joints)}

    # Kinematics

    def frames(self, q: Expression, limbs: Sequence[int] | None = None) -> dict[str, Any]:
        """Return the rotation to the world and the origin of every link of the base and those limbs."""
        import casadi as ca

        frames = {self.robot.base: (base_rotation(q[3:6]), q[0:3])}
        for index in self.joints_of(limbs):
            joint = self.robot.joints[index]
            rotation, origin = frames[joint.parent]
            turn = joint_rotation(joint, q[6 + index])
            frames[joint.child] = (
                ca.mtimes(rotation, turn),
                origin + ca.mtimes(rotation, joint_origin(joint, q[6 + index])),
            )
        return frames

    def point(self, frames: dict[str, Any], link: str, place: Sequence[float]) -> Expression:
        """Return the world position of a point of a link."""
        import casadi as ca

        rotation, origin = frames[link]
        return origin + ca.mtimes(rotation, ca.DM(list(place)))

    def contact_points(self, q: Expression, limbs: Sequence[int] | None = None) -> list[Any]:
        """Return the world positions of the contact points on those limbs, in the description's order; of a ball the
        lowest point.
        """
        return self._contacts(q, limbs, None)

    def footholds(
        self, q: Expression, limbs: Sequence[int] | None = None, heading: Any = (1.0, 0.0)
    ) -> list[Any]:
        """Return the places that stay fixed while the contact points on those limbs stand on the ground.

        A ball rolls without slipping, so its lowest point moves by the radius times the turn. What
        stays is the place where it would touch if its link were turned by neither the pitch nor the
        roll that it has (yaw first, then roll, then pitch, as a hip and a knee turn it). That is exact
        for a link whose pitch and roll are about the axes of the stance's ``heading``, whose cosine
        and sine are given.
        """
        return self._contacts(q, limbs, heading)

    def _contacts(self, q: Expression, limbs: Sequence[int] | None, heading: Any) -> list[Any]:
        import casadi as ca

        frames = self.frames(q, limbs)
        link_of = {foot.name: foot.link for foot in self.robot.feet}
        found = []
        for contact in self.robot.contacts:
            link, ball = link_of[contact.foot], self._balls.get(contact.name)
            if link not in frames:
                continue
            if ball is None:
                found.append(self.point(frames, link, contact.position))
                continue
            centre = [float(value) for value in ball.centre]
            lowest = self.point(frames, link, centre) - ca.DM([0.0, 0.0, ball.radius])
            turn = frames[link][0]
            if heading is None:
                found.append(lowest)
                continue
            pitch, roll = ca.atan2(-turn[2, 0], turn[2, 2]), ca.asin(turn[2, 1])
            cosine, sine = heading[0], heading[1]
            way = ca.vertcat(cosine * pitch + sine * roll, sine * pitch - cosine * roll, 0.0)
            found.append(lowest - ball.radius * way)
        return found

    def com(self, q: Expression) -> Expression:
        """Return the centre of mass in the world."""
        import casadi as ca

        frames = self.frames(q)
        total: Any = ca.SX.zeros(3)
        for link in self.robot.links:
            total = total + link.mass * self.point(frames, link.name, link.com)
        return total / self.robot.total_mass

    # Dynamics

    def inverse_dynamics(
        self,
        q: Expression,
        v: Expression,
        a: Expression,
        forces: dict[str, Expression],
        limbs: Sequence[int] | None = None,
    ) -> tuple[Expression, dict[int, Expression], Expression]:
        """Return the forces that must act for the robot to move with accelerations ``a`` under gravity while ``forces``
        (contact name -> force on the robot, world) push it.

        Returns:
            the wrench (force, moment about the base's origin; body frame) that the base link needs,
            by joint the wrench that all that hangs on it needs from the link that carries it (force,
            moment about that link's origin; its frame), and the joint torques (n_joints), zero for
            limbs left out. The robot moves freely where those at the base add up to zero
            (``base_wrench``).
        """
        import casadi as ca

        robot, base = self.robot, self.robot.base
        down = base_rotation(q[3:6]).T
        spins, turns, pulls = self._accelerations(q, v, a, limbs)
        pushes = {name: {base: ca.mtimes(down, force)} for name, force in forces.items()}
        needed = {base: self._body_wrench(robot.link(base), spins[base], turns[base], pulls[base])}
        link_of = {foot.name: foot.link for foot in robot.feet}
        backs: dict[str, Any] = {}
        joints = self.joints_of(limbs)
        for index in joints:
            joint = robot.joints[index]
            parent, child = joint.parent, joint.child
            back = backs[child] = joint_rotation(joint, q[6 + index]).T
            wrench = self._body_wrench(robot.link(child), spins[child], turns[child], pulls[child])
            for contact in robot.contacts:
                push = pushes.get(contact.name)
                if push is None or not self._carries(child, link_of[contact.foot]):
                    continue
                push[child] = ca.mtimes(back, push[parent])
                if link_of[contact.foot] == child:
                    place = self._touching(contact, backs, down, child)
                    wrench = wrench - ca.vertcat(push[child], ca.cross(place, push[child]))
            needed[child] = wrench
        torques = [ca.SX(0)] * self.n_joints
        passed: dict[int, Any] = {}
        for index in reversed(joints):
            joint = robot.joints[index]
            wrench = needed[joint.child]
            own = wrench[0:3] if joint.kind == "slide" else wrench[3:6]
            torques[index] = ca.dot(ca.DM(list(joint.axis)), own)
            turn = backs[joint.child].T
            force, moment = ca.mtimes(turn, wrench[0:3]), ca.mtimes(turn, wrench[3:6])
            origin = joint_origin(joint, q[6 + index])
            passed[index] = ca.vertcat(force, moment + ca.cross(origin, force))
            if joint.parent != base:
                needed[joint.parent] = needed[joint.parent] + passed[index]
        spun = ca.mtimes(ca.DM(self.rotors), a[6:])
        moved = [torques[i] + spun[i] if i in joints else torques[i] for i in range(self.n_joints)]
        return needed[base], passed, ca.vertcat(*moved)

    def base_wrench(self, base: Expression, passed: dict[int, Expression], share: int) -> Any:
        """Return the wrench that the robot needs from outside, of ``inverse_dynamics``' results, where every computed
        limb stands for ``share`` of them.
        """
        joints = self.robot.joints
        limbs = [w for i, w in passed.items() if joints[i].parent == self.robot.base]
        return base + share * sum(limbs)

    def _touching(
        self, contact: ContactPoint, backs: dict[str, Any], down: Expression, link: str
    ) -> Expression:
        """Return the point at which the ground's force acts, in the frame of the foot's link: a ball's lowest point is
        found by turning the vertical back from the world to the link.
        """
        import casadi as ca

        ball = self._balls.get(contact.name)
        if ball is None:
            return ca.DM(list(contact.position))
        up = down[:, 2]
        for name, back in backs.items():  # parents first
            if self._carries(name, link):
                up = ca.mtimes(back, up)
        return ca.DM(ball.centre) - ball.radius * up

    def held_torques(
        self,
        q: Expression,
        v: Expression,
        a: Expression,
        passed: dict[int, Expression],
        limbs: Sequence[int] | None = None,
        twins: Mapping[int, int] = NO_TWINS,
    ) -> list[Any]:
        """Return the torques that keep held joints still in a motion, of those ``loads`` on the base and those limbs.

        Args:
            q, v, a: coordinates, velocities and accelerations.
            passed: by joint what hangs on it needs, of ``inverse_dynamics``.
            limbs: the limbs that are computed; by default all.
            twins: of mirrored joints that are not computed those that they mirror.
        """
        import casadi as ca

        spins, turns, pulls = self._accelerations(q, v, a, limbs)
        found = []
        for load in self.loads:
            if load.link not in spins:
                continue
            spin, turn, centre = spins[load.link], turns[load.link], ca.DM(list(load.com))
            arm = centre - ca.DM(list(load.origin))
            lifted = pulls[load.link] + ca.cross(turn, centre)
            force = load.mass * (lifted + ca.cross(spin, ca.cross(spin, centre)))
            tensor = ca.DM(inertia_tensor(load.inertia))
            moment = ca.mtimes(tensor, turn) + ca.cross(spin, ca.mtimes(tensor, spin))
            moment = moment + ca.cross(arm, force)
            for joint in load.carried:
                wrench = passed[twins.get(joint, joint)]
                if joint in twins:
                    wrench = ca.DM(MIRRORED_WRENCH) * wrench
                own = ca.cross(ca.DM(list(load.origin)), wrench[0:3])
                moment = moment + wrench[3:6] - own
            found.append(ca.dot(ca.DM(list(load.axis)), moment))
        return found

    def _accelerations(
        self, q: Expression, v: Expression, a: Expression, limbs: Sequence[int] | None
    ) -> tuple[dict[str, Any], dict[str, Any], dict[str, Any]]:
        """Return the angular velocity, angular acceleration and acceleration of the origin, with gravity's opposite
        added, of the links of the base and those limbs, each in its own frame.
        """
        import casadi as ca

        base = self.robot.base
        spins = {base: base_angular_velocity(q[3:6], v[3:6])}
        turns = {base: base_angular_acceleration(q[3:6], v[3:6], a[3:6])}
        lifted = ca.vertcat(a[0], a[1], a[2] + GRAVITY)
        pulls = {base: ca.mtimes(base_rotation(q[3:6]).T, lifted)}
        for index in self.joints_of(limbs):
            joint = self.robot.joints[index]
            parent, child = joint.parent, joint.child
            back = joint_rotation(joint, q[6 + index]).T
            axis = ca.DM(list(joint.axis))
            spin = ca.mtimes(back, spins[parent])
            rate = axis * v[6 + index]
            origin = joint_origin(joint, q[6 + index])
            pull = (
                pulls[parent]
                + ca.cross(turns[parent], origin)
                + ca.cross(spins[parent], ca.cross(spins[parent], origin))
            )
            if joint.kind == "slide":
                spins[child], turns[child] = spin, ca.mtimes(back, turns[parent])
                pull = pull + 2.0 * ca.cross(spins[parent], rate) + axis * a[6 + index]
            else:
                spins[child] = spin + rate
                turns[child] = (
                    ca.mtimes(back, turns[parent]) + ca.cross(spin, rate) + axis * a[6 + index]
                )
            pulls[child] = ca.mtimes(back, pull)
        return spins, turns, pulls

    def _body_wrench(self, link: Link, spin: Any, turn: Any, pull: Any) -> Any:
        """Return the force and moment about the link's origin that its own mass needs, in its frame."""
        import casadi as ca

        centre = ca.DM(list(link.com))
        force = link.mass * (pull + ca.cross(turn, centre) + ca.cross(spin, ca.cross(spin, centre)))
        tensor = ca.DM(inertia_tensor(link.inertia))
        moment = (
            ca.mtimes(tensor, turn)
            + ca.cross(spin, ca.mtimes(tensor, spin))
            + ca.cross(centre, force)
        )
        return ca.vertcat(force, moment)

    def _carries(self, link: str, outer: str) -> bool:
        """Check whether ``outer`` hangs on ``link``, or is it."""
        while outer != self.robot.base:
            if outer == link:
                return True
            outer = self.robot.joints[self._joint_of[outer]].parent
        return False

    def joints_of(self, limbs: Sequence[int] | None) -> list[int]:
        """Return the joint indices of those limbs, or of all of them, parents first."""
        chosen = range(len(self.limbs)) if limbs is None else limbs
        return sorted(index for limb in chosen for index in self.limbs[limb])


class Centroidal(NamedTuple):
    """The centre of mass, linear momentum and angular momentum about the centre, world axes."""

    com: Expression
    linear: Expression
    angular: Expression


class _SubtreeMomentum(NamedTuple):
    """Momentum of a link and all that hangs on it, in the link's frame: mass, mass times the centre's place, linear
    momentum and angular momentum about the link's origin.
    """

    mass: float
    moment: Expression
    linear: Expression
    angular: Expression


def centroidal_momentum(
    model: SymbolicModel,
    q: Expression,
    v: Expression,
    limbs: Sequence[int] | None = None,
    share: int = 1,
) -> Centroidal:
    """Return the momentum of the base and ``share`` times those limbs, or all.

    Of a mirrored motion, with half of the limbs and a share of two, only what is not zero by
    symmetry means anything: x and z of the centre and of the linear momentum, y of the angular.
    The rotors' own spin is left out, as in the centroidal momentum matrix.
    """
    import casadi as ca

    robot, base = model.robot, model.robot.base
    rotation = base_rotation(q[3:6])
    spins = {base: base_angular_velocity(q[3:6], v[3:6])}
    speeds = {base: ca.mtimes(rotation.T, v[0:3])}
    chosen = model.joints_of(limbs)
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
        held[joint.parent] = _SubtreeMomentum(
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


def _own(model: SymbolicModel, name: str, spin: Expression, speed: Expression) -> _SubtreeMomentum:
    import casadi as ca

    link = model.robot.link(name)
    centre = ca.DM(list(link.com))
    linear = link.mass * (speed + ca.cross(spin, centre))
    angular = ca.mtimes(ca.DM(inertia_tensor(link.inertia)), spin) + ca.cross(centre, linear)
    return _SubtreeMomentum(link.mass, link.mass * centre, linear, angular)
