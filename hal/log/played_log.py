"""Puts a log on the ticks of a graph: takes its columns, and notes every mistake."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

import numpy as np

from ...mathematics.arrays import Array, Array1D, Flags
from ...robots.description import RobotDescription
from .columns import (
    LATE,
    LogColumns,
    TimedRows,
    Units,
    at_times,
    last_rows,
    match_joints,
    mean_over,
    moments_of,
    numbers,
    repeats_of,
    rows_to_keep,
    with_hysteresis,
)
from .link_motion import imu_at_base, link_motion
from .log_file import LogError, LogFile
from .parameters import LogParameters
from .played_rows import LogProblem, PlayedLog, PlayedRows
from .series import Series
from .turns import quaternion_of_rpy, rates_of, rotation_of, rotation_of_rpy, unit_quaternions
from .warned_log import warnings_of

UNNAMED = "?"
"""In place of a column's name: its joint is not known yet, and the log is not played."""
NO_JOINT = "-"
"""In place of a column's name: it is no joint of the robot."""


STILL = 1e-9
"""Speeds of joints up to it are none: differences of angles are rounded [rad/s]."""


class _Player:
    """Takes the columns of a log; every mistake is noted, and none ends it."""

    def __init__(
        self, log: LogFile, params: LogParameters, robot: RobotDescription, period: float
    ) -> None:
        self.log, self.params, self.robot, self.period = log, params, robot, period
        self.played = PlayedLog()
        self.times = np.zeros(1)
        self.taken: list[Series] = []

    @contextmanager
    def noting(self, parameter: str) -> Iterator[None]:
        """Note a mistake at a parameter."""
        try:
            yield
        except LogError as error:
            self.played.problems.append(LogProblem(str(error), parameter, fix=error.fix))

    def take(
        self, columns: Any, units: Units, parameter: str, count: int | None = None
    ) -> Series | None:
        """Return columns with their times, or nothing where something is wrong with them."""
        if columns is None:
            return None
        with self.noting(parameter):
            values, own = numbers(self.log, columns, units, count)
            moments = moments_of(self.log, self.params.clock, len(values), own)
            if moments.order is not None:
                values = values[moments.order]
            if parameter == "truth.quaternion":
                assert self.params.truth is not None
                values = unit_quaternions(values, self.params.truth.order)
            keep, lost, same = rows_to_keep(moments.times, values)
            if keep.sum() < 2:
                row = int(np.argmin(np.isfinite(values).all(axis=1)))
                raise LogError(
                    f"{int(keep.sum())} of {len(keep)} rows of it are numbers, expected at least 2; row {row} has "
                    f"{', '.join(f'{each:g}' for each in values[row][:4])}"
                )
            times = moments.times
            if not keep.all():
                times, values = times[keep], values[keep]
            series = Series(times, values, parameter, lost, same, moments.wraps, moments.shift)
            self.played.jitter = max(self.played.jitter, moments.jitter)
            self.taken.append(series)
            return series
        return None

    def on_ticks(self, series: Series, *, hold: bool = False) -> Array:
        """Return the rows of a series at the ticks."""
        between = self.params.between
        if between == "mean" and not hold:
            return mean_over(series.stamps, series.values, self.times, self.period)
        return at_times(series.stamps, series.values, self.times, hold or between == "hold")

    def joint_rows(
        self, series: Series | None, columns: Sequence[int], otherwise: Array1D
    ) -> TimedRows:
        """Return the rows of a series of joints; ``otherwise`` (n_joints,) where it has no column."""
        own, linear = np.array(columns, np.int64), self.params.between == "linear"
        if series is None:
            series, own = Series(self.times[:1], np.zeros((1, 1))), np.full(len(own), -1)
        elif self.params.between == "mean":
            series = Series(self.times, self.on_ticks(series))
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
        gyro = player.take(imu.angular_velocity, "rad/s", "imu.angular_velocity", 3)
        force = player.take(imu.specific_force, "m/s^2", "imu.specific_force", 3)
    columns, (*joints, commanded) = _joints(player, names)
    contacts, forces = _contacts(player)
    truth = params.truth
    place = turn = None
    if truth is not None:
        place = player.take(truth.position, "m", "truth.position", 3)
        if truth.quaternion is not None:
            turn = player.take(truth.quaternion, "", "truth.quaternion", 4)
        else:
            turn = player.take(truth.rpy, "rad", "truth.rpy", 3)
    mounting = _mounting(player)
    if not player.taken and not played.problems:
        played.problems.append(
            LogProblem("the log plays nothing", "imu", fix="give imu, joints or contacts")
        )
    if played.problems or mounting is None:
        return played
    lengths = {len(series.stamps) + series.lost + series.same for series in player.taken}
    if params.clock.rate is not None and len(lengths) > 1:
        played.problems.append(
            LogProblem("columns of different lengths cannot all have one rate", "clock.rate",
                       expected="columns of as many rows", found=" and ".join(map(str, sorted(lengths))))
        )  # fmt: skip
        return played
    first = max(series.stamps[0] for series in player.taken)
    last = min(series.stamps[-1] for series in player.taken)
    begin = first + params.begin
    end = last if params.end is None else first + params.end
    if end > last + LATE and last > first:
        played.problems.append(
            LogProblem("the log ends before end", "end", expected=f"up to {last - first:.6g} s",
                       found=f"{params.end:g} s", fix=f"{np.floor((last - first) * 100) / 100:g} s")
        )  # fmt: skip
        return played
    if end - begin < period:
        problem, expected = (
            "nothing of the log is between begin and end",
            f"up to {last - first:.6g} s",
        )
        if last <= first:
            late = max(player.taken, key=lambda series: series.stamps[0]).parameter
            early = min(player.taken, key=lambda series: series.stamps[-1]).parameter
            problem = f"{late} begins {first - last:.6g} s after {early} ends: their clocks are not the same"
            expected = "columns with a time in common"
        played.problems.append(
            LogProblem(problem, "begin" if last > first else late, expected, f"{params.begin:g} s")
        )
        return played
    count = int(np.floor((end - begin + LATE) / period)) + 1
    player.times = begin + period * np.arange(count)
    played.duration = period * (count - 1)
    longest = max(player.taken, key=lambda series: len(series.stamps))
    played.count, played.rate = len(longest.stamps), float(1.0 / np.mean(np.diff(longest.stamps)))
    played.gaps = max(int(series.gaps().sum()) for series in player.taken)
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
    played.warnings = warnings_of(log, played, params, robot, player.taken)
    return played


def _joints(player: _Player, names: Sequence[str]) -> tuple[list[int], tuple[Series | None, ...]]:
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
    else:
        for key, texts in player.log.texts.items():
            if texts != list(names) and sorted(texts) == sorted(names):
                player.played.problems.append(
                    LogProblem("the file has the joints in another order than the robot", "joints.names",
                               "the order of the columns", "no names", key)
                )  # fmt: skip
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
    for name in dict.fromkeys(
        name for name in listed if listed.count(name) > 1 and name not in (UNNAMED, NO_JOINT)
    ):
        player.played.problems.append(
            LogProblem(f"joint {name} has {listed.count(name)} columns", "joints.names", "one column",
                       f"{name}, {name}")
        )  # fmt: skip
    unplayed = [name for name, column in zip(names, columns, strict=True) if column < 0]
    for name in unknown:
        near = get_close_matches(name, unplayed, 1, 0.5)
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
    joints = {joint.name: joint for joint in player.robot.joints}
    return columns, tuple(
        player.take(
            each,
            [joints[name].unit(unit) if name in joints else "" for name in listed] or unit,
            f"joints.{what}",
        )
        for what, each, unit in (
            ("position", given.position, "rad"),
            ("velocity", given.velocity, "rad/s"),
            ("torque", given.torque, "N m"),
            ("commanded", given.commanded, "N m"),
        )
    )


def _contacts(player: _Player) -> tuple[dict[int, Series], dict[int, Series]]:
    """Return by foot the flags of its contact, and its force or wrench where that was measured."""
    feet = [foot.name for foot in player.robot.feet]
    found: dict[int, Series] = {}
    forces: dict[int, Series] = {}
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
        columns = given.closed if given.force is None else given.force
        units: Units = ""
        if given.force is not None:
            told = isinstance(columns, LogColumns) and columns.unit is not None  # of all six alike
            units = {1: ["N"], 6: ["N"] * 6 if told else ["N"] * 3 + ["N m"] * 3}
        series = player.take(columns, units, f"contacts.{name}")
        if series is not None and name in feet:
            flags = (series.values != 0.0).any(axis=1)
            if given.force is not None:
                forces[feet.index(name)] = series
                normal = series.values[:, 2 if series.values.shape[1] == 6 else 0]
                flags = with_hysteresis(normal, given.closes, given.opens)
            found[feet.index(name)] = Series(series.stamps, flags[:, None].astype(np.float64))
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
    player: _Player, columns: Sequence[int], joints: Sequence[Series | None], stamps: Array1D
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
            speeds = Series(angles.stamps, np.gradient(angles.values, angles.stamps, axis=0))
        velocity[:, own] = at_times(speeds.stamps, speeds.values, stamps)[:, taken]
    return position, velocity


def _rows(
    player: _Player,
    gyro: Series | None,
    force: Series | None,
    mounting: tuple[str, Array, Array],
    columns: Sequence[int],
    joints: Sequence[Series | None],
    contacts: dict[int, Series],
    place: Series | None,
    turn: Series | None,
) -> PlayedRows:
    robot, played, count = player.robot, player.played, len(player.times)
    imu, imu_valid, age = np.zeros((count, 6)), np.zeros(count, bool), np.zeros(count)
    if gyro is not None and force is not None:
        link, rotation, lever = mounting
        when = gyro.stamps
        rates = gyro.values @ rotation.T
        forces = Series(force.stamps, force.values @ rotation.T)
        if link != robot.base:
            at = at_times(gyro.stamps, rates, force.stamps)
            moving = _joints_at(player, columns, joints, force.stamps)
            motion = link_motion(robot, link, lever, *moving)
            rates, carried = imu_at_base(motion, force.stamps, at, forces.values)
            when, forces = force.stamps, Series(force.stamps, carried)
        elif lever.any():
            at = at_times(gyro.stamps, rates, force.stamps)
            turning = np.gradient(at, force.stamps, axis=0)
            moved = forces.values - np.cross(at, np.cross(at, lever)) - np.cross(turning, lever)
            forces = Series(force.stamps, moved)
        imu[:, :3] = player.on_ticks(Series(when, rates))
        imu[:, 3:] = player.on_ticks(forces)
        imu_valid, age, played.imu_repeats = _validity(player, [gyro, force])
    angles, speeds, torques = joints
    if angles is not None and speeds is None:
        speeds = Series(angles.stamps, np.gradient(angles.values, angles.stamps, axis=0))
    joints_valid = np.zeros(count, bool)
    if angles is not None and speeds is not None and max(columns, default=-1) >= 0:
        samples = [angles] if joints[1] is None else [angles, speeds]
        joints_valid, _, played.joint_repeats = _validity(player, samples, moving=speeds)
    still = np.zeros(len(columns))
    standing = np.array(robot.standing_position, np.float64)
    closed = np.zeros((count, len(robot.contacts)), bool)
    foot = np.asarray(robot.foot_of_contact(), np.int64)
    contacts_valid = np.full(count, bool(contacts))
    for index, flags in contacts.items():
        closed[:, foot == index] = player.on_ticks(flags, hold=True) > 0.5
        contacts_valid &= flags.validity(player.times, np.zeros(len(flags.stamps), bool))[0]
    pose, twist = _motion(player, place, turn)
    return PlayedRows(
        imu, player.joint_rows(angles, columns, standing), player.joint_rows(speeds, columns, still),
        player.joint_rows(torques, columns, still), closed, imu_valid, joints_valid,
        contacts_valid, age, pose, twist,
    )  # fmt: skip


def _validity(
    player: _Player, samples: Sequence[Series], moving: Series | None = None
) -> tuple[Flags, Array1D, float]:
    """Return at the ticks whether a sensor's last samples are new ones and their age [s], and the share of samples that repeat.

    Args:
        samples: of one sensor. What has the stamp of another's new sample is one, too.
        moving: speeds: what stands may well read as before.
    """
    repeats = [repeats_of(series.values) for series in samples]
    renewed = [series.stamps[~each] for series, each in zip(samples, repeats, strict=True)]
    valid, age, share = np.ones(len(player.times), bool), np.zeros(len(player.times)), 0.0
    for series, repeated in zip(samples, repeats, strict=True):
        for stamps in renewed:
            repeated &= ~np.isin(series.stamps, stamps)
        if moving is not None:
            stamps = series.stamps[repeated]
            speeds = at_times(moving.stamps, moving.values, stamps)
            repeated[repeated] = (np.abs(speeds) > STILL).any(axis=1)
        new, old = series.validity(player.times, repeated)
        valid, age, share = valid & new, np.maximum(age, old), max(share, float(repeated.mean()))
    return valid, age, share


def _motion(player: _Player, place: Series | None, turn: Series | None) -> tuple[Array, Array]:
    """Return pose (n, 7) and twist (n, 6) of the base at the ticks, by motion capture."""
    count, period = len(player.times), player.period
    pose, twist = np.zeros((count, 7)), np.zeros((count, 6))
    pose[:, 6] = 1.0
    between = player.params.between

    def moved(series: Series) -> tuple[Array, Array]:
        """Return rows at the ticks, and those whose differences are velocities: held ones jump."""
        rows = player.on_ticks(series)
        linear = at_times(series.stamps, series.values, player.times)
        return rows, linear if between == "hold" else rows

    if place is not None:
        pose[:, :3], rows = moved(place)
        twist[:, :3] = np.gradient(rows, period, axis=0)
    if turn is not None:
        angles = turn.values
        four = quaternion_of_rpy(angles) if angles.shape[1] == 3 else angles
        sides = np.where(np.sum(four[1:] * four[:-1], axis=1) < 0.0, -1.0, 1.0)
        four = four * np.concatenate([[1.0], np.cumprod(sides)])[:, None]
        turns, rows = (
            each / np.linalg.norm(each, axis=1, keepdims=True)
            for each in moved(Series(turn.stamps, four))
        )
        pose[:, 3:] = turns
        change = np.gradient(rows, period, axis=0)
        twist[:, 3:] = rates_of(rows, change)
    return pose, twist
