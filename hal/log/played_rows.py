"""A log on the ticks of a graph: the rows that every tick plays, and what is wrong with the log."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from ...mathematics.arrays import Array, Array1D, Array2D, Flags1D, Flags2D
from .columns import TimedRows


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
    contacts_valid: Flags1D
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
