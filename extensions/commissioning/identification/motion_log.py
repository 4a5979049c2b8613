"""Logs of motion and torque for identification, of whatever robot and by whomever: angles and torques of the joints, and of a
floating base its motion and the forces of the ground."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....mathematics.arrays import Array, Flags2D
from ....mathematics.constants import GRAVITY
from ....robots.robot_description import RobotDescription
from ....runtime.language.errors import AloftError
from .identification import IdentificationError

if TYPE_CHECKING:
    from ....logs.file.reader import RecordedRun


IMU_STD, CAPTURE_STD = 0.1, 0.01
"""Standard deviations of the mean specific force by an IMU and by motion capture [m/s^2]."""


@dataclass(frozen=True)
class MotionLog:
    """The measurements of one run on an even grid, one row a sample. What was not measured is None.

    Attributes:
        name: of the log, for reports.
        period: between two samples [s].
        position: of the joints [rad or m], (n, n_joints).
        torque: measured at the joints [N m or N], (n, n_joints).
        asked: commanded torques without joint feedback [N m or N], (n, n_joints).
        base: of a floating base, in its axes: rate [rad/s] and specific force at its origin [m/s^2], (n, 6).
        base_std: to which the mean of that force is known [m/s^2]: an IMU's offset, or motion capture's.
        closed: which contact points touch the ground, (n, n_contacts).
        wrenches: force and moment on each foot about its sole's centre, in its link's axes, (n, n_feet, 6) [N, N m]; no number
            where a part was not measured.
    """

    name: str
    period: float
    position: Array
    torque: Array | None = None
    asked: Array | None = None
    base: Array | None = None
    base_std: float = IMU_STD
    closed: Flags2D | None = None
    wrenches: Array | None = None

    @property
    def duration(self) -> float:
        """From the first sample to the last [s]."""
        return self.period * (len(self.position) - 1)


def log_of_recording(
    run: RecordedRun, block: str = "robot", command: str = "safety.command"
) -> MotionLog:
    """Pick the signals of a recorded run. Only the joints' positions have to be there.

    Raises:
        AloftError: there are none under this name, or ticks are missing.
    """
    signals = run.signals()

    def signal(name: str) -> Array | None:
        return run[name] if name in signals else None

    position = signal(f"{block}.joints.position")
    if position is None:
        near = [name for name in signals if name.endswith(".position")][:4]
        raise AloftError(
            f"{run.path}: no signal '{block}.joints.position', and without the joints' positions nothing is told; "
            f"--robot names the robot's block{' (there is ' + ', '.join(near) + ')' if near else ''}"
        )
    if (np.diff(run.ticks) != 1).any():
        raise AloftError(
            f"{run.path}: the robot must run, and be recorded, in every tick of the graph"
        )
    asked = signal(f"{command}.torque")
    for gain in ("stiffness", "damping"):
        values = signal(f"{command}.{gain}")
        if values is not None and (values != 0.0).any():
            asked = None  # the drives add torques of their own
    torque = signal(f"{block}.joints.torque")
    measured = None if torque is None or not torque.any() else torque
    rate, force = signal(f"{block}.imu.angular_velocity"), signal(f"{block}.imu.specific_force")
    base = None
    if rate is not None and force is not None and force.any():
        # a robot's specific force is the mean over the tick before
        middle = 0.5 * (force + np.concatenate([force[1:], force[-1:]]))
        base = np.hstack([rate, middle])
    closed = signal(f"{block}.contacts.closed")
    return MotionLog(
        run.path.name, 1.0 / run.header.base_rate, position, measured, asked, base,
        closed=None if closed is None else closed.astype(bool),
    )  # fmt: skip


def log_of_graph(file: Path, block: str | None = None) -> tuple[MotionLog, RobotDescription]:
    """Read the log of a graph's ``hal.LogRobot`` at the graph's rate, without a run.

    Args:
        file: the graph.
        block: the path of its LogRobot; by default its only one.

    Raises:
        AloftError: the graph has errors or no such block, or the log lacks what the block names.
    """
    from .... import load
    from ....hal.log.log_robot import LogRobot, opened
    from ....hal.log.parameters import LogParameters
    from ....hal.log.played_log import play

    checked = load(file).checked
    found = [
        spec for spec in checked.blocks
        if issubclass(spec.block_type, LogRobot) and block in (None, spec.path)
    ]  # fmt: skip
    robot = checked.robot
    if robot is None or len(found) != 1:
        raise AloftError(
            f"{file}: {len(found)} blocks hal.LogRobot{f' called {block}' if block else ''}, and identification reads one; "
            "--robot names it"
        )
    params, period = found[0].params, checked.base_period * found[0].period_ticks
    assert isinstance(params, LogParameters)
    played = play(opened(found[0].folder / params.file), params, robot, period)
    rows = played.rows
    if params.joints is None or rows is None:
        raise AloftError(f"{file}: {params.file} names no joints, and nothing is told without")
    position = rows.position.at_ticks()
    torque = None if params.joints.torque is None else rows.torque.at_ticks()
    base = None
    if params.truth is not None:
        base = _motion_of(rows.pose, rows.twist, period)
    if params.imu is not None:
        # where there is a truth, it tells the biases of the sensors
        base = rows.imu if base is None else rows.imu - (rows.imu - base).mean(axis=0)
    closed = rows.closed if params.contacts else None
    log = MotionLog(
        Path(params.file).name, period, position, torque, played.commanded, base,
        IMU_STD if params.truth is None else CAPTURE_STD, closed, played.wrenches,
    )  # fmt: skip
    return log, robot


def _motion_of(pose: Array, twist: Array, period: float) -> Array:
    """Return the base's rate and specific force in its axes (n, 6), by pose (n, 7) and twist (n, 6) of motion capture."""
    from ....hal.log.turns import rotation_of

    whole = np.gradient(twist[:, :3], period, axis=0)
    whole[:, 2] += GRAVITY
    turn = rotation_of(pose[:, 3:])
    return np.hstack([twist[:, 3:], np.einsum("nji,nj->ni", turn, whole)])


def _floating_lacks(log: MotionLog, robot: RobotDescription) -> str:
    """Say what the equations of a floating base need and a log lacks; empty where it has all."""
    if log.base is None:
        return "neither an IMU nor motion capture, and the base's equations need its rate and acceleration (imu, or truth)"
    if robot.contacts and log.closed is None:
        return "no contacts, so nothing says when the ground's forces act (contacts: a force, or closed)"
    return ""


def missing(log: MotionLog, robot: RobotDescription) -> list[str]:
    """Say what a log cannot tell, and why; empty where it has all that the fit uses.

    Raises:
        IdentificationError: it tells nothing: the text says what would.
    """
    untold = []
    if robot.base_joint == "floating":
        lacks = _floating_lacks(log, robot)
        if lacks:
            raise IdentificationError(f"{log.name} of {robot.name}, whose base floats, has {lacks}")
        if log.torque is None:
            untold.append(
                "friction, rotor inertia, torque constants and delay: a log without torques tells what the base's equations hold"
            )
    elif log.torque is None:
        raise IdentificationError(
            f"{log.name} has no torques, so masses, inertias, gravity terms, friction, rotor inertia, torque constants and "
            "delay cannot be told: motion alone determines none of them. Log the measured torques, or the motors' "
            "currents times their torque constants (joints.torque)"
        )
    if robot.base_joint == "planar":
        raise IdentificationError(
            f"{robot.name} has a planar base, and inertias are told from logs of floating and of fixed ones"
        )
    if log.asked is None and log.torque is not None:
        untold.append("delay: the log has no commanded torques without joint feedback")
    return untold
