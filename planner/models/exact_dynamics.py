"""The robot's exact equations of motion, for checking plans: Pinocchio and NumPy, no solver.

The joints move as planned and the contact forces are the planned ones; how the base then moves
follows from its six rows of the equations of motion,

    M_bb a_b + M_bj a_j + h_b = sum over contacts of J_b' F,

and the joint torques from the other rows. Nothing here shares code with the planner's own model.

Flight without contacts follows from what is conserved, the momentum: the centre of mass flies a parabola, and the angular momentum k about it is
constant, so the base turns as

    w = I(q)^-1 (R' k - h(q, dq/dt)),

with I the inertia of the robot, as rigid in this pose, about its centre of mass, and h the angular momentum of
the joints' motion, both in the base's axes. I and h depend on the joints only and are known for every
instant beforehand. Only the orientation R is integrated, by Runge and Kutta's method of order four. These are
the equations of motion of ``ExactDynamics``, integrated once, at a quarter of the cost.

Under constant contact forces the base accelerates at every instant as

    a = M(q)^-1 (W - b),

with M its own block of the mass matrix, b the bias of the joints' motion and gravity, and W the wrench of the contact
forces, all in the base's axes. M and the places of the contact points seen from the base depend on the joints only,
so both are evaluated for every instant beforehand. Runge and Kutta's method of order four has four evaluations of b a step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...mathematics.linear_algebra import product
from ...mathematics.rotations import matrices_of_quaternions, skew, to_matrix
from ...robots.description import RobotDescription
from ...robots.kinematics import ball_feet
from ...robots.pinocchio_model import build_pinocchio_model

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class JointSide:
    """What the joints' motion says at n instants, in the base's axes.

    Attributes:
        com, com_velocity: the centre of mass seen from the base [m], and how it moves [m/s], (n, 3).
        inertia: about it [kg m^2], (n, 3, 3).
        momentum: the angular momentum about it of the joints' motion [N m s], (n, 3).
    """

    com: Array
    com_velocity: Array
    inertia: Array
    momentum: Array


def joint_side(pin: Any, model: Any, data: Any, position: Array, velocity: Array) -> JointSide:
    """The same from joint angles and velocities, both (n, n_joints)."""
    count = len(position)
    found = JointSide(
        np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3))
    )
    q, v = np.zeros(model.nq), np.zeros(model.nv)
    q[6] = 1.0
    for i in range(count):
        q[7:], v[6:] = position[i], velocity[i]
        matrix = pin.ccrba(model, data, q, v)
        moved = data.hg
        found.com[i] = data.com[0]
        found.com_velocity[i] = moved.linear
        found.inertia[i] = matrix[3:, 3:6]
        found.momentum[i] = moved.angular
    found.com_velocity[:] /= data.Ig.mass
    return found


def coast(base: Array, twist: Array, side: JointSide, step: float) -> tuple[Array, Array]:
    """The base after every step of a flight: its places (n, 7) and twists (n, 6).

    Args:
        base: its position [m] and quaternion (x, y, z, w) at the beginning, (7,).
        twist: its linear and angular velocity there [m/s, rad/s], in its own axes, (6,).
        side: what the joints say at the beginning, in the middle and at the end of every step, (2 n + 1).
        step: how long one step is [s].
    """
    count = len(side.com) // 2
    inverse = np.linalg.inv(side.inertia)
    own: list[Vector] = [
        (x, y, z) for x, y, z in np.einsum("nij,nj->ni", inverse, side.momentum).tolist()
    ]
    inverses = inverse.reshape(-1, 9).tolist()
    turn = matrices_of_quaternions(base[None, 3:7])[0]
    carried = turn @ (side.inertia[0] @ twist[3:6] + side.momentum[0])
    kx, ky, kz = carried.tolist()

    def spin(i: int, x: float, y: float, z: float, w: float) -> Quaternion:
        """The derivative of the quaternion at an instant."""
        # R' k for a quaternion that need not be of length one
        scale = 1.0 / (x * x + y * y + z * z + w * w)
        tx, ty, tz = 2.0 * (ky * z - kz * y), 2.0 * (kz * x - kx * z), 2.0 * (kx * y - ky * x)
        ax = kx + scale * (w * tx + ty * z - tz * y)
        ay = ky + scale * (w * ty + tz * x - tx * z)
        az = kz + scale * (w * tz + tx * y - ty * x)
        a, b, c, d, e, f, g, h, j = inverses[i]
        ox, oy, oz = own[i]
        wx = a * ax + b * ay + c * az - ox
        wy = d * ax + e * ay + f * az - oy
        wz = g * ax + h * ay + j * az - oz
        return (
            0.5 * (w * wx + y * wz - z * wy), 0.5 * (w * wy + z * wx - x * wz),
            0.5 * (w * wz + x * wy - y * wx), -0.5 * (x * wx + y * wy + z * wz),
        )  # fmt: skip

    x, y, z, w = base[3:7].tolist()
    quaternions = np.empty((count + 1, 4))
    quaternions[0] = x, y, z, w
    half, sixth = 0.5 * step, step / 6.0
    for n in range(count):
        i = 2 * n
        a = spin(i, x, y, z, w)
        b = spin(i + 1, x + half * a[0], y + half * a[1], z + half * a[2], w + half * a[3])
        c = spin(i + 1, x + half * b[0], y + half * b[1], z + half * b[2], w + half * b[3])
        d = spin(i + 2, x + step * c[0], y + step * c[1], z + step * c[2], w + step * c[3])
        x += sixth * (a[0] + 2.0 * (b[0] + c[0]) + d[0])
        y += sixth * (a[1] + 2.0 * (b[1] + c[1]) + d[1])
        z += sixth * (a[2] + 2.0 * (b[2] + c[2]) + d[2])
        w += sixth * (a[3] + 2.0 * (b[3] + c[3]) + d[3])
        size = (x * x + y * y + z * z + w * w) ** -0.5
        x, y, z, w = x * size, y * size, z * size, w * size
        quaternions[n + 1] = x, y, z, w
    return _around_com(base, twist, side, quaternions, carried, step)


def _around_com(
    base: Array, twist: Array, side: JointSide, quaternions: Array, carried: Array, step: float
) -> tuple[Array, Array]:
    """Place and twist of the base behind every step, from its orientation and the parabola."""
    turns = matrices_of_quaternions(quaternions)
    com, rate = side.com[::2], side.com_velocity[::2]
    within = np.einsum("nji,j->ni", turns, carried) - side.momentum[::2]
    spins = np.linalg.solve(side.inertia[::2], within[:, :, None])[:, :, 0]
    start = base[:3] + turns[0] @ com[0]
    speed = turns[0] @ (twist[:3] + np.cross(twist[3:6], com[0]) + rate[0])
    time = step * np.arange(len(com))[:, None]
    down = np.array([0.0, 0.0, GRAVITY])
    flown, flying = start + time * speed - 0.5 * time**2 * down, speed - time * down
    places = flown - np.einsum("nij,nj->ni", turns, com)
    linear = np.einsum("nji,nj->ni", turns, flying) - np.cross(spins, com) - rate
    return np.hstack([places, quaternions])[1:], np.hstack([linear, spins])[1:]


@dataclass(frozen=True)
class PushedSide:
    """What the joints' angles say at n instants, in the base's axes, under given contact forces.

    Attributes:
        inverse: of the base's block of the mass matrix, (n, 6, 6).
        lever: the sum over the contacts of r F', with r a contact point seen from the base [m] and
            F its force in the world [N], (n, 3, 3).
    """

    inverse: Array
    lever: Array


def pushed_side(
    pin: Any, model: Any, data: Any, points: Callable[[Array], Array], position: Array, force: Array
) -> PushedSide:
    """The same from joint angles (n, n_joints) and forces (n_contacts, 3); ``points`` gives the
    places of the contact points (n_contacts, 3) in a configuration."""
    inertia = np.empty((len(position), 6, 6))
    places = np.empty((len(position), *force.shape))
    q = np.zeros(model.nq)
    q[6] = 1.0
    for i, angles in enumerate(position):
        q[7:] = angles
        # Of the base's own block Pinocchio writes both triangles.
        inertia[i] = pin.crba(model, data, q)[:6, :6]
        places[i] = points(q)
    inverse = np.asarray(np.linalg.inv(inertia), dtype=np.float64)
    return PushedSide(inverse, np.einsum("nci,cj->nij", places, force))


def push(
    bias: Callable[[int, Array, Array], Array],
    base: Array,
    twist: Array,
    side: PushedSide,
    force: Array,
    moment: Array,
    step: float,
) -> tuple[Array, Array]:
    """The base after every step: its places (n, 7) and twists (n, 6).

    Args:
        bias: the base's part of the bias (6,) at an instant with a place and a twist of the base.
        base: its position [m] and quaternion (x, y, z, w) at the beginning, (7,).
        twist: its linear and angular velocity there [m/s, rad/s], in its own axes, (6,).
        side: what the joints say at the beginning, in the middle and at the end of every step, (2 n + 1).
        force: the sum of all contact forces [N], in the world, (3,).
        moment: what ``side`` does not know of their moment about the base [N m], in the world, (3,).
        step: how long one step is [s].
    """
    fx, fy, fz = force.tolist()
    mx, my, mz = moment.tolist()
    levers = side.lever.reshape(-1, 9).tolist()
    wrench, rate, rotation = np.empty(6), np.empty(13), np.empty((3, 3))

    def rates(i: int, place: Array, speed: Array) -> Array:
        """The derivative of base position, quaternion and twist, (13,)."""
        unit = place.copy()
        x, y, z, w = place[3:7].tolist()
        size = (x * x + y * y + z * z + w * w) ** -0.5
        x, y, z, w = x * size, y * size, z * size, w * size
        unit[3:7] = x, y, z, w
        # The base's axes in the world are the columns of this rotation.
        to_matrix(unit[3:7], rotation)
        (a, b, c), (d, e, f), (g, h, j) = rotation.tolist()
        # Of lever times rotation the sum over the contacts of r x R'F is the antisymmetric part.
        xx, xy, xz, yx, yy, yz, zx, zy, zz = levers[i]
        wrench[:] = (
            a * fx + d * fy + g * fz,
            b * fx + e * fy + h * fz,
            c * fx + f * fy + j * fz,
            yx * c + yy * f + yz * j - (zx * b + zy * e + zz * h) + a * mx + d * my + g * mz,
            zx * a + zy * d + zz * g - (xx * c + xy * f + xz * j) + b * mx + e * my + h * mz,
            xx * b + xy * e + xz * h - (yx * a + yy * d + yz * g) + c * mx + f * my + j * mz,
        )
        u, v, s, p, q, r = speed.tolist()
        rate[:7] = (
            a * u + b * v + c * s, d * u + e * v + f * s, g * u + h * v + j * s,
            0.5 * (w * p + y * r - z * q), 0.5 * (w * q + z * p - x * r),
            0.5 * (w * r + x * q - y * p), -0.5 * (x * p + y * q + z * r),
        )  # fmt: skip
        rate[7:] = side.inverse[i] @ (wrench - bias(i, unit, speed))
        return rate

    count = len(levers) // 2
    places, twists = np.empty((count, 7)), np.empty((count, 6))
    now = np.concatenate([base, twist])
    for n in range(count):
        i = 2 * n
        first = rates(i, now[:7], now[7:]).copy()
        there = now + 0.5 * step * first
        second = rates(i + 1, there[:7], there[7:]).copy()
        there = now + 0.5 * step * second
        third = rates(i + 1, there[:7], there[7:]).copy()
        there = now + step * third
        last = rates(i + 2, there[:7], there[7:])
        now = now + step / 6.0 * (first + 2.0 * (second + third) + last)
        now[3:7] /= np.linalg.norm(now[3:7])
        places[n], twists[n] = now[:7], now[7:]
    return places, twists


Motion = tuple[Array, Array, Array]
"""Joint angles, velocities and accelerations."""
AFTER, BEFORE = [1, 2, 0], [2, 0, 1]
"""The axes after and before each one: for cross products, which NumPy's own makes slowly."""


@dataclass(frozen=True)
class JointMotion:
    """The joints between two knots: the cubics through both ends' angles and velocities.

    Where the plan's joint acceleration is constant over the interval this is exactly its motion.
    """

    start: Array
    end: Array
    start_velocity: Array
    end_velocity: Array
    duration: float

    def at(self, time: float | Array) -> Motion:
        """Angles, velocities and accelerations [rad] at ``time`` since the first knot [s]; at n
        times (n, 1) each is (n, n_joints)."""
        t, u = self.duration, time / self.duration
        way = self.end - self.start
        bend = 3.0 * way - t * (2.0 * self.start_velocity + self.end_velocity)
        twist = t * (self.start_velocity + self.end_velocity) - 2.0 * way
        position = self.start + u * (t * self.start_velocity + u * (bend + u * twist))
        velocity = self.start_velocity + u / t * (2.0 * bend + 3.0 * u * twist)
        return position, velocity, (2.0 * bend + 6.0 * u * twist) / t**2


class ExactDynamics:
    """The whole-body model of a robot, with the rotors of its actuator profile in use."""

    def __init__(self, robot: RobotDescription) -> None:
        import pinocchio

        built = build_pinocchio_model(robot)
        self.pin: Any = pinocchio
        self.model = built.model
        self.data = built.model.createData()
        self.contact_frames = built.contact_frames
        self.sole_frames = built.sole_frames
        self.balls = ball_feet(robot)
        self.mass = robot.total_mass
        self._rotor_coupling = built.rotor_coupling
        self._known = np.zeros(self.model.nv)
        self._columns = [self._moving(frame) for frame in built.contact_frames]

    def _moving(self, frame: int) -> list[int]:
        """The generalised velocities that move a frame."""
        found = list[int]()
        for joint in self.model.supports[self.model.frames[frame].parentJoint]:
            first = self.model.joints[joint].idx_v
            found += range(first, first + self.model.joints[joint].nv) if joint > 0 else ()
        return found

    def contact_jacobians(self, q: Array) -> tuple[Array, Array]:
        """Contact points (n_contacts, 3) and their Jacobians (3 n_contacts, n_velocities), world
        axes."""
        pin = self.pin
        points = self.evaluated_points(q)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        rows = [
            np.array(pin.getFrameJacobian(self.model, self.data, frame, axes))
            for frame in self.contact_frames
        ]
        found = [row[:3] for row in rows]
        for ball in self.balls:
            # The material at the lowest point moves with the frame's origin and turns about it.
            frame = self.data.oMf[self.contact_frames[ball.point]]
            lever = np.empty((3, 3))
            skew(points[ball.point] - frame.translation, lever)
            found[ball.point] = rows[ball.point][:3] - lever @ rows[ball.point][3:]
        return points, np.vstack(found)

    def evaluated_points(self, q: Array) -> Array:
        """As ``points``, of a state whose Jacobians are evaluated as well, for ``sole_velocities``."""
        self.pin.computeJointJacobians(self.model, self.data, q)
        self.pin.updateFramePlacements(self.model, self.data)
        return self._contact_places()

    def points(self, q: Array) -> Array:
        """The contact points in the world [m], of balls the lowest points, (n_contacts, 3)."""
        self.pin.framesForwardKinematics(self.model, self.data, q)
        return self._contact_places()

    def soles(self, q: Array) -> tuple[Array, Array]:
        """The sole centres [m] (n_feet, 3), of balls the lowest points, and the feet's headings
        [rad] (n_feet,)."""
        self.pin.framesForwardKinematics(self.model, self.data, q)
        return self.sole_places(), self.foot_angles()[0]

    def footholds(self, heading: float = 0.0) -> Array:
        """What stays in place while the contact points stand on the ground, in the state that was
        evaluated last, (n_contacts, 3), in a stance of that ``heading`` [rad]; see
        ``SymbolicModel.footholds``."""
        places = self._contact_places()
        cosine, sine = math.cos(heading), math.sin(heading)
        for ball in self.balls:
            turn = self.data.oMf[self.contact_frames[ball.point]].rotation
            pitch, roll = math.atan2(-turn[2, 0], turn[2, 2]), math.asin(turn[2, 1])
            way = (cosine * pitch + sine * roll, sine * pitch - cosine * roll, 0.0)
            places[ball.point] -= ball.radius * np.array(way)
        return places

    def joint_places(self, q: Array) -> Array:
        """Where the joints are in the world [m], (n_joints, 3)."""
        self.pin.forwardKinematics(self.model, self.data, q)
        places = [self.data.oMi[joint].translation for joint in range(2, self.model.njoints)]
        return np.array(places).reshape(-1, 3)

    def sole_places(self) -> Array:
        """The sole centres in the state that was evaluated last."""
        places, points = self._places(self.sole_frames), self._contact_places()
        for ball in self.balls:
            places[ball.foot] = points[ball.point]
        return places

    def sole_velocities(self, v: Array) -> Array:
        """The velocities of ``sole_places`` in the state that was evaluated last, (n_feet, 3)."""
        pin, axes = self.pin, self.pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobians = [
            pin.getFrameJacobian(self.model, self.data, frame, axes) for frame in self.sole_frames
        ]
        rates = np.array([product(jacobian[:3], v) for jacobian in jacobians])
        for ball in self.balls:
            # The lowest point moves as the centre does, which is above the sole at the zero pose.
            up = self.data.oMf[self.sole_frames[ball.foot]].rotation[:, 2]
            turn = product(jacobians[ball.foot][3:], v)
            rates[ball.foot] += ball.radius * np.cross(turn, up)
        return rates

    def foot_angles(self) -> tuple[Array, Array]:
        """Heading and pitch of the feet [rad], both (n_feet,), in the state that was evaluated
        last. A ball has none of its own: it has the base's heading and no pitch."""
        ahead = [self.data.oMf[frame].rotation[:, 0] for frame in self.sole_frames]
        base = self.data.oMi[1].rotation
        yaw = np.array([math.atan2(y, x) for x, y, _ in ahead])
        pitch = np.array([math.atan2(-z, math.hypot(x, y)) for x, y, z in ahead])
        for ball in self.balls:
            yaw[ball.foot], pitch[ball.foot] = np.arctan2(base[1, 0], base[0, 0]), 0.0
        return yaw, pitch

    def _contact_places(self) -> Array:
        places = self._places(self.contact_frames)
        for ball in self.balls:
            turn = self.data.oMf[self.contact_frames[ball.point]].rotation
            places[ball.point] += ball.radius * (turn[:, 2] - np.array([0.0, 0.0, 1.0]))
        return places

    def _places(self, frames: tuple[int, ...]) -> Array:
        return np.array([self.data.oMf[frame].translation for frame in frames]).reshape(-1, 3)

    def com(self, q: Array) -> Array:
        """The centre of mass [m], (3,)."""
        return np.array(self.pin.centerOfMass(self.model, self.data, q))

    def centroidal(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Centre of mass [m], its velocity [m/s] and the angular momentum about it [N m s]."""
        momentum = self.pin.computeCentroidalMomentum(self.model, self.data, q, v)
        com = np.array(self.data.com[0])
        return com, np.array(momentum.linear) / self.mass, np.array(momentum.angular)

    def joint_side(self, position: Array, velocity: Array) -> JointSide:
        """What joint angles and velocities, both (n, n_joints), say; see ``JointSide``."""
        return joint_side(self.pin, self.model, self.data, position, velocity)

    def mass_matrix(self, q: Array) -> Array:
        """The joint-space inertia with all rotors."""
        matrix = np.triu(self.pin.crba(self.model, self.data, q))
        return np.asarray(matrix + np.triu(matrix, 1).T + self._rotor_coupling)

    def base_acceleration(self, q: Array, v: Array, joints: Array, force: Array) -> Array:
        """How the base accelerates (6,) if the joints do as given [rad/s^2] under these contact
        forces [N, world], (n_contacts, 3)."""
        return self._base_acceleration(q, v, joints, self._pushed_base(q, force))

    def base_residual(self, q: Array, v: Array, acceleration: Array, force: Array) -> Array:
        """What is left over of the base's six equations of motion [N or N m, its axes], (6,)."""
        moved = self.pin.rnea(self.model, self.data, q, v, acceleration)[:6]
        return np.asarray(moved - self._pushed_base(q, force))

    def _base_acceleration(self, q: Array, v: Array, joints: Array, pushed: Array) -> Array:
        self._known[6:] = joints
        bias = self.pin.rnea(self.model, self.data, q, v, self._known)[:6]
        # Of the base's own block Pinocchio writes both triangles.
        inertia = self.pin.crba(self.model, self.data, q)[:6, :6]
        return np.asarray(np.linalg.solve(inertia, pushed[:6] - bias))

    def joint_torque(
        self, q: Array, v: Array, joints: Array, force: Array, jacobian: Array | None = None
    ) -> Array:
        """The torques [N m] of that motion, (n_joints,), without friction. ``jacobian`` is that of
        ``contact_jacobians``, if it is known."""
        pushed = self._pushed(q, force) if jacobian is None else force.ravel() @ jacobian
        base = self._base_acceleration(q, v, joints, pushed)
        acceleration = np.concatenate([base, joints])
        whole = self.pin.rnea(self.model, self.data, q, v, acceleration)
        return np.asarray((whole + self._rotor_coupling @ acceleration - pushed)[6:])

    def _pushed_base(self, q: Array, force: Array) -> Array:
        """The base's part of J' F, (6,): the force and its moment about the base, in its axes."""
        arms = self.points(q) - q[:3]
        moments = arms[:, AFTER] * force[:, BEFORE] - arms[:, BEFORE] * force[:, AFTER]
        whole = np.array([force.sum(axis=0), moments.sum(axis=0)])
        return np.asarray((whole @ self.data.oMi[1].rotation).ravel())

    def _pushed(self, q: Array, force: Array) -> Array:
        """J' F: the generalised force of the contacts."""
        pushed = np.zeros(self.model.nv)
        if not force.any():
            return pushed
        jacobian = self.pin.computeJointJacobians(self.model, self.data, q)
        self.pin.updateFramePlacements(self.model, self.data)
        places = self._contact_places()
        moment = places[:, AFTER] * force[:, BEFORE] - places[:, BEFORE] * force[:, AFTER]
        for point, columns in enumerate(self._columns):
            column = jacobian[:, columns]
            pushed[columns] += force[point] @ column[:3] + moment[point] @ column[3:]
        return pushed

    def velocity_after_impact(
        self, q: Array, v: Array, impulse: Array, held: NDArray[np.bool_] | None = None
    ) -> tuple[Array, Array]:
        """The generalised velocity behind contact impulses [N s, world], (n_contacts, 3).

        Joints that are ``held`` (n_joints) keep their velocity, by impulses [N m s] (n_joints) of
        their motors, which come second; the other motors give none.
        """
        matrix, pushed = self.mass_matrix(q), self._pushed(q, impulse)
        fixed = np.zeros(self.model.nv, dtype=bool)
        if held is not None:
            fixed[6:] = held
        change = np.zeros(self.model.nv)
        free = ~fixed
        change[free] = np.linalg.solve(matrix[np.ix_(free, free)], pushed[free])
        return np.asarray(v + change), np.asarray((matrix @ change - pushed)[6:] * fixed[6:])

    def integrate(
        self, q: Array, v: Array, joints: JointMotion, force: Array, longest_step: float
    ) -> list[tuple[float, Array, Array]]:
        """The motion over one interval from the state (q, v) under constant contact forces, see
        ``push``, or without any, see ``coast``.

        Returns time since the interval began [s], q and v after every step; ``q`` is followed as
        position and quaternion, and the joints' part of both is the planned one.
        """
        count = max(1, int(np.ceil(joints.duration / longest_step - 1e-9)))
        h = joints.duration / count
        # The joints at the beginning, in the middle and at the end of every step.
        moved = joints.at(np.asarray(0.5 * h * np.arange(2 * count + 1)[:, None]))
        if force.any():
            bases, twists = self._push(q[:7], v[:6], moved, force, h)
        else:
            side = self.joint_side(moved[0], moved[1])
            bases, twists = coast(q[:7], v[:6], side, h)
        places = np.hstack([bases, moved[0][2::2]])
        speeds = np.hstack([twists, moved[1][2::2]])
        return [(h * (i + 1), places[i], speeds[i]) for i in range(count)]

    def _push(
        self, base: Array, twist: Array, moved: Motion, force: Array, h: float
    ) -> tuple[Array, Array]:
        """The base's places and twists after every step under contact forces."""
        angles, speeds, bends = moved
        side = pushed_side(self.pin, self.model, self.data, self._seen_from_base, angles, force)
        q, v = np.empty(self.model.nq), np.empty(self.model.nv)

        def bias(i: int, place: Array, speed: Array) -> Array:
            q[:7], q[7:], v[:6], v[6:] = place, angles[i], speed, speeds[i]
            self._known[6:] = bends[i]
            return np.asarray(self.pin.rnea(self.model, self.data, q, v, self._known)[:6])

        # From the centre of a ball its lowest point is one radius down in the world.
        moment = np.zeros(3)
        for ball in self.balls:
            x, y, _ = force[ball.point]
            moment += ball.radius * np.array([y, -x, 0.0])
        return push(bias, base, twist, side, force.sum(axis=0), moment, h)

    def _seen_from_base(self, q: Array) -> Array:
        """The contact points, of balls the centres, for a base in the world's origin and axes."""
        places = self.points(q)
        for ball in self.balls:
            places[ball.point, 2] += ball.radius
        return places


def rotation_between(first: Array, second: Array) -> float:
    """The angle [rad] between two unit quaternions."""
    # From half angles: an arc cosine would lose half the digits where the two are alike.
    half = min(float(np.linalg.norm(first - second)), float(np.linalg.norm(first + second)))
    return 4.0 * float(np.arcsin(min(1.0, 0.5 * half)))


def joint_motion(plan_position: Array, plan_velocity: Array, time: Array, knot: int) -> JointMotion:
    """The joints of a plan between that knot and the next."""
    return JointMotion(
        plan_position[knot, 7:],
        plan_position[knot + 1, 7:],
        plan_velocity[knot, 6:],
        plan_velocity[knot + 1, 6:],
        float(time[knot + 1] - time[knot]),
    )
