"""Validation of data as a robot that can exist: every fault at once, each with its place."""

from .errors import DescriptionError, RobotError
from .find_errors import find_errors

__all__ = ["DescriptionError", "RobotError", "find_errors"]
