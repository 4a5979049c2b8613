"""Validation of data as a robot that can exist: every fault at once, each with its place."""

from .faults import RobotError, RobotFault
from .find_faults import find_faults

__all__ = ["RobotError", "RobotFault", "find_faults"]
