"""A log on the ticks of a graph: the rows that every tick plays, and what is wrong with the log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D, Array2D, Flags, Flags1D, Flags2D
from ...robots.description import RobotDescription
from .columns import (
    MOST_JITTER,
    TimedRows,
    at_times,
    jitter_of,
    last_rows,
    match_joints,
    mean_over,
    numbers,
    repeats_of,
    stamps_of,
    with_hysteresis,
)
from .link_motion import imu_at_base, link_motion
from .log_file import LogError, LogFile
from .parameters import LogParameters

UNNAMED = "?"
"""In place of a column's name: its joint is not known yet, and the log is not played."""
MANY_REPEATS = 0.02
"""A share of samples that repeat the one before, above which there is a warning."""
GAP = 5.0
"""Steps between two rows, in usual ones, above which there is a gap."""


class PlayedRows(NamedTuple):
    """Values that every tick plays, n rows: IMU (n, 6), switches (n, n_contacts), pose of the base (n, 7) with its quaternion
    x, y, z, w, and its twist (n, 6). Those of the joints, most of a log, stay in its own rows."""

    imu: Array2D
    position: TimedRows
    velocity: TimedRows
    torque: TimedRows
    closed: Flags2D
    imu_valid: Flags1D
    joints_valid: Flags1D
    imu_age: Array1D
    pose: Array2D
    twist: Array2D


@dataclass(frozen=True)
class LogProblem:
    """One thing that the log or the robot lacks."""

    message: str
    parameter: str
    expected: str = ""
    found: str = ""
    fix: str = ""


@dataclass
class PlayedLog:
    """The rows, and what is to be known of the log."""

    rows: PlayedRows | None = None
    problems: list[LogProblem] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    duration: float = 0.0
    count: int = 0
    rate: float = 0.0
    jitter: float = 0.0
    gaps: int = 0
    imu_repeats: float = 0.0
    joint_repeats: float = 0.0
    commanded: Array2D | None = None
    """Commanded torques at the ticks (n, n_joints) [N m], for identification."""
    wrenches: Array | None = None
    """Force and moment on each foot about its sole's centre, in its link's axes, at the ticks (n, n_feet, 6) [N, N m], for
    identification; no number where it was not measured."""


@dataclass(frozen=True)
class _Series:
    """Columns at their own times."""

    stamps: Array1D
    values: Array


class _Player:
    """Takes the columns of a log; every mistake is noted, and none ends it."""

    def __init__(
        self, log: LogFile, params: LogParameters, robot: RobotDescription, period: float
    ) -> None:
        self.log, self.params, self.robot, self.period = log, params, robot, period
        self.played = PlayedLog()
        self.times = np.zeros(1)
        self.taken: list[_Series] = []

    @contextmanager
    def noting(self, parameter: str) -> Iterator[None]:
        """Note a mistake at a parameter."""
        try:
            yield
        except LogError as error:
            self.played.problems.append(LogProblem(str(error), parameter))

    def take(self, columns: Any, count: int | None, unit: str, parameter: str) -> _Series | None:
        """Return columns with their times, or nothing where something is wrong with them."""
        if columns is None:
            return None
        with self.noting(parameter):
            values, own = numbers(self.log, columns, count, unit)
            clock = self.params.clock
            stamps = stamps_of(self.log, clock, len(values), own)
            if not np.isfinite(values).all():
                row = int(np.argmin(np.isfinite(values).all(axis=1)))
                raise LogError(f"row {row} of {columns} is no number")
            jitter = jitter_of(self.log, clock, len(values), own)
            self.played.jitter = max(self.played.jitter, jitter)
            series = _Series(stamps, values)
            self.taken.append(series)
            return series
        return None

    def on_ticks(self, series: _Series, *, hold: bool = False) -> Array:
        """Return the rows of a series at the ticks."""
        between = self.params.between
        if between == "mean" and not hold:
            return mean_over(series.stamps, series.values, self.times, self.period)
        return at_times(series.stamps, series.values, self.times, hold or between == "hold")

    def joint_rows(
        self, series: _Series | None, columns: Sequence[int], otherwise: Array1D
    ) -> TimedRows:
        """Return the rows of a series of joints; ``otherwise`` (n_joints,) where it has no column."""
        own, linear = np.array(columns, np.int64), self.params.between == "linear"
        if series is None:
            series, own = _Series(self.times[:1], np.zeros((1, 1))), np.full(len(own), -1)
        elif self.params.between == "mean":
            series = _Series(self.times, self.on_ticks(series))
        return TimedRows(
            series.stamps, np.ascontiguousarray(series.values), own, otherwise, self.times,
            last_rows(series.stamps, self.times, hold=not linear), np.array([linear]),
        )  # fmt: skip


def play(log: LogFile, params: LogParameters, robot: RobotDescription, period: float) -> PlayedLog:
    """Return what a log plays at the ticks of a ``period`` [s]; with problems it has no rows."""
    player = _Player(log, params, robot, period)
    played, names = player.played, [joint.name for joint in robot.joints]
    imu = params.imu
    gyro = force = None
    if imu is not None:
        gyro = player.take(imu.angular_velocity, 3, "rad/s", "imu.angular_velocity")
        force = player.take(imu.specific_force, 3, "m/s^2", "imu.specific_force")
    columns, (*joints, commanded) = _joints(player, names)
    contacts, forces = _contacts(player)
    truth = params.truth
    place = turn = None
    if truth is not None:
        place = player.take(truth.position, 3, "m", "truth.position")
        if truth.quaternion is not None:
            turn = player.take(truth.quaternion, 4, "", "truth.quaternion")
        else:
            turn = player.take(truth.rpy, 3, "rad", "truth.rpy")
    mounting = _mounting(player)
    if not player.taken and not played.problems:
        played.problems.append(
            LogProblem("the log plays nothing", "imu", fix="give imu, joints or contacts")
        )
    if played.problems or mounting is None:
        return played
    first = max(series.stamps[0] for series in player.taken)
    last = min(series.stamps[-1] for series in player.taken)
    begin = first + params.begin
    end = last if params.end is None else min(last, first + params.end)
    if end - begin < period:
        played.problems.append(
            LogProblem(
                "nothing of the log is between begin and end",
                "begin",
                expected=f"up to {last - first:.6g} s",
                found=f"{params.begin:g} s",
            )
        )
        return played
    count = int(np.floor((end - begin) / period + 1e-6)) + 1
    player.times = begin + period * np.arange(count)
    played.duration = period * (count - 1)
    longest = max(player.taken, key=lambda series: len(series.stamps))
    steps = np.diff(longest.stamps)
    played.count, played.rate = len(longest.stamps), float(1.0 / np.mean(steps))
    played.gaps = int((steps > GAP * np.median(steps)).sum())
    played.rows = _rows(player, gyro, force, mounting, columns, joints, contacts, place, turn)
    if forces:
        played.wrenches = np.full((count, len(robot.feet), 6), np.nan)
        for index, series in forces.items():
            own = [2] if series.values.shape[1] == 1 else range(6)
            played.wrenches[:, index, own] = player.on_ticks(series)
    if commanded is not None:
        rows = player.joint_rows(commanded, columns, np.zeros(len(columns)))
        played.commanded = rows._replace(
            last=last_rows(commanded.stamps, player.times, hold=True), linear=np.array([False])
        ).at_ticks()
    _warn(player, names, columns)
    return played


def _joints(player: _Player, names: Sequence[str]) -> tuple[list[int], tuple[_Series | None, ...]]:
    """Return the column of every joint, and angles, speeds, torques and commanded torques."""
    given = player.params.joints
    if given is None:
        return [-1] * len(names), (None,) * 4
    listed: Sequence[str] = names
    if isinstance(given.names, str):
        listed = player.log.texts.get(given.names, ())
        if not listed:
            problem = f"the file has no list of texts {given.names!r}"
            player.played.problems.append(LogProblem(problem, "joints.names"))
    elif given.names is not None:
        listed = given.names
    if UNNAMED in listed:
        at = ", ".join(str(k) for k, name in enumerate(listed) if name == UNNAMED)
        player.played.problems.append(
            LogProblem(
                f"columns {at} (the first is 0) have no joint's name yet",
                "joints.names",
                found=UNNAMED,
                expected="the names of all columns in their order, as the driver's documentation has them",
                fix=f"a joint of {player.robot.name}, or - for a column that is none",
            )
        )
    columns, unknown = match_joints(list(listed), list(names))
    for name in unknown:
        near = get_close_matches(name, names, 1, 0.5)
        if near:
            player.played.problems.append(
                LogProblem(
                    f"{player.robot.name} has no joint {name}",
                    "joints.names",
                    found=name,
                    expected="a joint of the robot",
                    fix=near[0],
                )
            )
    if all(column < 0 for column in columns) and listed:
        problem = f"no joint of the log is one of {player.robot.name}'s"
        player.played.problems.append(LogProblem(problem, "joints.names", found=", ".join(listed)))
    count = len(listed) or None
    return columns, tuple(
        player.take(each, count, unit, f"joints.{what}")
        for what, each, unit in (
            ("position", given.position, "rad"),
            ("velocity", given.velocity, "rad/s"),
            ("torque", given.torque, "N m"),
            ("commanded", given.commanded, "N m"),
        )
    )


def _contacts(player: _Player) -> tuple[dict[int, _Series], dict[int, _Series]]:
    """Return by foot the flags of its contact, and its force or wrench where that was measured."""
    feet = [foot.name for foot in player.robot.feet]
    found: dict[int, _Series] = {}
    forces: dict[int, _Series] = {}
    for name, given in player.params.contacts.items():
        if name not in feet:
            near = get_close_matches(name, feet, 1, 0.3)
            player.played.problems.append(
                LogProblem(
                    f"{player.robot.name} has no foot {name}",
                    "contacts",
                    found=name,
                    expected=", ".join(feet),
                    fix=near[0] if near else "",
                )
            )
            continue
        if (given.force is None) == (given.closed is None):
            player.played.problems.append(
                LogProblem(f"foot {name} needs either a force or closed", f"contacts.{name}")
            )
            continue
        if given.opens > given.closes:
            player.played.problems.append(
                LogProblem(
                    f"foot {name} opens above the force that closes it",
                    f"contacts.{name}",
                    expected=f"at most {given.closes:g} N",
                    found=f"{given.opens:g} N",
                )
            )
        # a list of six has columns in N and in N m
        unit = "" if given.force is None or isinstance(given.force, list) else "N"
        columns, count = given.force or given.closed, None if given.force else 1
        series = player.take(columns, count, unit, f"contacts.{name}")
        if series is not None and (width := series.values.shape[1]) not in (1, 6):
            problem = (
                f"{columns} has {width} columns, expected 1, a force, or 6, a force and a moment"
            )
            player.played.problems.append(LogProblem(problem, f"contacts.{name}"))
        elif series is not None:
            flags = series.values[:, 0] != 0.0
            if given.force is not None:
                forces[feet.index(name)] = series
                normal = series.values[:, 2 if width == 6 else 0]
                flags = with_hysteresis(normal, given.closes, given.opens)
            found[feet.index(name)] = _Series(series.stamps, flags[:, None].astype(np.float64))
    return found, forces


def _mounting(player: _Player) -> tuple[str, Array, Array] | None:
    """Return the link that carries the IMU, and its turn (3, 3) and place (3,) [m] in the link's axes."""
    imu, robot = player.params.imu, player.robot
    if imu is None or imu.sensor is None:
        link = robot.base if imu is None or imu.link is None else imu.link
        names = [each.name for each in robot.links]
        if link not in names:
            near = get_close_matches(link, names, 1, 0.5)
            player.played.problems.append(
                LogProblem(f"{robot.name} has no link {link}", "imu.link", found=link,
                           expected="a link of the robot", fix=near[0] if near else "")
            )  # fmt: skip
            return None
        angles = (0.0, 0.0, 0.0) if imu is None else imu.rpy
        place = np.array(imu.position if imu else (0.0,) * 3)
        return link, rotation_of_rpy(np.array([angles]))[0], place
    mounted = robot.sensors.mounted
    if imu.sensor not in mounted:
        near = get_close_matches(imu.sensor, mounted, 3, 0.5) or list(mounted)[:6]
        player.played.problems.append(
            LogProblem(
                f"{robot.name} has no sensor {imu.sensor}",
                "imu.sensor",
                found=imu.sensor,
                expected=", ".join(near) or "imu.position and imu.rpy",
            )
        )
        return None
    mount = mounted[imu.sensor]
    return mount.link, rotation_of(np.array([mount.orientation]))[0], np.array(mount.position)


def _joints_at(
    player: _Player, columns: Sequence[int], joints: Sequence[_Series | None], stamps: Array1D
) -> tuple[Array, Array]:
    """Return angles and speeds of all joints at some stamps (n, n_joints)."""
    angles, speeds = joints[:2]
    position = np.tile(np.array(player.robot.standing_position, np.float64), (len(stamps), 1))
    velocity = np.zeros_like(position)
    own = [k for k, column in enumerate(columns) if column >= 0]
    taken = [columns[k] for k in own]
    if angles is not None and own:
        position[:, own] = at_times(angles.stamps, angles.values, stamps)[:, taken]
        if speeds is None:
            speeds = _Series(angles.stamps, np.gradient(angles.values, angles.stamps, axis=0))
        velocity[:, own] = at_times(speeds.stamps, speeds.values, stamps)[:, taken]
    return position, velocity


def _rows(
    player: _Player,
    gyro: _Series | None,
    force: _Series | None,
    mounting: tuple[str, Array, Array],
    columns: Sequence[int],
    joints: Sequence[_Series | None],
    contacts: dict[int, _Series],
    place: _Series | None,
    turn: _Series | None,
) -> PlayedRows:
    robot, played, count = player.robot, player.played, len(player.times)
    imu, imu_valid, age = np.zeros((count, 6)), np.ones(count, bool), np.zeros(count)
    if gyro is not None and force is not None:
        link, rotation, lever = mounting
        when = gyro.stamps
        rates = gyro.values @ rotation.T
        forces = _Series(force.stamps, force.values @ rotation.T)
        if link != robot.base:
            at = at_times(gyro.stamps, rates, force.stamps)
            moving = _joints_at(player, columns, joints, force.stamps)
            motion = link_motion(robot, link, lever, *moving)
            rates, carried = imu_at_base(motion, force.stamps, at, forces.values)
            when, forces = force.stamps, _Series(force.stamps, carried)
        elif lever.any():
            at = at_times(gyro.stamps, rates, force.stamps)
            turning = np.gradient(at, force.stamps, axis=0)
            moved = forces.values - np.cross(at, np.cross(at, lever)) - np.cross(turning, lever)
            forces = _Series(force.stamps, moved)
        imu[:, :3] = player.on_ticks(_Series(when, rates))
        imu[:, 3:] = player.on_ticks(forces)
        repeated = repeats_of(gyro.values)
        played.imu_repeats = float(repeated.mean())
        imu_valid, age = _validity(player, gyro.stamps, repeated)
    angles, speeds, torques = joints
    if angles is not None and speeds is None:
        speeds = _Series(angles.stamps, np.gradient(angles.values, angles.stamps, axis=0))
    joints_valid = np.ones(count, bool)
    if angles is not None and speeds is not None and max(columns, default=-1) >= 0:
        repeated = repeats_of(angles.values)
        repeated[repeated] = at_times(speeds.stamps, speeds.values, angles.stamps[repeated]).any(
            axis=1
        )
        played.joint_repeats = float(repeated.mean())
        joints_valid, _ = _validity(player, angles.stamps, repeated)
    still = np.zeros(len(columns))
    standing = np.array(robot.standing_position, np.float64)
    closed = np.zeros((count, len(robot.contacts)), bool)
    foot = np.asarray(robot.foot_of_contact(), np.int64)
    for index, flags in contacts.items():
        closed[:, foot == index] = player.on_ticks(flags, hold=True) > 0.5
    pose, twist = _motion(player, place, turn)
    return PlayedRows(
        imu, player.joint_rows(angles, columns, standing), player.joint_rows(speeds, columns, still),
        player.joint_rows(torques, columns, still), closed, imu_valid, joints_valid, age, pose, twist,
    )  # fmt: skip


def _validity(player: _Player, stamps: Array1D, repeated: Flags) -> tuple[Flags, Array1D]:
    """Return at the ticks whether the last sample is a new one, and its age [s]."""
    last = np.clip(
        np.searchsorted(stamps, player.times + 1e-9, side="right") - 1, 0, len(stamps) - 1
    )
    renewed = np.maximum.accumulate(np.where(repeated, 0, np.arange(len(stamps))))
    usual = float(np.median(np.diff(stamps)))
    age = player.times - stamps[renewed[last]]
    return ~repeated[last] & (player.times - stamps[last] < GAP * usual), age


def _motion(player: _Player, place: _Series | None, turn: _Series | None) -> tuple[Array, Array]:
    """Return pose (n, 7) and twist (n, 6) of the base at the ticks, by motion capture."""
    count, period = len(player.times), player.period
    pose, twist = np.zeros((count, 7)), np.zeros((count, 6))
    pose[:, 6] = 1.0
    if place is not None:
        pose[:, :3] = player.on_ticks(place)
        twist[:, :3] = np.gradient(pose[:, :3], period, axis=0)
    if turn is not None:
        angles = turn.values
        four = quaternion_of_rpy(angles) if angles.shape[1] == 3 else angles
        four = four / np.maximum(np.linalg.norm(four, axis=1, keepdims=True), 1e-12)
        sides = np.where(np.sum(four[1:] * four[:-1], axis=1) < 0.0, -1.0, 1.0)
        four = four * np.concatenate([[1.0], np.cumprod(sides)])[:, None]
        rows = at_times(turn.stamps, four, player.times)
        pose[:, 3:] = rows / np.linalg.norm(rows, axis=1, keepdims=True)
        change = np.gradient(pose[:, 3:], period, axis=0)
        x, y, z, w = pose[:, 3:].T
        a, b, c, d = change.T
        twist[:, 3] = 2.0 * (w * a - x * d - y * c + z * b)
        twist[:, 4] = 2.0 * (w * b - y * d - z * a + x * c)
        twist[:, 5] = 2.0 * (w * c - z * d - x * b + y * a)
    return pose, twist


def quaternion_of_rpy(angles: Array) -> Array:
    """Return quaternions x, y, z, w (n, 4) of roll, pitch and yaw (n, 3) [rad]: R = Rz Ry Rx."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(0.5 * angles).T, np.cos(0.5 * angles).T
    return np.stack(
        [
            sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy,
        ],
        axis=1,
    )  # fmt: skip


def rotation_of(four: Array) -> Array:
    """Return rotation matrices (n, 3, 3) of quaternions x, y, z, w (n, 4)."""
    x, y, z, w = (four / np.linalg.norm(four, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def rotation_of_rpy(angles: Array) -> Array:
    """Return rotation matrices (n, 3, 3) of roll, pitch and yaw (n, 3) [rad]."""
    return rotation_of(quaternion_of_rpy(angles))


def _warn(player: _Player, names: Sequence[str], columns: Sequence[int]) -> None:
    """Note what in the log may mislead who uses it."""
    played, clock = player.played, player.params.clock
    for what, share in (("IMU", played.imu_repeats), ("joints", played.joint_repeats)):
        if share > MANY_REPEATS:
            played.warnings.append(
                f"{100.0 * share:.1f} % of the samples of the {what} repeat the one before exactly: they were not renewed"
            )
    if played.jitter > MOST_JITTER and not clock.even:
        played.warnings.append(
            f"the steps between stamps vary by {100.0 * played.jitter:.0f} % of their mean: if they are arrival times, "
            "clock.even: true is right"
        )
    if played.gaps and not clock.even:
        played.warnings.append(f"the log has {played.gaps} gaps")
    missing = [name for name, column in zip(names, columns, strict=True) if column < 0]
    if player.params.joints is not None and missing:
        shown = ", ".join(missing[:6]) + (f" ({len(missing)} in all)" if len(missing) > 6 else "")
        played.warnings.append(f"the log lacks {shown}: they stand at their standing angles")
