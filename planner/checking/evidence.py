"""The data that the tests of a plan share: the plan, its replay, and quantities derived from both."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...blocks.signals import Phase
from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...robots.description import Motors, RobotDescription
from ...robots.kinematics import LinkPoses, ball_feet, link_poses, matrices_of_quaternions
from ...robots.welding import welded
from ..models.symmetry import mirrored_pairs, symmetrised
from ..task.plan import JumpPlan
from .clearance import ground_height
from .replay import Replay

DEGREE = math.pi / 180.0
MILLIMETRE = 1e-3


@dataclass(frozen=True)
class Found:
    """What a test found: it passes where ``value`` is at most ``limit``."""

    name: str
    value: float
    limit: float
    unit: str
    text: str
    where: str = ""


@dataclass(frozen=True)
class Evidence:
    """A plan, its replay, and what several tests need of them."""

    plan: JumpPlan
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
        """What every motor can do."""
        return self.robot.motors

    @cached_property
    def asymmetric(self) -> bool:
        """Whether the robot is nearly the same left and right but not exactly: its plans in
        mirrored coordinates are made for the robot that is."""
        robot = welded(self.robot).robot
        pairs = mirrored_pairs(robot)
        return pairs is not None and symmetrised(robot, pairs) != robot

    def model_error(self, exact: float, nearly: float) -> float:
        """What a test of the planner's own equations allows: ``exact``, or ``nearly`` where the
        planner's model is the robot made the same left and right."""
        return nearly if self.asymmetric else exact

    @property
    def weight(self) -> float:
        """The robot's weight [N]."""
        return GRAVITY * self.robot.total_mass

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
        lasting = np.flatnonzero(np.diff(time) > 0.0)
        found = []
        for k in lasting:
            rows = np.flatnonzero(samples.knot == k)
            middle = 0.5 * (time[k] + time[k + 1])
            found.append(int(rows[np.abs(samples.time[rows] - middle).argmin()]))
        return np.array(found, np.int64)

    @cached_property
    def poses(self) -> LinkPoses:
        """The links at the samples."""
        q = self.replay.samples.position
        return link_poses(self.robot, q[:, :3], q[:, 3:7], q[:, 7:])

    @cached_property
    def progress(self) -> Array:
        """How many flights are over at the samples, with the share of the present one's time."""
        time = self.replay.samples.time
        return np.asarray(
            sum(
                np.clip((time - start) / (end - start), 0.0, 1.0)
                for start, end in self.plan.flights
            )
        )

    @cached_property
    def place(self) -> NDArray[np.int64]:
        """How many flights are over at the samples."""
        return np.asarray(np.searchsorted(self.plan.touchdown_times, self.replay.samples.time,
                                          side="right"))  # fmt: skip

    @cached_property
    def point_height(self) -> Array:
        """The contact points' height above the ground at the samples [m], (n, n_contacts)."""
        points = self.replay.samples.points
        progress = np.repeat(self.progress[:, None], points.shape[1], axis=1)
        return np.asarray(
            points[:, :, 2] - ground_height(self.plan.task, points[:, :, 0], progress)
        )

    @cached_property
    def resting(self) -> Array:
        """What keeps its place while a contact point stands on the ground [m], (n, n_contacts, 3):
        the point itself; of a ball, which rolls, the way of the material where it touches."""
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
        """How far the base has turned in pitch and in yaw from first knot to last [rad].

        The angles are those of R = Ry Rx Rz, followed through full turns.
        """
        matrix = matrices_of_quaternions(self.replay.samples.position[:, 3:7])
        pitch = np.unwrap(np.arctan2(matrix[:, 0, 2], matrix[:, 2, 2]))
        yaw = np.unwrap(np.arctan2(matrix[:, 1, 0], matrix[:, 1, 1]))
        return float(pitch[-1] - pitch[0]), float(yaw[-1] - yaw[0])

    def moment(self, sample: int) -> str:
        """The time of a sample as text."""
        return f"at {self.replay.samples.time[sample]:.3f} s"

    def figures(self) -> dict[str, float]:
        """What the plan does and how hard, by name with unit."""
        r, lasting = self.replay, np.diff(self.plan.time) > 0.0
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
    """The row and column of the largest number."""
    row, column = np.unravel_index(int(array.argmax()), array.shape)
    return int(row), int(column)
