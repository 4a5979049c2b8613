"""The faults that ``SafetyMonitor`` finds, and their texts."""

from __future__ import annotations

from enum import IntEnum

from ..signals import SwitchFault


class SafetyFault(IntEnum):
    """The reason why the robot was put into damping."""

    NONE = 0
    TILT = 1
    """The base leant too far for too long."""
    JOINT_LIMIT = 2
    """A joint went beyond its limits."""
    JOINT_SPEED = 3
    """A joint turned too fast for too long."""
    ABSURD_STATE = 5
    """A state is not finite or beyond anything the robot can do."""
    ABSURD_COMMAND = 6
    """A command is not finite or beyond anything the drives can do."""
    SOLVER = 7
    """The whole-body controller failed too often in a row."""
    DRIVE = 8
    """A drive reports an error."""
    SILENT_DRIVE = 9
    """A drive has not answered for too long."""
    VOLTAGE = 10
    """The supply voltage of a drive was too low for too long."""
    TEMPERATURE = 11
    """The winding of a drive was too hot for too long."""
    CURRENT = 12
    """The current of a drive was too large for too long."""
    SILENT_IMU = 13
    """The sensor board has sent nothing for too long."""
    INVALID_JOINTS = 14
    """The joint readings were marked as not valid for too long."""
    INVALID_IMU = 15
    """The IMU's readings were marked as not valid for too long."""
    INVALID_CONTACTS = 16
    """The foot switches' readings were marked as not valid for too long."""
    STALE_HEALTH = 17
    """The robot's time stamp stopped changing."""
    SWITCH = 18
    """A foot switch is stuck or bounces."""
    STUCK_JOINT = 19
    """The readings of a joint stopped changing."""
    STUCK_IMU = 20
    """The readings of an axis of the IMU stopped changing."""
    TORQUE = 21
    """The torque of a joint does not follow its command."""


TEXTS = {
    SafetyFault.TILT: "the base leant more than `tilt_limit`",
    SafetyFault.JOINT_LIMIT: "a joint went beyond its limits",
    SafetyFault.JOINT_SPEED: "a joint turned faster than `speed_limit`",
    SafetyFault.ABSURD_STATE: "the state is not finite, or beyond anything the robot can do",
    SafetyFault.ABSURD_COMMAND: "the command is not finite, or beyond anything the drives can do",
    SafetyFault.SOLVER: "the whole-body controller failed too often in a row",
}
"""The faults of motion and computation in words; those of the hardware name a drive and a value."""


SWITCH_TEXTS = {
    SwitchFault.STUCK_CLOSED: "is stuck: it was closed in the air",
    SwitchFault.STUCK_OPEN: "is stuck: it was open under a foot that stood",
    SwitchFault.BOUNCING: "bounces: it opened and closed too often",
}
"""The faults of a foot switch, in words."""


def is_of_hardware(fault: SafetyFault) -> bool:
    """Check whether the robot's hardware reported the fault, so that the run must end."""
    return fault >= SafetyFault.DRIVE
