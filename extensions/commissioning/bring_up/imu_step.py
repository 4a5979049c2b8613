"""The step that finds how the IMU is mounted, by laying the robot down and by turning it."""

from __future__ import annotations

import numpy as np

from ....hal.bear.configuration import imu_rotation_of
from ....mathematics.arrays import Array
from ....mathematics.constants import GRAVITY
from .session import PACKET_TIME, Request, Session, StepReport

GRAVITY_ERROR = 0.1
"""The share of gravity by which the accelerometer may differ at rest."""
QUARTER = 0.5 * np.pi
TURN_ERROR = 0.2
"""The share of a quarter turn by which the gyroscope may differ: it is turned by hand."""
STRAIGHT = 0.95
"""The least cosine between a measured direction and the axis that it belongs to."""
AXES_ERROR = 0.35
"""The angle between the mountings that accelerometer and gyroscope show [rad]: it is turned by hand."""
SQUARE_ERROR = 0.1
"""A board that is this near to a mounting along the robot's axes is taken for mounted so [rad]."""
PLACE_ERROR = 0.004
"""Largest error of the board's stated place [m], for a rule."""
STILL_PACKETS = 50
POLLS = 20000
_SIDES = (
    ("back", "lay the robot on its back, its front upwards"),
    ("right side", "lay the robot on its right side, its left upwards"),
    ("feet", "hold the robot upright"),
)
_AXES = (
    ("x", "turn the robot by 90 deg about its forward axis, its right side downwards"),
    ("y", "turn the robot by 90 deg about its left axis, its front downwards"),
    ("z", "turn the robot by 90 deg about its upward axis, to its left"),
)

_PLACES = (
    "measure how far the IMU's chip is ahead of the torso's origin, the middle between the hips [mm]",
    "measure how far it is to the left of it [mm]",
    "measure how far it is above it [mm]",
)


def check_imu(session: Session) -> StepReport:
    """Compare gravity in three positions, and three quarter turns, with the robot's axes."""
    report = StepReport()
    force, turned = np.zeros((3, 3)), np.zeros((3, 3))
    for k, (side, text) in enumerate(_SIDES):
        session.do(Request("place", side, text))
        mean = _mean_force(session)
        if mean is None:
            report.add(
                "board.port", "packets of the sensor board", "none",
                f"check that the board at {session.hardware.board.port} is powered and streams",
            )  # fmt: skip
            return report
        force[:, k] = mean
    for k, (axis, text) in enumerate(_AXES):
        turned[:, k] = _turn(session, Request("turn", axis, text))
    report.values |= {"specific_force": force.tolist(), "turned": turned.tolist()}
    for k, (side, _) in enumerate(_SIDES):
        size = float(np.linalg.norm(force[:, k]))
        if abs(size / GRAVITY - 1.0) > GRAVITY_ERROR:
            report.add(
                f"accelerometer, robot on its {side}", f"{GRAVITY:.2f} m/s^2", f"{size:.2f} m/s^2",
                "its range or its unit is another: configure the board",
            )  # fmt: skip
    for k, (axis, _) in enumerate(_AXES):
        size = float(np.linalg.norm(turned[:, k]))
        if abs(size / QUARTER - 1.0) > TURN_ERROR:
            report.add(
                f"gyroscope, turn about {axis}", "90 deg", f"{np.degrees(size):.0f} deg",
                "its range or its unit is another (board.gyro_range), or it was turned too fast",
            )  # fmt: skip
    if not report.discrepancies:
        rotation = _mounting(force / GRAVITY, turned / QUARTER, report)
        if rotation is not None:
            _note_mounting(session, rotation, report)
    return report


def _mounting(force: Array, turned: Array, report: StepReport) -> Array | None:
    """Return the rotation from the base's axes to the board's (3, 3) that explains both sensors; columns are the
    robot's axes in the board's frame. ``None`` if there is none, which is noted."""
    axes, spins = _nearest_rotation(force), _nearest_rotation(turned)
    straight = min(_straightness(axes, force), _straightness(spins, turned))
    between = _angle_between(axes, spins)
    left_handed = np.linalg.det(force) < 0.0 and np.linalg.det(turned) < 0.0
    place = "IMU"
    if left_handed:
        report.add(
            place, "right-handed axes", f"left-handed: {_words(force)}",
            "one axis is inverted: correct the board's firmware",
        )  # fmt: skip
    elif np.linalg.det(force) * np.linalg.det(turned) < 0.0 or between > AXES_ERROR:
        report.add(
            place, "accelerometer and gyroscope with the same axes",
            f"accelerometer {_words(force)}, gyroscope {_words(turned)}",
            "they are combined wrongly on the board: correct its firmware's axes",
        )  # fmt: skip
    elif straight < STRAIGHT:
        report.add(
            place, "three directions at right angles", f"a cosine of {straight:.2f}",
            "lay and turn the robot squarely, and hold it still",
        )  # fmt: skip
    else:
        return _nearest_rotation(np.hstack([force, turned]), np.hstack([np.eye(3)] * 2))
    return None


def _nearest_rotation(measured: Array, known: Array | None = None) -> Array:
    """Return the rotation that turns the columns of ``known`` nearest to those of ``measured`` (Kabsch)."""
    u, _, v = np.linalg.svd(measured @ (np.eye(3) if known is None else known).T)
    keep = np.diag([1.0, 1.0, np.linalg.det(u) * np.linalg.det(v)])
    rotation: Array = u @ keep @ v
    return rotation


def _angle_between(one: Array, other: Array) -> float:
    """Return the angle between two rotations (3, 3) [rad]."""
    return float(np.arccos(np.clip(0.5 * (np.trace(one.T @ other) - 1.0), -1.0, 1.0)))


def _straightness(rotation: Array, measured: Array) -> float:
    """Return the least cosine between a measured column and that of the rotation."""
    sizes = np.linalg.norm(measured, axis=0)
    return float(((rotation * measured).sum(axis=0) / sizes).min())


def _note_mounting(session: Session, rotation: Array, report: StepReport) -> None:
    """Write how the board is mounted: square where a hand's error allows it, else as it was measured."""
    square = np.rint(rotation)
    is_square = np.array_equal(np.abs(square).sum(axis=0), np.ones(3))
    if is_square and _straightness(square, rotation) > np.cos(SQUARE_ERROR):
        rotation = square
    written = [round(angle, 4) for angle in imu_rotation_of(rotation.T)]
    told = session.hardware.board.imu_to_base
    apart = _angle_between(told.T, rotation)
    report.values["imu_rotation"] = written
    if apart > SQUARE_ERROR:
        report.add(
            "board.imu_rotation", _words(told.T), _words(rotation), "written", mended=True
        )  # fmt: skip
        session.write({}, {"imu_rotation": written})
    place = [
        1e-3 * session.operator.measure(Request("measure", f"imu {axis}", text))
        for axis, text in zip("xyz", _PLACES, strict=True)
    ]
    report.values["imu_position"] = place
    before = np.array(session.hardware.board.imu_position)
    if np.abs(place - before).max() > PLACE_ERROR:
        report.add(
            "board.imu_position", _millimetres(before), _millimetres(np.array(place)), "written",
            mended=True,
        )  # fmt: skip
        session.write({}, {"imu_position": [round(each, 4) for each in place]})


def _millimetres(place: Array) -> str:
    return ", ".join(f"{1e3 * each:.0f}" for each in place.tolist()) + " mm"


def _words(axes: Array) -> str:
    """Describe the direction of each axis of the board in words; columns are the robot's axes in its frame."""
    ways = (("forward", "backward"), ("left", "right"), ("up", "down"))
    named = []
    for k, axis in enumerate("xyz"):
        robot = int(np.abs(axes[k]).argmax())
        way = ways[robot][0 if axes[k, robot] > 0.0 else 1]
        off = np.degrees(np.arccos(min(1.0, abs(axes[k, robot]) / np.linalg.norm(axes[k]))))
        named.append(f"{axis} {way}" + (f" but for {off:.0f} deg" if off > 10.0 else ""))
    return ", ".join(named)


def _mean_force(session: Session) -> Array | None:
    """Return the mean specific force of some packets [m/s^2]; ``None`` if none come."""
    total, count = np.zeros(3), 0
    session.board.poll()
    for _ in range(POLLS):
        if session.board.poll():
            total += session.board.specific_force
            count += 1
        if count == STILL_PACKETS:
            return total / count
    return None


def _turn(session: Session, request: Request) -> Array:
    """Return the gyroscope's integral during a turn [rad], (3,)."""
    angle = np.zeros(3)
    session.board.poll()

    def observe() -> None:
        packets = session.board.poll()
        np.add(angle, packets * PACKET_TIME * session.board.angular_velocity, out=angle)

    session.do(request, observe)
    return angle
