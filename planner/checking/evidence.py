"""The data that the tests of a plan share: the plan, its replay, and distances of bodies from the ground and each other.

Links are the collision shapes of the robot's description, as in the simulator. The ground is level, or leans
as the task says, with a step where the task has one. Everything is vectorised over instants.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...robots.description import Motors, RobotDescription
from ...robots.welding import welded
from ..models.euler_angles import euler_angles
from ..models.exact_dynamics import dynamics_of
from ..models.link_shapes import (
    MovingShape,
    arms,
    clearance_deficit,
    gaps_between,
    legs,
    moving_shapes,
)
from ..models.robot_model import model_of, stances_of
from ..models.symmetry import mirrored_pairs, symmetrised
from ..task.phase import Phase
from ..task.plan import PlannedJump
from ..task.scaling import ball_feet, per_robot
from ..task.sequence import LEVEL, edge_of, ground_axes
from ..task.task import JumpTask
from .replay import Replay

BALLS = 13
"""Along an edge, where the ground has edges."""


def step_edge(task: JumpTask, jump: int = 0) -> float | None:
    """Return the x at which the ground changes height under one of the task's jumps; see ``edge_of``."""
    return edge_of(task.hops()[jump], task.places()[jump])


def ground_height(
    task: JumpTask, x: Array, progress: Array | float, y: Array | float = 0.0
) -> Array:
    """Return the ground's height [m] at ``x``, ``y`` [m].

    ``progress``, of the same shape or the last axes of it, is how many flights are over, with the share of the present
    one's time: 1.5 in the middle of the second flight. Below 0 counts as 0, above all as all.
    """
    hops, places = task.hops(), task.places()
    if all(place.z == 0.0 and place.slope == LEVEL for place in places):
        return np.zeros(x.shape)
    # What follows from the progress alone is worked out in its own shape, which is smaller than that of ``x``.
    done = np.clip(progress, 0.0, len(hops))
    nearest = np.floor(done + 0.5).astype(np.int64)
    if task.leans:
        levels = np.array([np.broadcast_to(place.height(x, y), x.shape) for place in places])
        found = np.take_along_axis(levels, np.broadcast_to(nearest, x.shape)[np.newaxis], axis=0)[0]
    else:
        levels = np.array([place.z for place in places])
        found = levels[nearest]
    for number, hop in enumerate(hops):
        edge = edge_of(hop, places[number])
        if edge is None:
            continue
        beyond = x > edge if (hop.distance_x or 0.0) >= 0.0 else x < edge
        flying = (done > number) & (done < number + 1)
        found = np.where(beyond & (flying | (done == number)), levels[number + 1], found)
        found = np.where(~beyond & (flying | (done == number + 1)), levels[number], found)
    return np.broadcast_to(found, x.shape)


Shapes = Mapping[str, Sequence[MovingShape]]
"""The shapes of every link, by its name; see ``moving_shapes``."""


def body_heights(
    robot: RobotDescription, task: JumpTask, shapes: Shapes, progress: Array
) -> dict[str, Array]:
    """Return by link, except for soles, the lowest height [m] of its shapes above the ground, (n,).

    Balls at their corners stand for them. Where the ground has edges these are balls along the shapes' edges, close
    enough that no edge of a step passes between two, and a ball's height is that of its lower side above the ground
    right below it. What a foot that is a ball covers of its leg does not count.
    """
    feet = {foot.link for foot in robot.feet}
    ends = {robot.feet[ball.foot].link: ball for ball in ball_feet(robot) if ball.radius}
    uneven = task.leans or any(hop.landing_height or hop.gap for hop in task.hops())
    aside = np.linspace(-0.95, 0.95, 7)[:, None, None]
    found = {}
    for link in robot.links:
        ball = ends.get(link.name)
        if (link.name in feet and ball is None) or not link.shapes:
            continue
        heights = []
        for each, centres in ((e, line) for e in shapes[link.name] for line in _balls(e, uneven)):
            radius = each.shape.radius
            if ball is not None:
                apart = np.linalg.norm(
                    centres[:, 0] - each.position[0] - each.rotation[0] @ ball.centre, axis=1
                )
                centres = centres[apart > ball.radius + radius]
                if not len(centres):
                    continue
            if not uneven:
                heights.append((centres[:, :, 2] - radius).min(axis=0))
                continue
            x = centres[:, :, 0] + radius * aside
            below = centres[:, :, 2] - radius * np.sqrt(1.0 - aside**2)
            ground = ground_height(task, x, progress, centres[:, :, 1])
            heights.append((below - ground).min(axis=(0, 1)))
        if heights:
            found[link.name] = np.min(heights, axis=0)
    return found


def _balls(shape: MovingShape, along: bool) -> list[Array]:
    """Return the centres of the balls that stand for a shape: at its corners, or ``along`` each of its edges,
    (n_balls, n, 3).
    """
    if not along:
        return [shape.corners]
    shares = np.linspace(0.0, 1.0, BALLS)[:, None, None]
    return [start + shares * (stop - start) for start, stop in shape.edges()]


def arm_clearance_deficit(
    robot: RobotDescription, shapes: Shapes, wanted: float
) -> tuple[Array, str] | None:
    """Return the same as ``leg_clearance_deficit`` between each of the ``arms`` and all that is no part of it; and which link lacks
    most. ``None`` where no arm has shapes that could touch.
    """
    parent = {joint.child: joint.parent for joint in robot.joints}
    lack: Array | None = None
    worst_link, most = "", -np.inf
    for arm in arms(robot):
        for link in arm:
            for other in robot.links:
                if other.name in arm:
                    continue
                if not (shapes[link] and shapes[other.name]):
                    continue
                near = gaps_between(shapes[link], shapes[other.name])
                found = clearance_deficit(near, wanted, 0, carried=other.name == parent[link])
                lack = found if lack is None else np.maximum(lack, found)
                if found.max() > most:
                    most, worst_link = float(found.max()), f"{link} at {other.name}"
    return None if lack is None else (lack, worst_link)


def leg_clearance_deficit(robot: RobotDescription, shapes: Shapes, wanted: float) -> Array | None:
    """Return the distance [m] by which the links of different legs are closer than ``wanted``, or than at the first
    instant where they stand closer than that, the worst at each instant (n,); ``None`` where no two legs have shapes.
    """
    lack: Array | None = None
    for gap in _gaps(robot, shapes):
        found = clearance_deficit(gap, wanted, 0)
        lack = found if lack is None else np.maximum(lack, found)
    return lack


def _gaps(robot: RobotDescription, shapes: Shapes) -> Iterator[Array]:
    """Yield the distances (pairs, n) between all shapes of one leg and all of another."""
    chains = [[shape for link in chain for shape in shapes[link]] for chain in legs(robot)]
    for number, chain in enumerate(chains):
        for other in chains[number + 1 :]:
            if chain and other:
                yield gaps_between(chain, other)


@per_robot
def _asymmetric(robot: RobotDescription) -> bool:
    """Return ``Evidence.asymmetric``."""
    robot = welded(robot).robot
    pairs = mirrored_pairs(robot)
    return pairs is not None and symmetrised(robot, pairs) != robot


DEGREE = math.pi / 180.0
MILLIMETRE = 1e-3


@dataclass(frozen=True)
class PlanTestResult:
    """Result of a test: it passes where ``value`` is at most ``limit``."""

    name: str
    value: float
    limit: float
    unit: str
    text: str
    where: str = ""


@dataclass(frozen=True)
class Evidence:
    """A plan, its replay, and what several tests need of them."""

    plan: PlannedJump
    robot: RobotDescription
    replay: Replay

    @cached_property
    def effort(self) -> Array:
        """The share of the motors' limits that the plan may use at every sample, (n, 1)."""
        task = self.plan.task
        landed = self.plan.phase[self.replay.samples.knot] == Phase.LANDING
        return np.where(landed, task.landing_effort, task.effort)[:, np.newaxis]

    @property
    def motors(self) -> Motors:
        """Abilities of every motor."""
        return self.robot.motors

    @cached_property
    def asymmetric(self) -> bool:
        """True if the robot is nearly the same left and right but not exactly: its plans in mirrored coordinates are
        made for the robot that is.
        """
        return _asymmetric(self.robot)

    def model_error(self, exact: float, nearly: float) -> float:
        """Return the tolerance of a test of the planner's own equations: ``exact``, or ``nearly`` where the planner's
        model is the robot made the same left and right.
        """
        return nearly if self.asymmetric else exact

    @cached_property
    def motor_torque(self) -> Array:
        """Motor torques at the samples [N m], by exact dynamics, (n, n_joints)."""
        return np.asarray(self.replay.samples.torque @ self.robot.torque_to_motor.T)

    @cached_property
    def motor_speed(self) -> Array:
        """Motor speeds at the samples [rad/s], (n, n_joints)."""
        return np.asarray(self.replay.samples.velocity[:, 6:] @ self.robot.joint_to_motor.T)

    @cached_property
    def middles(self) -> NDArray[np.int64]:
        """The sample nearest to the middle of every interval that lasts."""
        time, samples = self.plan.time, self.replay.samples
        apart = np.abs(samples.time - (0.5 * (time[:-1] + time[1:]))[samples.knot])
        first = np.searchsorted(samples.knot, np.arange(len(time) - 1))
        nearest = np.flatnonzero(apart == np.minimum.reduceat(apart, first)[samples.knot])
        found = nearest[np.searchsorted(nearest, first)]
        return np.asarray(found[self.plan.lasting], np.int64)

    @cached_property
    def shapes(self) -> Shapes:
        """The links' shapes at the samples."""
        poses = dynamics_of(self.robot).link_poses(self.replay.samples.position)
        return moving_shapes(self.robot, poses)

    @cached_property
    def progress(self) -> Array:
        """Number of flights that are over at the samples, with the share of the present one's time."""
        time = self.replay.samples.time
        return np.asarray(
            sum(
                np.clip((time - start) / (end - start), 0.0, 1.0)
                for start, end in self.plan.flights
            )
        )

    @cached_property
    def place(self) -> NDArray[np.int64]:
        """Number of flights that are over at the samples."""
        return np.asarray(np.searchsorted(self.plan.touchdown_times, self.replay.samples.time,
                                          side="right"))  # fmt: skip

    @cached_property
    def forces(self) -> Array:
        """The contact forces at the knots along the axes of the ground there [N], the last one normal
        to it, (N, n_contacts, 3)."""
        plan, places = self.plan, self.plan.task.places()
        over = np.searchsorted(plan.touchdown_times, plan.time + 1e-9, side="right")
        axes = np.array([ground_axes(place.slope) for place in places])[over]
        return np.asarray(np.einsum("ncj,nji->nci", plan.contact_force, axes))

    @cached_property
    def start_joints(self) -> Array:
        """The joint angles [rad] with which the plan should begin, (n_joints,)."""
        task, names = self.plan.task, [joint.name for joint in self.robot.joints]
        angles = task.start_joints(self.robot)
        if task.leans:
            model, finder = model_of(self.robot)
            first = stances_of(task, self.robot, finder)[0].coordinates[6:]
            angles |= dict(zip((joint.name for joint in model.robot.joints), first, strict=True))
        return np.array([angles[name] for name in names])

    @cached_property
    def point_height(self) -> Array:
        """The contact points' height above the ground at the samples [m], (n, n_contacts)."""
        points = self.replay.samples.points
        progress = np.repeat(self.progress[:, None], points.shape[1], axis=1)
        return np.asarray(
            points[:, :, 2]
            - ground_height(self.plan.task, points[:, :, 0], progress, points[:, :, 1])
        )

    @cached_property
    def base_height(self) -> Array:
        """The base's height above the ground at the samples [m], (n,)."""
        place = self.replay.samples.position
        ground = ground_height(self.plan.task, place[:, 0], self.progress, place[:, 1])
        return np.asarray(place[:, 2] - ground)

    @cached_property
    def resting(self) -> Array:
        """Places that stay fixed while a contact point stands on the ground [m], (n, n_contacts, 3): the point itself;
        of a ball, which rolls, the way of the material where it touches.
        """
        s = self.replay.samples
        places = s.points.copy()
        steps = np.diff(s.time)[:, None]
        for ball in ball_feet(self.robot):
            rate = s.point_velocity[:, ball.point, :2]
            way = 0.5 * steps * (rate[1:] + rate[:-1])
            places[1:, ball.point, :2] = places[0, ball.point, :2] + np.cumsum(way, axis=0)
        return places

    @cached_property
    def rises(self) -> list[float]:
        """The apexes above standing where each jump begins that the exact states at lift-off lead
        to [m]."""
        r, found = self.replay, []
        for (k, _), place in zip(r.flights, self.plan.task.places(), strict=False):
            up = float(r.com_velocity[k, 2])
            standing = float(r.com[0, 2]) + place.z
            found.append(float(r.com[k, 2]) - standing + max(up, 0.0) ** 2 / (2.0 * GRAVITY))
        return found

    @cached_property
    def turn(self) -> tuple[float, float]:
        """Turn of the base in pitch and in yaw from first knot to last [rad].

        The angles are those of R = Ry Rx Rz, followed through full turns.
        """
        angles = euler_angles(self.replay.samples.position[:, 3:7])
        _, pitch, yaw = angles[-1] - angles[0]
        return float(pitch), float(yaw)

    def moment(self, sample: int) -> str:
        """Return the time of a sample as text."""
        return f"at {self.replay.samples.time[sample]:.3f} s"

    def figures(self) -> dict[str, float]:
        """Return the plan's performance and loads, by name with unit."""
        r, lasting = self.replay, self.plan.lasting
        force = self.plan.contact_force[:-1][lasting].sum(axis=1)[:, 2]
        k = r.flights[0][0]
        return {
            "rise_m": self.rises[0],
            "take_off_speed_m_s": float(r.com_velocity[k, 2]),
            "flight_time_s": self.plan.flight_time,
            "duration_s": self.plan.duration,
            "peak_motor_torque_N_m": float(np.abs(self.motor_torque).max()),
            "peak_motor_speed_rad_s": float(np.abs(self.motor_speed).max()),
            "peak_vertical_force_N": float(force.max()),
            "pitch_momentum_at_lift_off_N_m_s": float(r.angular_momentum[k, 1]),
            "flight_error_mm": max(error for error, _ in r.flight_errors) / MILLIMETRE,
            "flight_error_deg": max(error for _, error in r.flight_errors) / DEGREE,
            "jumps": float(len(r.flights)),
        }


def worst(array: Array) -> tuple[int, int]:
    """Return the row and column of the largest number."""
    row, column = np.unravel_index(int(array.argmax()), array.shape)
    return int(row), int(column)
