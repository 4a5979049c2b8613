"""The robot's exact equations of motion, for checking plans: no solver, and nothing of the planner's own model.

The joints move as planned and the contact forces are the planned ones; how the base then moves, and what the joints need,
follows from them (``mathematics/whole_body_motion.py``). Many instants are evaluated at once. Configurations of
which one is needed are Pinocchio's, with which tests compare the rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.body_dynamics import body_motion
from ...mathematics.compiling.kernel_on_rows import KernelOnRows
from ...mathematics.constants import GRAVITY
from ...mathematics.interpolation import cubic_motion
from ...mathematics.pushed_motion import (
    PushedTurns,
    SeenMotion,
    Stretches,
    follow_stretches,
    see_motion,
    turn_memory,
)
from ...mathematics.rotations import cross_products, matrices_of_quaternions, skew
from ...mathematics.whole_body_motion import (
    FixedPoints,
    GivenMotion,
    MotionTerms,
    evaluate_motion,
    motion_memory,
    set_poses_at_instants,
    velocities_at_points,
)
from ...robots.description import RobotDescription
from ...robots.kinematics import LinkPoses, ball_feet, body_tree
from ...robots.pinocchio_model import build_pinocchio_model
from ..task.scaling import per_robot
from .euler_angles import times, times_transposed

WHOLE = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]
"""Places of the parts xx, yy, zz, xy, xz, yz of an inertia in its matrix."""
Motion = tuple[Array, Array, Array]
"""Places, rates and the rates' changes."""
AFTER, BEFORE = [1, 2, 0], [2, 0, 1]
"""The axes after and before each one: for cross products, which NumPy's own makes slowly."""


class Segments(NamedTuple):
    """Motions over some steps each under constant contact forces, n in all.

    Attributes:
        base, twist: place and quaternion (n, 7) of the base at the beginnings, and its velocity in its axes (n, 6).
        angles, speeds: of the joints at the beginning, in the middle and at the end of every step, of one motion behind
            the other, (2 n_steps + n, n_joints).
        force: of the contacts [N, world], (n, n_contacts, 3).
        steps: how long every step is [s], (n_steps,).
        counts: the numbers of steps, (n,).
    """

    base: Array
    twist: Array
    angles: Array
    speeds: Array
    force: Array
    steps: Array
    counts: NDArray[np.int64]

    @classmethod
    def joined(cls, parts: Sequence[Segments]) -> Segments:
        """Return some of them in a row."""
        return cls(*map(np.concatenate, zip(*parts, strict=True)))


class FeetStates(NamedTuple):
    """States of the feet in n states: the centre of mass, its velocity and the angular momentum about it (n, 3), the
    contact points (n, n_contacts, 3), sole centres and their velocities (n, n_feet, 3), of balls the lowest points, and
    the feet's yaw and pitch [rad] (n, n_feet).
    """

    com: Array
    com_velocity: Array
    momentum: Array
    points: Array
    soles: Array
    sole_velocity: Array
    yaw: Array
    pitch: Array


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
        self._rotors = robot.rotor_matrix
        self._tree = body_tree(robot)
        self._fixed = self._fixed_points(robot)
        self._motions: dict[int, KernelOnRows] = {}
        self._poses = KernelOnRows(set_poses_at_instants, self._of_poses)
        self._seen = KernelOnRows(see_motion, self._of_seen)
        self._stretches = KernelOnRows(
            follow_stretches, partial(_of_stretches, len(robot.contacts))
        )
        self._speeds = KernelOnRows(velocities_at_points, self._of_speeds)
        self._links = (robot.base, *(joint.child for joint in robot.joints))
        self._columns = [self._moving(frame) for frame in built.contact_frames]
        self._foot_moves = np.zeros((len(built.sole_frames), self.model.nv), np.bool_)
        for moves, frame in zip(self._foot_moves, built.sole_frames, strict=True):
            moves[self._moving(frame)] = True

    def _fixed_points(self, robot: RobotDescription) -> FixedPoints:
        """Return the contact points and behind them the sole centres. Of balls both are the lowest point."""
        bodies = [robot.base, *(joint.child for joint in robot.joints)]
        feet, owners = robot.feet, robot.foot_of_contact()
        places = [list(c.position) for c in robot.contacts] + [list(foot.sole) for foot in feet]
        body = [bodies.index(feet[foot].link) for foot in (*owners, *range(len(feet)))]
        below = np.zeros(len(places))
        for ball in self.balls:
            for number in (ball.point, len(robot.contacts) + ball.foot):
                places[number], below[number] = ball.centre.tolist(), ball.radius
        return FixedPoints(np.array(body, dtype=np.int64), np.array(places).reshape(-1, 3), below)

    def _moving(self, frame: int) -> list[int]:
        """Return the generalised velocities that move a frame."""
        found = list[int]()
        for joint in self.model.supports[self.model.frames[frame].parentJoint]:
            first = self.model.joints[joint].idx_v
            found += range(first, first + self.model.joints[joint].nv) if joint > 0 else ()
        return found

    def contact_jacobians(self, q: Array) -> tuple[Array, Array]:
        """Return the contact points (n_contacts, 3) and their Jacobians (3 n_contacts, n_velocities), world axes."""
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
        """Return the result of ``points``, with the state's Jacobians evaluated as well."""
        self.pin.computeJointJacobians(self.model, self.data, q)
        self.pin.updateFramePlacements(self.model, self.data)
        return self._contact_places()

    def points(self, q: Array) -> Array:
        """Return the contact points in the world [m], of balls the lowest points, (n_contacts, 3)."""
        self.pin.framesForwardKinematics(self.model, self.data, q)
        return self._contact_places()

    def soles(self, q: Array) -> tuple[Array, Array]:
        """Return the sole centres [m] (n_feet, 3), of balls the lowest points, and the feet's headings [rad]
        (n_feet,).
        """
        self.pin.framesForwardKinematics(self.model, self.data, q)
        return self.sole_places(), self.foot_angles()[0]

    def footholds(self, heading: float = 0.0) -> Array:
        """Return the places that stay fixed while the contact points stand on the ground, in the state that was
        evaluated last, (n_contacts, 3), in a stance of that ``heading`` [rad]; see ``SymbolicModel.footholds``.
        """
        places = self._contact_places()
        cosine, sine = math.cos(heading), math.sin(heading)
        for ball in self.balls:
            turn = self.data.oMf[self.contact_frames[ball.point]].rotation
            pitch, roll = math.atan2(-turn[2, 0], turn[2, 2]), math.asin(turn[2, 1])
            way = (cosine * pitch + sine * roll, sine * pitch - cosine * roll, 0.0)
            places[ball.point] -= ball.radius * np.array(way)
        return places

    def joint_places(self, q: Array) -> Array:
        """Return the places of the joints in the world [m], (n_joints, 3)."""
        self.pin.forwardKinematics(self.model, self.data, q)
        places = [self.data.oMi[joint].translation for joint in range(2, self.model.njoints)]
        return np.array(places).reshape(-1, 3)

    def sole_places(self) -> Array:
        """Return the sole centres in the state that was evaluated last."""
        places, points = self._places(self.sole_frames), self._contact_places()
        for ball in self.balls:
            places[ball.foot] = points[ball.point]
        return places

    def feet(self, position: Array, velocity: Array) -> FeetStates:
        """Return what a reference of the controller holds of n states."""
        pin, model, data = self.pin, self.model, self.data
        count = len(position)
        columns, _, places, speeds, _, rates = self._speeds.rows(count)
        # What Pinocchio computes is written in memory that stays. There the frames follow each other, each with the
        # columns of its rotation and its place, and the linear momentum and the angular one.
        first, second = (data.oMf[k].rotation.T for k in range(2))
        apart = second.ctypes.data - first.ctypes.data
        place, momentum = data.com[0], as_strided(data.hg.linear, (6,), (8,), writeable=False)
        jacobian = data.J.T
        placed = as_strided(first, (len(data.oMf), 4, 3), (apart, 24, 8), writeable=False)
        com, spatial = np.empty((count, 3)), np.empty((count, 6))
        frames = np.empty((count, *placed.shape))
        for i, (q, v) in enumerate(zip(position, velocity, strict=True)):
            pin.computeCentroidalMomentum(model, data, q, v)
            pin.computeJointJacobians(model, data)
            pin.updateFramePlacements(model, data)
            com[i], spatial[i], columns[i], frames[i] = place, momentum, jacobian, placed
        contacts, soles = frames[:, self.contact_frames], frames[:, self.sole_frames]
        points, up = contacts[:, :, 3], soles[:, :, 2]
        places[:], speeds[:] = soles[:, :, 3], velocity
        # The base's own first axis is the linear part of the column that it moves along.
        yaw, pitch = self._angles(soles[:, :, 0], columns[:, 0, :3])
        self._speeds.run()
        places, rates = places.copy(), rates.copy()
        for ball in self.balls:
            points[:, ball.point] += ball.radius * (
                contacts[:, ball.point, 2] - np.array([0.0, 0.0, 1.0])
            )
            places[:, ball.foot] = points[:, ball.point]
            # The lowest point moves as the centre does, which is above the sole at the zero pose.
            turn = rates[:, ball.foot, 3:]
            rates[:, ball.foot, :3] += ball.radius * cross_products(turn, up[:, ball.foot])
        return FeetStates(
            com,
            spatial[:, :3] / self.mass,
            spatial[:, 3:],
            points,
            places,
            rates[:, :, :3],
            yaw,
            pitch,
        )

    def _of_speeds(self, count: int) -> tuple[Any, ...]:
        """Return the arguments of ``velocities_at_points`` for the sole centres."""
        feet, size = self._foot_moves.shape
        return (
            np.zeros((count, size, 6)), self._foot_moves, np.zeros((count, feet, 3)),
            np.zeros((count, size)), np.zeros((6, size)), np.zeros((count, feet, 6)),
        )  # fmt: skip

    def foot_angles(self) -> tuple[Array, Array]:
        """Return the heading and pitch of the feet [rad], both (n_feet,), in the state that was evaluated last. A ball
        has none of its own: it has the base's heading and no pitch.
        """
        ahead = [self.data.oMf[frame].rotation[:, 0] for frame in self.sole_frames]
        yaw, pitch = self._angles(
            np.array(ahead).reshape(1, -1, 3), np.array(self.data.oMi[1].rotation[:, 0])[None]
        )
        return yaw[0], pitch[0]

    def _angles(self, ahead: Array, base: Array) -> tuple[Array, Array]:
        """Return the same, both (n, n_feet), of the first axes of feet (n, n_feet, 3) and of a base (n, 3)."""
        x, y, down = (
            each.ravel().tolist() for each in (ahead[..., 0], ahead[..., 1], -ahead[..., 2])
        )
        yaw = np.array([*map(math.atan2, y, x)]).reshape(ahead.shape[:-1])
        pitch = np.array([*map(math.atan2, down, map(math.hypot, x, y))]).reshape(yaw.shape)
        for ball in self.balls:
            yaw[:, ball.foot], pitch[:, ball.foot] = np.arctan2(base[:, 1], base[:, 0]), 0.0
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
        """Return the centre of mass [m], (3,)."""
        return np.array(self.pin.centerOfMass(self.model, self.data, q))

    def centroidal(self, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return the centre of mass [m], its velocity [m/s] and the angular momentum about it [N m s]."""
        momentum = self.pin.computeCentroidalMomentum(self.model, self.data, q, v)
        com = np.array(self.data.com[0])
        return com, np.array(momentum.linear) / self.mass, np.array(momentum.angular)

    def motion(
        self,
        position: Array,
        velocity: Array,
        bend: Array | None = None,
        force: Array | None = None,
    ) -> MotionTerms:
        """Return what follows from the states (n, n_positions) and (n, n_velocities) of n instants, the joints'
        accelerations (n, n_joints) and the contact forces (n, n_contacts, 3) [N, world]; both are zero if they are not
        given.

        The torques are those of the joints with their rotors, without friction. The points are the contact
        points and behind them the sole centres.
        """
        pushed = 0 if force is None else force.shape[1]
        if pushed not in self._motions:
            self._motions[pushed] = KernelOnRows(evaluate_motion, partial(self._of_motion, pushed))
        call = self._motions[pushed]
        _, _, given, _, terms = call.rows(len(position))
        given.position[:], given.velocity[:] = position, velocity
        given.bend[:] = 0.0 if bend is None else bend
        if force is not None:
            given.force[:] = force
        call.run()
        found = MotionTerms(*(array.copy() for array in terms))
        found.torque[:] += given.bend @ self._rotors.T
        return found

    def _of_motion(self, pushed: int, count: int) -> tuple[Any, ...]:
        """Return the arguments of ``evaluate_motion`` with forces on so many points."""
        joints, points = len(self._rotors), (len(self._fixed.body), 3)
        shapes = (
            (count, 3), (count, 3), (count, 3), (count, 6), (count, *points), (count, *points),
            (count, *points), (count, 6), (count, joints),
        )  # fmt: skip
        given = GivenMotion(
            np.zeros((count, 7 + joints)), np.zeros((count, 6 + joints)), np.zeros((count, joints)),
            np.zeros((count, pushed, 3)),
        )  # fmt: skip
        terms = MotionTerms(*(np.zeros(shape) for shape in shapes))
        return self._tree, self._fixed, given, motion_memory(joints), terms

    def link_poses(self, position: Array) -> LinkPoses:
        """Return the poses of the links in n states (n, n_positions), the base first."""
        _, given, _, place, rotation = self._poses.rows(len(position))
        given[:] = position
        self._poses.run()
        return LinkPoses(self._links, place.copy(), rotation.reshape(*place.shape, 3).copy())

    def _of_poses(self, count: int) -> tuple[Any, ...]:
        """Return the arguments of ``set_poses_at_instants``."""
        links = len(self._links)
        return (
            self._tree, np.zeros((count, self.model.nq)), body_motion(len(self._rotors)),
            np.zeros((count, links, 3)), np.zeros((count, links, 9)),
        )  # fmt: skip

    def standing_inertia(self, joints: Array) -> tuple[Array, Array]:
        """Return the centre of mass [m] (3,) and the inertia about it [kg m^2] (3, 3) of a robot with those joint
        angles, as rigid, seen from its base.
        """
        seen = self._seen_motion(joints[None], np.zeros((1, len(joints))))
        return seen.com[0].copy(), seen.inertia[0][WHOLE]

    def _seen_motion(self, angles: Array, speeds: Array) -> SeenMotion:
        """Return what the joints' motion, both (n, n_joints), shows from the base, until the next call."""
        _, _, own_angles, own_speeds, _, seen = self._seen.rows(len(angles))
        own_angles[:], own_speeds[:] = angles, speeds
        self._seen.run()
        found: SeenMotion = seen
        return found

    def _of_seen(self, count: int) -> tuple[Any, ...]:
        """Return the arguments of ``see_motion``."""
        joints, contacts, fixed = len(self._rotors), len(self.contact_frames), self._fixed
        return (
            self._tree, FixedPoints(fixed.body[:contacts], fixed.place[:contacts], fixed.below[:contacts]),
            np.zeros((count, joints)), np.zeros((count, joints)), motion_memory(joints),
            _seen_memory(count, contacts),
        )  # fmt: skip

    def mass_matrix(self, q: Array) -> Array:
        """Return the joint-space inertia with all rotors."""
        matrix = np.triu(self.pin.crba(self.model, self.data, q))
        return np.asarray(matrix + np.triu(matrix, 1).T + self._rotor_coupling)

    def base_residual(
        self, position: Array, velocity: Array, acceleration: Array, force: Array
    ) -> Array:
        """Return the residual of the base's six equations of motion [N or N m, its axes], (n, 6), at n instants with
        accelerations (n, n_velocities), the base's in its axes.
        """
        terms = self.motion(position, velocity, acceleration[:, 6:], force)
        turn = matrices_of_quaternions(position[:, 3:7])
        missed = acceleration[:, :6] - terms.base
        com = times_transposed(turn, terms.com - position[:, :3])
        pull = self.mass * (missed[:, :3] + cross_products(missed[:, 3:], com))
        moment = times(terms.inertia[:, WHOLE], times(turn, missed[:, 3:]))
        return np.hstack([pull, times_transposed(turn, moment) + cross_products(com, pull)])

    def joint_torque(self, q: Array, v: Array, joints: Array, force: Array) -> Array:
        """Return the torques [N m] of one instant, (n_joints,), without friction."""
        found: Array = self.motion(q[None], v[None], joints[None], force[None]).torque[0]
        return found

    def _pushed(self, q: Array, force: Array) -> Array:
        """Return J' F, the generalised force of the contacts."""
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
        """Return the generalised velocity behind contact impulses [N s, world], (n_contacts, 3).

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

    def follow(self, segments: Segments) -> tuple[Array, Array]:
        """Return the states after every step of all segments in turn: (n_steps, n_positions) and (n_steps,
        n_velocities).
        """
        base, twist, angles, speeds, force, steps, counts = segments
        first = np.concatenate([[0], np.cumsum(counts)])
        of_step = np.repeat(np.arange(len(counts)), counts)
        over = np.cumsum(steps)
        call = self._stretches
        seen, given, _, pushed, place, velocity = call.rows(len(angles), len(steps), len(counts))
        for own, found in zip(seen, self._seen_motion(angles, speeds), strict=True):
            own[:] = found
        seen.inverse[:] = np.linalg.inv(seen.inertia[:, WHOLE])
        given.step[:], given.first[:], given.base[:], given.twist[:] = steps, first, base, twist
        given.passed[:] = over - np.concatenate([[0.0], over])[first[of_step]]
        given.force[:] = force
        given.fall[:] = force.sum(axis=1) / self.mass - np.array([0.0, 0.0, GRAVITY])
        # From the centre of a ball its lowest point is one radius down in the world.
        given.moment[:] = 0.0
        for ball in self.balls:
            given.moment[:, 0] += ball.radius * force[:, ball.point, 1]
            given.moment[:, 1] -= ball.radius * force[:, ball.point, 0]
        call.run()
        ends = 2 * np.arange(1, len(steps) + 1) + of_step
        return (
            np.hstack([place, pushed.orientation, angles[ends]]),
            np.hstack([velocity, speeds[ends]]),
        )


def _of_stretches(contacts: int, instants: int, steps: int, count: int) -> tuple[Any, ...]:
    """Return the arguments of ``follow_stretches``."""
    given = Stretches(
        np.zeros(steps), np.zeros(steps), np.zeros(count + 1, np.int64), np.zeros((count, 7)), np.zeros((count, 6)),
        np.zeros((count, contacts, 3)), np.zeros((count, 3)), np.zeros((count, 3)),
    )  # fmt: skip
    pushed = PushedTurns(
        np.zeros((instants, 3)), np.zeros((instants, 3, 3)), np.zeros((steps, 4)), np.zeros((steps, 3))
    )  # fmt: skip
    return (
        _seen_memory(instants, contacts), given, turn_memory(), pushed, np.zeros((steps, 3)), np.zeros((steps, 6)),
    )  # fmt: skip


def _seen_memory(count: int, contacts: int) -> SeenMotion:
    return SeenMotion(
        np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 6)),
        np.zeros((count, 3, 3)), np.zeros((count, contacts, 3)),
    )  # fmt: skip


@per_robot
def dynamics_of(robot: RobotDescription) -> ExactDynamics:
    """Return the dynamics of a robot, made once."""
    return ExactDynamics(robot)


def rotation_between(first: Array, second: Array) -> Array:
    """Return the angles [rad] (...) between unit quaternions (..., 4)."""
    # From half angles: an arc cosine would lose half the digits where the two are alike.
    half = np.minimum(
        np.linalg.norm(first - second, axis=-1), np.linalg.norm(first + second, axis=-1)
    )
    return np.asarray(4.0 * np.arcsin(np.minimum(1.0, 0.5 * half)))


def states_between(
    place: Array, rate: Array, time: Array, knots: NDArray[np.int64], passed: Array
) -> Motion:
    """Return the places and rates of a motion and the rates' changes, each (n, m), at times ``passed`` since some knots,
    both (n,): the cubics through the places and rates (n_knots, m) of each of these and the knot behind it.

    Where the rates change evenly over an interval this is exactly the motion. At an impact, whose knots are at one time,
    only a passed time of zero has a meaning.
    """
    call = _cubics(place.shape[1])
    own_place, own_rate, own_time, own_knots, own_passed, *found = call.rows(len(time), len(knots))
    own_place[:], own_rate[:], own_time[:] = place, rate, time
    own_knots[:], own_passed[:] = knots, passed
    call.run()
    places, rates, changes = (each.copy() for each in found)
    return places, rates, changes


@cache
def _cubics(width: int) -> KernelOnRows:
    """Return the call of ``cubic_motion`` for so many coordinates."""
    return KernelOnRows(
        cubic_motion,
        lambda knots, n: (
            np.zeros((knots, width)), np.zeros((knots, width)), np.zeros(knots), np.zeros(n, np.int64), np.zeros(n),
            np.zeros((n, width)), np.zeros((n, width)), np.zeros((n, width)),
        ),
    )  # fmt: skip


def half_steps(
    position: Array, velocity: Array, time: Array, force: Array, knots: NDArray[np.int64]
) -> Segments:
    """Return the intervals of a plan from its states at some knots, each in two steps."""
    lengths = time[knots + 1] - time[knots]
    quarters = (np.arange(5) * (0.25 * lengths)[:, None]).ravel()
    angles, speeds, _ = states_between(
        position[:, 7:], velocity[:, 6:], time, np.repeat(knots, 5), quarters
    )
    return Segments(
        position[knots, :7], velocity[knots, :6], angles, speeds, force[knots],
        np.repeat(0.5 * lengths, 2), np.full(len(knots), 2),
    )  # fmt: skip
