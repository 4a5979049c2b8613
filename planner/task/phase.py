"""The phases of a jump: words of the task, of its plan and of the blocks that follow it."""

from __future__ import annotations

from enum import IntEnum


class Phase(IntEnum):
    """Phase of the robot, in the order of a jump."""

    HANG = -1
    """Hanging in a gantry, or being put down, without carrying itself yet."""
    STAND = 0
    SQUAT = 1
    THRUST = 2
    FLIGHT = 3
    LANDING = 4
    RECOVER = 5
    FAULT = 6
