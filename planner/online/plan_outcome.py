"""Which plan answers a request for the next hop."""

from __future__ import annotations

from enum import IntEnum


class PlanOutcome(IntEnum):
    """Which plan answers a request."""

    NONE = 0
    """None was asked for."""
    PLANNED = 1
    """A plan of what was asked."""
    NEAREST = 2
    """What was asked is out of reach; the plan is of the nearest that is within."""
    UNSOLVED = 3
    """No motion was found; the plan is the nearest of the stored ones."""
    INVALID = 4
    """The plan failed its check; the nearest of the stored ones is followed."""
