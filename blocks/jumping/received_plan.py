"""A plan that the planner hands over in parts, and the one that is followed."""

from __future__ import annotations

from ...mathematics.kernel import kernel
from ...runtime.language.signals import Field
from ..signals import PlanPart
from ..signals.steering import PART_ROWS, PLAN_ROWS, PlanRows

BEHIND = 10.0
"""Rows behind the last one of a plan repeat it, so far apart [s]."""


class ReceivedPlan(PlanRows):
    """The plan that is handed over, row by row."""

    parts = Field(dtype="int64", text="parts that have come")
    whole = Field(dtype="bool", text="all parts have come")


class FollowedPlan(PlanRows):
    """The plan that is followed."""

    sums = Field((PLAN_ROWS, "plan_width"), text="integrals of the columns")
    touchdowns = Field(1, unit="s", text="start of the landing")
    began = Field(unit="s", text="time of the run at which it began")


@kernel
def receive(part: PlanPart, number: int, received: ReceivedPlan) -> None:
    """Copy the part of the plan that comes next, if it is there."""
    if received.whole or part.number != number or part.part != received.parts:
        return
    first = part.part * PART_ROWS
    for row in range(PART_ROWS):
        received.time[first + row] = part.time[row]
        received.rows[first + row, :] = part.rows[row]
        for point in range(part.contact.shape[1]):
            received.contact[first + row, point] = part.contact[row, point]
    received.parts += 1
    if received.parts < part.parts:
        return
    last = received.parts * PART_ROWS - 1
    for row in range(last + 1, received.time.shape[0]):
        received.time[row] = received.time[row - 1] + BEHIND
        received.rows[row, :] = received.rows[last]
        for point in range(part.contact.shape[1]):
            received.contact[row, point] = received.contact[last, point]
    received.marks[:] = part.marks
    received.jumps[0, :] = part.jump
    received.toes_first[0] = part.toes_first
    received.outcome = part.outcome
    received.done[0], received.done[1] = part.ahead, part.aside
    received.done[2], received.done[3] = part.turn, part.up
    received.whole = True
