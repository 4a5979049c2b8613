"""Signals between a robot, simulated or real, and its controller.

Units, frames and orders are those of the package ``signals``.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from ...runtime.language.signals import Field, Signal


class CommandMode(IntEnum):
    """Response of a drive to a joint command."""

    OFF = 0
    """No torque."""
    ACTIVE = 1
    """Feedforward torque plus joint feedback at the drive's rate."""
    DAMPING = 2
    """Joint damping only: how every run ends."""


class ImuReading(Signal):
    """One sample of the inertial measurement unit, at the base's origin."""

    angular_velocity = Field(3, unit="rad/s", frame="body", text="gyroscope")
    specific_force = Field(3, unit="m/s^2", frame="body", text="accelerometer; at rest +g upwards")


class JointState(Signal):
    """Measurements of the joint encoders and drives.

    A field has one unit. In all arrays with an element for each joint it is that of joints that turn; the
    element of a joint that slides is in m for rad, m/s for rad/s and N for N m.
    """

    position = Field("n_joints", unit="rad", text="joint angles")
    velocity = Field("n_joints", unit="rad/s", text="joint velocities")
    torque = Field("n_joints", unit="N m", text="joint torques from measured motor current")


class ContactSwitches(Signal):
    """The raw tactile switches under the feet."""

    closed = Field("n_contacts", dtype="bool", text="each switch is pressed")


class DrivePhase(IntEnum):
    """Phase of a real robot's drives."""

    OFF = 0
    """Only watched: they were never enabled, or are off again."""
    STARTING = 1
    """On their way to the standing pose, with a current that is limited."""
    HOLDING = 2
    """Enabled, in the standing pose, before the first command."""
    DRIVING = 3
    """They follow the commands."""
    DAMPED = 4
    """The drives are damped until the end of the run."""


HEALTHY = 0x80
"""The error byte of a drive that has nothing to report: bit 7 is always set."""


@dataclass(frozen=True)
class DriveCondition:
    """One bit of the error byte.

    A warning passes by itself. With an error the actuator has switched its torque off.
    """

    bit: int
    critical: bool
    text: str


CONDITIONS = (
    DriveCondition(0, False, "it received a damaged packet"),
    DriveCondition(1, False, "its winding is hotter than temp_limit_low"),
    DriveCondition(2, True, "it cannot read its absolute position"),
    DriveCondition(3, True, "its watchdog ran out, or the emergency stop is pressed"),
    DriveCondition(4, True, "it is outside its position limits"),
    DriveCondition(5, True, "its supply voltage is out of range, or its gate driver failed"),
    DriveCondition(6, True, "its flash memory is corrupt"),
)


def drive_conditions(error_byte: int) -> tuple[DriveCondition, ...]:
    """Return the conditions that an error byte reports; none where the actuator is healthy."""
    return tuple(c for c in CONDITIONS if error_byte & 1 << c.bit)


def is_critical(error_byte: int) -> bool:
    """Check whether the actuator has switched its torque off, or its reply is no reply at all."""
    return not error_byte & HEALTHY or any(c.critical for c in drive_conditions(error_byte))


def describe_conditions(error_byte: int) -> str:
    """Name the conditions in words; empty where the actuator is healthy."""
    if not error_byte & HEALTHY:
        return f"its error byte is {error_byte:#04x}, whose highest bit should be set"
    return "; ".join(c.text for c in drive_conditions(error_byte))


class RobotHealth(Signal):
    """Condition of a robot's drives and sensors. Drives are in the motors' order.

    What a robot does not measure is zero, as in a simulator voltages, temperatures and currents.
    """

    state = Field(dtype="int64", values=DrivePhase, text="phase of the drives; see DrivePhase")
    voltage = Field("n_joints", unit="V", text="supply voltage at every drive")
    temperature = Field("n_joints", text="temperature of every winding [deg C]")
    current = Field("n_joints", unit="A", text="measured torque current of every drive")
    condition = Field(
        "n_joints", dtype="int64", text="error byte of every drive's last answer; healthy: 128"
    )
    age = Field("n_joints", unit="s", text="time since every drive answered last")
    imu_age = Field(unit="s", text="time since the last packet of the sensor board")
    stamp = Field(unit="s", text="time of the newest measurement; a negative one means nothing")
    joints_valid = Field(dtype="bool", text="every drive has answered in the last exchange")
    imu_valid = Field(
        dtype="bool", text="the board streams, and its IMU is not frozen or saturated"
    )
    contacts_valid = Field(dtype="bool", text="the board streams")
    late_cycles = Field(dtype="int64", text="exchanges that began too late, so far")
    lost_answers = Field(dtype="int64", text="answers that were lost or damaged, so far")


class JointCommand(Signal):
    """Command to the drives: mode, feedforward torque, joint targets and gains.

    Units as in ``JointState``: the gains of a joint that slides are in N/m and N s/m.
    """

    mode = Field(dtype="int64", values=CommandMode, text="see CommandMode")
    torque = Field("n_joints", unit="N m", text="feedforward joint torques")
    position = Field("n_joints", unit="rad", text="joint angle targets")
    velocity = Field("n_joints", unit="rad/s", text="joint velocity targets")
    stiffness = Field("n_joints", unit="N m/rad", text="joint feedback gain on position")
    damping = Field("n_joints", unit="N m s/rad", text="joint feedback gain on velocity")


class ThrustCommand(Signal):
    """Commanded thrust of a robot's thrusters, in the order of its description."""

    thrust = Field("n_thrusters", unit="N", text="thrust asked of each")


class ThrusterState(Signal):
    """Thrust of a robot's thrusters, in the order of its description."""

    thrust = Field("n_thrusters", unit="N", text="thrust of each")


class ExternalForce(Signal):
    """An external force on the robot."""

    force = Field(3, unit="N", frame="world", text="force")
    point = Field(dtype="int64", text="index of the named point it acts at, in file order")


class RobotTruth(Signal):
    """True state of the robot, known to a simulator only. Peaks and minima are over the physics steps of the last
    tick."""

    base_position = Field(3, unit="m", frame="world", text="base origin")
    base_orientation = Field(
        4, unit="", quaternion=True, text="quaternion x, y, z, w from body to world"
    )
    base_linear_velocity = Field(3, unit="m/s", frame="world", text="velocity of the base origin")
    base_angular_velocity = Field(3, unit="rad/s", frame="body", text="angular velocity")
    joint_position = Field("n_joints", unit="rad", text="joint angles")
    joint_velocity = Field("n_joints", unit="rad/s", text="joint velocities")
    com = Field(3, unit="m", frame="world", text="centre of mass")
    com_velocity = Field(3, unit="m/s", frame="world", text="its velocity")
    angular_momentum = Field(3, unit="N m s", frame="world", text="k about the com")
    contact_position = Field(("n_contacts", 3), unit="m", frame="world", text="contact points")
    contact_force = Field(
        ("n_contacts", 3), unit="N", frame="world", text="mean force on each point over the tick"
    )
    contact_touched = Field("n_contacts", dtype="bool", text="loaded in any physics step")
    ground_height = Field("n_contacts", unit="m", frame="world", text="ground under each point")
    forbidden_contacts = Field(
        dtype="int64", text="physics steps with any contact but a contact point's on the ground"
    )
    joint_limit_violation = Field(unit="rad", text="largest violation of a joint limit")
    motor_torque = Field("n_joints", unit="N m", text="motor torque of largest magnitude")
    motor_speed = Field("n_joints", unit="rad/s", text="motor speed of largest magnitude")
    motor_overload = Field(
        unit="N m", text="largest excess of a motor torque over what its speed allows"
    )
    saturated_share = Field(unit="", text="share of motor samples at the torque limit")
