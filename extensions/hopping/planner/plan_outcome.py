"""Outcome of a request for the next hop's plan."""

from __future__ import annotations

from enum import IntEnum


class PlanOutcome(IntEnum):
    """Plan that answers a request."""

    NONE = 0
    """No request."""
    PLANNED = 1
    """A plan of the requested hop."""
    NEAREST = 2
    """The request is out of reach; the plan is of the nearest hop within it."""
    UNSOLVED = 3
    """No motion was found; the plan is the nearest of the stored ones."""
    INVALID = 4
    """The plan failed its check; the nearest of the stored ones is followed."""
