"""Warnings of a played log: units, signs, thresholds, clocks and rows that may mislead who uses it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from .columns import MOST_JITTER, names_of, usual_step
from .log_file import LogFile
from .parameters import LogParameters
from .played_rows import PlayedLog, PlayedRows
from .series import GAP, Series
from .turns import rotation_of

MANY_REPEATS = 0.02
"""A share of samples that repeat the one before, above which there is a warning."""
GRAVITY = (7.0, 13.0)
"""Between these is the median of a specific force of a robot that is mostly on its feet [m/s^2]."""
SHARE = (0.5, 2.0)
"""Between these is the share of one measurement of a speed in another: filters and noise do less."""
MOST_TILTED = 0.35
"""A mean specific force is so far off the vertical at most, by the truth's turn [rad]."""
TURNING, MOVING, WINDOW, LONGEST = 0.05, 0.015, 0.2, 100_000
"""Speeds are compared where a base turns [rad/s], or a joint moves [rad or m], by windows of time [s], over so many rows."""
BEYOND = 1.0
"""An angle may be so far beyond its limits [rad]: calibrations and models differ, but by less."""


def warnings_of(
    log: LogFile,
    played: PlayedLog,
    params: LogParameters,
    robot: RobotDescription,
    taken: Sequence[Series],
) -> list[str]:
    """Return what in a log may mislead who uses it."""
    assert played.rows is not None
    return [
        *_of_rows(taken),
        *_of_clock(played, params, taken),
        *_of_joints(params, robot, played.rows),
        *_of_contacts(params, robot, played.rows),
        *_of_imu(params, played.rows),
        *_of_speeds(params, robot, played.rows),
        *_of_truth(params, played.rows),
        *_of_mounting(log, params, robot),
    ]


def _of_rows(taken: Sequence[Series]) -> Iterator[str]:
    for series in taken:
        rows = len(series.stamps) + series.lost + series.same
        if series.lost:
            yield f"{series.parameter}: {series.lost} of {rows} rows are no numbers, and left out"
        if series.same:
            yield f"{series.parameter}: {series.same} of {rows} rows have the stamp of the next one, which counts"


def _of_clock(played: PlayedLog, params: LogParameters, taken: Sequence[Series]) -> Iterator[str]:
    for what, share in (("IMU", played.imu_repeats), ("joints", played.joint_repeats)):
        if share > MANY_REPEATS:
            yield f"{100.0 * share:.1f} % of the samples of the {what} repeat the one before exactly: they were not renewed"
    spread = max(series.spread() for series in taken)
    if spread > MOST_JITTER and not params.clock.even:
        yield (
            f"the steps between stamps vary by {100.0 * spread:.0f} % of their mean: if they are arrival times, "
            "clock.even: true is right"
        )
    if played.gaps:
        worst = max(taken, key=lambda series: int(series.gaps().sum()))
        longest = float(np.diff(worst.stamps).max())
        yield f"the log has {played.gaps} gaps ({worst.parameter}), the longest of {longest:.3g} s"
    wraps = max(series.wraps for series in taken)
    if wraps:
        yield f"the stamps begin again {wraps} times, as a counter of 32 bits does, and are counted on"
    shift = max(taken, key=lambda series: series.shift)
    if shift.shift > GAP * usual_step(shift.stamps):
        yield (
            f"clock.even: half of the rows are more than {shift.shift:.3g} s off their stamps, so rows are missing: an even "
            "grid is wrong there"
        )


def _of_joints(params: LogParameters, robot: RobotDescription, rows: PlayedRows) -> Iterator[str]:
    if params.joints is None:
        return
    missing = [
        joint.name for joint, own in zip(robot.joints, rows.position.column, strict=True) if own < 0
    ]
    if missing:
        yield f"the log lacks {_some(missing)}: they stand at their standing angles"
    for joint, own in zip(robot.joints, rows.position.column, strict=True):
        if own < 0 or joint.limits is None or joint.kind != "hinge":
            continue
        values = rows.position.values[:, own]
        if values.min() < joint.limits[0] - BEYOND or values.max() > joint.limits[1] + BEYOND:
            yield (
                f"{joint.name} goes from {values.min():.3g} to {values.max():.3g} rad, and its limits are {joint.limits[0]:.3g} "
                f"and {joint.limits[1]:.3g}: look at unit, sign and offset of joints.position, and at the joints' order"
            )
            return


def _of_contacts(params: LogParameters, robot: RobotDescription, rows: PlayedRows) -> Iterator[str]:
    if not params.contacts:
        if params.joints is not None and params.imu is not None and robot.feet:
            yield "contacts are not given: the feet never touch"
        return
    untold = [foot.name for foot in robot.feet if foot.name not in params.contacts]
    if untold:
        yield f"no contact of {_some(untold)} is given: they never touch"
    feet = np.asarray(robot.foot_of_contact())
    for k, foot in enumerate(robot.feet):
        if foot.name in params.contacts and not rows.closed[:, feet == k].any():
            yield f"{foot.name} never touches: look at sign and thresholds of contacts.{foot.name}"


def _of_imu(params: LogParameters, rows: PlayedRows) -> Iterator[str]:
    if params.imu is None:
        return
    force = np.median(rows.imu[:, 3:], axis=0)
    size = float(np.median(np.linalg.norm(rows.imu[:, 3:], axis=1)))
    if not GRAVITY[0] < size < GRAVITY[1]:
        yield (
            f"the specific force has a median of {size:.3g} m/s^2, expected about 9.81: look at the unit of "
            "imu.specific_force (g?), and whether gravity was taken out"
        )
    elif force[2] < -0.5 * size:
        yield (
            "the specific force points down while the robot stands: scale: [-1.0] where the log has gravity in its place, or "
            "look at imu.rpy"
        )


def _of_speeds(params: LogParameters, robot: RobotDescription, rows: PlayedRows) -> Iterator[str]:
    if params.joints is None or params.joints.velocity is None:
        return
    angles, speeds = rows.position, rows.velocity
    first, last = max(angles.stamps[0], speeds.stamps[0]), min(angles.stamps[-1], speeds.stamps[-1])
    knots = np.arange(first, min(last, angles.stamps[:LONGEST][-1]), WINDOW)
    for k, joint in enumerate(robot.joints):
        if min(angles.column[k], speeds.column[k]) < 0 or len(knots) < 4:
            continue
        told = speeds.values[:, speeds.column[k]]
        way = np.cumsum(0.5 * (told[1:] + told[:-1]) * np.diff(speeds.stamps))
        told = np.diff(np.interp(knots, speeds.stamps, np.insert(way, 0, 0.0)))
        moved = np.diff(np.interp(knots, angles.stamps, angles.values[:, angles.column[k]]))
        if max(float(np.std(told)), float(np.std(moved))) < MOVING:
            continue
        share = _share(moved, told)
        if not SHARE[0] < share < SHARE[1]:
            yield (
                f"{joint.name} moves {share:.2g} times as fast as its speeds say: look at unit, sign and order of "
                "joints.position and joints.velocity"
            )
            return


def _of_truth(params: LogParameters, rows: PlayedRows) -> Iterator[str]:
    if params.truth is None or params.imu is None:
        return
    force = np.einsum("nij,nj->i", rotation_of(rows.pose[:, 3:]), rows.imu[:, 3:])
    off = float(np.arctan2(np.hypot(force[0], force[1]), force[2]))
    if off > MOST_TILTED:
        yield (
            f"by the truth's turn the mean specific force is {off:.2g} rad off the vertical: look at unit "
            "and order of truth, and at imu.sensor or imu.rpy"
        )
        return
    times = rows.position.times
    knots = np.searchsorted(times, np.arange(times[0], times[-1], WINDOW))
    if len(knots) < 4:
        return
    counts = np.diff(knots)[:, None]
    found, told = (
        np.add.reduceat(each[: knots[-1]], knots[:-1]) / counts
        for each in (rows.twist[:, 3:], rows.imu[:, :3])
    )
    moving = max(float(np.std(found)), float(np.std(told))) > TURNING
    share = _share(found, told) if moving else 1.0
    if not SHARE[0] < share < SHARE[1]:
        yield (
            f"the truth turns {share:.2g} times as fast as the gyroscope says: look at unit and sign of "
            "imu.angular_velocity, and at the clocks"
        )


def _share(found: Array, told: Array) -> float:
    """Return how much of what is told is found, by least squares."""
    return float(np.sum(found * told) / max(np.sum(told**2), 1e-12))


def _of_mounting(log: LogFile, params: LogParameters, robot: RobotDescription) -> Iterator[str]:
    imu = params.imu
    if imu is None or imu.sensor or imu.link or any(imu.position) or any(imu.rpy):
        return
    frame = log.array(names_of(imu.angular_velocity)[0]).frame
    links = [link.name for link in robot.links if link.name != robot.base]
    if frame in robot.sensors.mounted or frame in links:
        part = "sensor" if frame in robot.sensors.mounted else "link"
        yield f"the IMU's messages are in the frame {frame}, and it is played at {robot.base}: imu.{part}: {frame}"


def _some(names: Sequence[str]) -> str:
    more = f" ({len(names)} in all)" if len(names) > 6 else ""
    return ", ".join(names[:6]) + more
