"""A log of a robot, of whatever robot and by whomever, that plays the robot in a graph."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...blocks.signals import (
    ContactSwitches,
    DrivePhase,
    ImuReading,
    JointCommand,
    JointState,
    RobotHealth,
    RobotTruth,
)
from ...blocks.signals.robot import HEALTHY
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.block import Clock, Context, Input, Metric, Output, UnmetRequirement
from ...runtime.language.parameters import Parameters
from ..robot import Robot
from .columns import take_row
from .log_file import LogError, LogFile, read_log
from .parameters import LogParameters
from .played_log import play
from .played_rows import PlayedLog, PlayedRows

EXAMPLE = Path(__file__).with_name("example.csv")
"""Eleven rows of a gyroscope and an accelerometer at rest, made by hand."""


class LogRobot(Robot):
    """A log that plays the robot, with the ports of every robot: a graph runs on it as on a simulator.

    Reads HDF5 and MATLAB 7.3 (extra ``hdf5``), NPZ, CSV, Parquet, MCAP and ROS 2 bags (extra ``mcap``) and recordings of aloft.
    A parameter names columns: an array (``imuAcc``), a column of one (``imuAcc[2]``), a list of columns, or
    ``{columns: ..., unit: deg, scale: [-1.0], offset: [0.0]}``. Units in a CSV's header, ``q1 [deg]``, are taken.

    Joints are found by name; those that the log lacks stand at the description's ``held`` or standing angle. The IMU's samples are
    turned to the base's axes and moved to its origin: f - w x (w x r) - w' x r, and from another link over the joints between. A
    force becomes a contact with two thresholds. Between rows it is linear, holds the last row, or is the mean over the tick before;
    contacts always hold. A stamp may be 1 us late and still be that of a tick.

    **Time** is the log's by ``clock``: its stamps, an even grid between the first and the last of them, or a rate. The metric
    ``log_jitter`` is the standard deviation of the stamps' steps relative to their mean: where it is large, stamps are arrival times,
    and the even grid is right. Whole numbers that fall back by 2^32 are a counter that began again. A run begins where all columns
    have begun, and ends with the first that ends.

    **Rows that are none**: what is no number, and a quaternion of zeros, is left out; of rows with one stamp the last counts.
    ``health.imu_valid``, ``joints_valid`` and ``contacts_valid`` are false in gaps of more than five usual steps and where the log
    has no such columns; the first two also at samples that repeat the one before exactly, as a sensor that was not renewed does,
    the joints' only while they move. Metrics count gaps and repeats, and the result warns of what is likely wrong: units, signs,
    thresholds, rows left out, speeds that are not those of the angles or of the truth.

    Commands are not heard: a log cannot be controlled. A run ends with the log.

    ``truth`` has the base's pose by motion capture, its velocities by differences, and the contacts; other fields are
    zero. Its world is that of the cameras: ``EstimatorScore`` compares with ``align: start``.

    Mistakes in the parameters are reported all at once when the graph is checked.
    """

    Params = LogParameters
    params: LogParameters
    needs = ("robot",)
    outside = "no"

    command = Input(JointCommand, default={}, text="not heard: a log cannot be controlled")
    truth = Output(RobotTruth, truth=True, text="motion capture, in its own world")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report all that the log or the robot lacks, and a log that is shorter than the run."""
        assert isinstance(params, LogParameters) and context.robot is not None
        try:
            log = opened(context.folder / params.file)
        except LogError as error:
            yield UnmetRequirement(str(error), "file")
            return
        period = context.clock.base_period * context.period_ticks
        played = play(log, params, context.robot, period)
        _CHECKED[:] = [_Checked(log, params, context.robot, period, played)]
        for problem in played.problems:
            yield UnmetRequirement(
                problem.message, problem.parameter, expected=problem.expected, found=problem.found,
                fix=problem.fix,
            )  # fmt: skip
        duration = context.duration
        if not played.problems and duration is not None and played.duration < duration - 1e-9:
            yield UnmetRequirement(
                "the log is shorter than the run", "file", expected=f"{duration:g} s",
                found=f"{played.duration:.6g} s from begin to end",
                fix=f"duration: {np.floor(played.duration * 100) / 100:g} s",
            )  # fmt: skip

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Name the IMU of a small CSV file."""
        return {
            "file": str(EXAMPLE),
            "clock": {"stamps": "time"},
            "imu": {"angular_velocity": ["wx", "wy", "wz"], "specific_force": ["fx", "fy", "fz"]},
        }

    def setup(self) -> None:
        log = opened(self.context.folder / self.params.file)
        self.played: PlayedLog = _taken(log, self.params, self.robot, self.period)
        if self.played.problems:
            raise LogError("; ".join(problem.message for problem in self.played.problems))
        assert self.played.rows is not None
        self.rows = self.played.rows
        self.last_tick = len(self.rows.imu) - 1
        self.period_ticks = self.context.period_ticks
        # what a log does not tell stays zero from here on
        for signal in (self.health, self.truth):
            for view in signal.views().values():
                view[...] = 0
        self.health.state = DrivePhase.DRIVING
        self.health.condition[:] = HEALTHY

    @kernel
    @staticmethod
    def emit(  # type: ignore[override]  # a kernel, which names what it takes
        imu: ImuReading,
        joints: JointState,
        contacts: ContactSwitches,
        health: RobotHealth,
        truth: RobotTruth,
        rows: PlayedRows,
        clock: Clock,
        last_tick: int,
        period_ticks: int,
    ) -> None:
        tick = clock.tick // period_ticks
        i = min(tick, last_tick)
        imu.angular_velocity[:] = rows.imu[i, 0:3]
        imu.specific_force[:] = rows.imu[i, 3:6]
        take_row(rows.position, i, joints.position)
        take_row(rows.velocity, i, joints.velocity)
        take_row(rows.torque, i, joints.torque)
        for point in range(rows.closed.shape[1]):
            contacts.closed[point] = rows.closed[i, point]
            truth.contact_touched[point] = rows.closed[i, point]
        health.stamp = clock.base_period * clock.tick
        health.contacts_valid = rows.contacts_valid[i]
        health.imu_valid = rows.imu_valid[i]
        health.joints_valid = rows.joints_valid[i]
        health.imu_age = rows.imu_age[i]
        truth.base_position[:] = rows.pose[i, 0:3]
        truth.base_orientation[:] = rows.pose[i, 3:7]
        truth.base_linear_velocity[:] = rows.twist[i, 0:3]
        truth.base_angular_velocity[:] = rows.twist[i, 3:6]
        truth.joint_position[:] = joints.position
        truth.joint_velocity[:] = joints.velocity

    @kernel
    @staticmethod
    def update(clock: Clock, last_tick: int, period_ticks: int) -> bool:  # type: ignore[override]
        return clock.tick // period_ticks >= last_tick

    def on_event(self) -> None:
        """End the run with the log."""
        self.request_stop(f"the log ends after {self.last_tick * self.period:.2f} s")

    def metrics(self) -> Mapping[str, Metric]:
        """Return what is to be known of the log: its jitter, gaps and repeated samples."""
        played = self.played
        return {
            "log_rows": played.count, "log_rate_hz": played.rate, "log_jitter": played.jitter,
            "log_gaps": played.gaps, "log_repeated_imu_share": played.imu_repeats,
            "log_repeated_joints_share": played.joint_repeats,
        }  # fmt: skip

    def warnings(self) -> Sequence[str]:
        """Say what in the log may mislead an estimator."""
        return self.played.warnings

    def open(self) -> None:
        """Nothing is connected."""

    def read(self) -> None:
        """Nothing: ``emit`` plays the rows."""

    def write(self) -> None:
        """Nothing: a log does not hear commands."""

    def advance(self) -> None:
        """Nothing: time passes by the ticks."""

    def damp(self) -> None:
        """Nothing: there are no drives."""


class _Checked(NamedTuple):
    """A log as it was played when its graph was checked."""

    log: LogFile
    params: LogParameters
    robot: RobotDescription
    period: float
    played: PlayedLog


_CHECKED: list[_Checked] = []
"""The last one, until a run takes it: a long log is not played twice."""


def _taken(
    log: LogFile, params: LogParameters, robot: RobotDescription, period: float
) -> PlayedLog:
    """Return what a log plays; that of the check, if it is of the same."""
    if _CHECKED:
        last = _CHECKED.pop()
        if (
            last.log is log
            and last.robot is robot
            and (last.params, last.period) == (params, period)
        ):
            return last.played
    return play(log, params, robot, period)


@lru_cache(maxsize=4)
def _read(path: Path, size: int, changed: int) -> LogFile:
    return read_log(path)


def opened(path: Path) -> LogFile:
    """Return a log; of a file that has not changed since, what was read then.

    Raises:
        LogError: it cannot be read.
    """
    try:
        status = path.stat()
    except OSError as error:
        raise LogError(f"cannot read {path.name}: {error.strerror}") from None
    return _read(path, status.st_size, status.st_mtime_ns)
