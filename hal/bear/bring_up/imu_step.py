"""The step that finds how the IMU is mounted, by laying the robot down and by turning it."""

from __future__ import annotations

import numpy as np

from ....mathematics.arrays import Array
from .session import PACKET_TIME, Outcome, Request, Session

GRAVITY = 9.81
GRAVITY_ERROR = 0.1
"""The share of gravity by which the accelerometer may differ at rest."""
QUARTER = 0.5 * np.pi
TURN_ERROR = 0.2
"""The share of a quarter turn by which the gyroscope may differ: it is turned by hand."""
STRAIGHT = 0.9
"""The least cosine between a measured direction and the axis that it belongs to."""
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


def check_imu(session: Session) -> Outcome:
    """Compare gravity in three positions, and three quarter turns, with the robot's axes."""
    outcome = Outcome()
    force, turned = np.zeros((3, 3)), np.zeros((3, 3))
    for k, (side, text) in enumerate(_SIDES):
        session.do(Request("place", side, text))
        mean = _mean_force(session)
        if mean is None:
            outcome.add(
                "board.port", "packets of the sensor board", "none",
                f"check that the board at {session.hardware.board.port} is powered and streams",
            )  # fmt: skip
            return outcome
        force[:, k] = mean
    for k, (axis, text) in enumerate(_AXES):
        turned[:, k] = _turn(session, Request("turn", axis, text))
    outcome.values |= {"specific_force": force.tolist(), "turned": turned.tolist()}
    for k, (side, _) in enumerate(_SIDES):
        size = float(np.linalg.norm(force[:, k]))
        if abs(size / GRAVITY - 1.0) > GRAVITY_ERROR:
            outcome.add(
                f"accelerometer, robot on its {side}", f"{GRAVITY:.2f} m/s^2", f"{size:.2f} m/s^2",
                "its range or its unit is another: configure the board",
            )  # fmt: skip
    for k, (axis, _) in enumerate(_AXES):
        size = float(np.linalg.norm(turned[:, k]))
        if abs(size / QUARTER - 1.0) > TURN_ERROR:
            outcome.add(
                f"gyroscope, turn about {axis}", "90 deg", f"{np.degrees(size):.0f} deg",
                "its range or its unit is another (board.gyro_range), or it was turned too fast",
            )  # fmt: skip
    if not outcome.findings:
        _compare_axes(force / GRAVITY, turned / QUARTER, outcome)
    return outcome


def _compare_axes(force: Array, turned: Array, outcome: Outcome) -> None:
    """Note a mounting that is turned or mirrored; columns are the robot's axes in the board's frame."""
    axes, spins = np.rint(force), np.rint(turned)
    straight = min(float((a * b).sum(axis=0).min()) for a, b in ((axes, force), (spins, turned)))
    if straight < STRAIGHT or not np.array_equal(np.abs(axes).sum(axis=0), np.ones(3)):
        outcome.add(
            "IMU", "gravity and turns along its axes", "directions between its axes",
            "lay and turn the robot squarely; if it was, the board is mounted askew",
        )  # fmt: skip
    elif not np.array_equal(axes, spins):
        outcome.add(
            "IMU", "accelerometer and gyroscope with the same axes",
            f"accelerometer {_words(axes)}, gyroscope {_words(spins)}",
            "they are combined wrongly on the board: correct its firmware's axes",
        )  # fmt: skip
    elif np.linalg.det(axes) < 0.0:
        outcome.add(
            "IMU", "right-handed axes", f"left-handed: {_words(axes)}",
            "one axis is inverted: correct the board's firmware",
        )  # fmt: skip
    elif not np.array_equal(axes, np.eye(3)):
        outcome.add(
            "IMU", "x forward, y left, z up", _words(axes),
            "mount the board along the robot's axes",
        )  # fmt: skip


def _words(axes: Array) -> str:
    """Where each axis of the board points, in words."""
    ways = (("forward", "backward"), ("left", "right"), ("up", "down"))
    named = []
    for k, axis in enumerate("xyz"):
        robot = int(np.abs(axes[k]).argmax())
        named.append(f"{axis} {ways[robot][0 if axes[k, robot] > 0.0 else 1]}")
    return ", ".join(named)


def _mean_force(session: Session) -> Array | None:
    """The mean specific force of some packets [m/s^2]; ``None`` if none come."""
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
    """The gyroscope's integral during a turn [rad], (3,)."""
    angle = np.zeros(3)
    session.board.poll()

    def observe() -> None:
        packets = session.board.poll()
        np.add(angle, packets * PACKET_TIME * session.board.angular_velocity, out=angle)

    session.do(request, observe)
    return angle
