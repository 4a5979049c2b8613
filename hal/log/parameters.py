"""The parameters of a log that plays the robot: which columns are what."""

from __future__ import annotations

from typing import Literal

from ...runtime.language.parameters import Parameters, parameter
from .columns import Columns, LogClock


class LogImu(Parameters):
    """The columns of the IMU, and where it sits."""

    angular_velocity: Columns = parameter(text="three columns of the gyroscope [rad/s]")
    specific_force: Columns = parameter(text="three columns of the accelerometer [m/s^2]")
    sensor: str | None = parameter(
        None,
        text="a sensor of the robot's description: its link, place and turn are the IMU's",
    )
    link: str | None = parameter(
        None,
        text="the link that carries it, if no sensor is named, such as a chest; none: the base",
    )
    position: list[float] = parameter(
        [0.0, 0.0, 0.0], unit="m", text="place from its link's origin, if no sensor is named"
    )
    rpy: list[float] = parameter(
        [0.0, 0.0, 0.0], unit="rad", text="turn from its link's axes: roll, pitch, yaw"
    )


class LogJoints(Parameters):
    """The columns of the joints."""

    names: list[str] | str | None = parameter(
        None,
        text="joints in the columns' order, - for one that is none, or the file's list of them; none: the robot's joints",
    )
    position: Columns = parameter(text="a column for each joint [rad]")
    velocity: Columns | None = parameter(
        None, text="their speeds [rad/s]; none: differences of the angles"
    )
    torque: Columns | None = parameter(None, text="their torques [N m]; none: zeros")
    commanded: Columns | None = parameter(
        None,
        text="commanded torques [N m], of which `aloft robot identify` finds the delay; no port has them",
    )


class LogContact(Parameters):
    """The columns of one foot's contact."""

    force: Columns | None = parameter(
        None,
        text="a column of the force on the foot along its sole's normal [N], or six: force and moment [N, N m] on it about the "
        "sole's centre, in its link's axes",
    )
    closes: float = parameter(20.0, unit="N", text="force above which the switches close")
    opens: float = parameter(10.0, unit="N", text="force below which they open")
    closed: Columns | None = parameter(
        None,
        text="in place of a force: columns of its switches, one of which is not zero in contact",
    )


class LogTruth(Parameters):
    """The columns of motion capture, in a world of its own."""

    position: Columns = parameter(text="three columns of the base's origin [m]")
    rpy: Columns | None = parameter(None, text="roll, pitch, yaw of the base [rad]")
    quaternion: Columns | None = parameter(None, text="in place of them: four columns")
    order: Literal["xyzw", "wxyz"] = parameter("xyzw", text="of the quaternion's columns")


class LogParameters(Parameters):
    """The parameters of ``LogRobot``."""

    file: str = parameter(text="the log, relative to the graph's folder; a folder is a ROS 2 bag")
    clock: LogClock = parameter(LogClock, text="when rows were taken")
    imu: LogImu | None = parameter(None, text="the IMU")
    joints: LogJoints | None = parameter(None, text="the joints; none: they stand")
    contacts: dict[str, LogContact] = parameter({}, text="by the name of a foot")
    truth: LogTruth | None = parameter(None, text="motion capture")
    between: Literal["linear", "hold", "mean"] = parameter("linear", text="rule between two rows")
    begin: float = parameter(0.0, unit="s", ge=0.0, text="of the log, at which the run begins")
    end: float | None = parameter(None, unit="s", gt=0.0, text="of the log, at which the run ends")
