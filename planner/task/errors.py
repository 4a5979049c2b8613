"""The exceptions of the planner."""

from __future__ import annotations

from ...runtime.language.errors import AloftError


class TaskError(AloftError, ValueError):
    """A task cannot be read, or asks for what contradicts itself; the message has every reason."""


class PlanError(AloftError):
    """A jump that cannot be planned. ``family`` names the constraint family that cannot be met,
    ``violation`` is how far the best attempt missed it, in that family's unit."""

    def __init__(self, message: str, *, family: str = "", violation: float = 0.0) -> None:
        super().__init__(message)
        self.family = family
        self.violation = violation
