"""A plan that the planner hands over in parts, and the one that is followed."""

from __future__ import annotations

from ....mathematics.kernel import kernel
from ....runtime.language.signals import Field
from ..signals import PLAN_ROWS, SEGMENT_ROWS, PlanRows, PlanSegment

BEHIND = 10.0
"""Rows behind the last one of a plan repeat it, so far apart [s]."""


class ReceivedPlan(PlanRows):
    """The plan that is handed over, row by row."""

    segments = Field(dtype="int64", text="segments that have come")
    whole = Field(dtype="bool", text="all parts have come")


class FollowedPlan(PlanRows):
    """The plan that is followed."""

    sums = Field((PLAN_ROWS, "plan_width"), text="integrals of the columns")
    touchdowns = Field(1, unit="s", text="start of the landing")
    began = Field(unit="s", text="time of the run at which it began")


@kernel
def receive(segment: PlanSegment, number: int, received: ReceivedPlan) -> None:
    """Copy the part of the plan that comes next, if it is there."""
    if received.whole or segment.number != number or segment.segment != received.segments:
        return
    first = segment.segment * SEGMENT_ROWS
    for row in range(SEGMENT_ROWS):
        received.time[first + row] = segment.time[row]
        received.rows[first + row, :] = segment.rows[row]
        for point in range(segment.contact.shape[1]):
            received.contact[first + row, point] = segment.contact[row, point]
    received.segments += 1
    if received.segments < segment.segments:
        return
    last = received.segments * SEGMENT_ROWS - 1
    for row in range(last + 1, received.time.shape[0]):
        received.time[row] = received.time[row - 1] + BEHIND
        received.rows[row, :] = received.rows[last]
        for point in range(segment.contact.shape[1]):
            received.contact[row, point] = received.contact[last, point]
    received.marks[:] = segment.marks
    received.jumps[0, :] = segment.jump
    received.toes_first[0] = segment.toes_first
    received.outcome = segment.outcome
    received.done[0], received.done[1] = segment.ahead, segment.aside
    received.done[2], received.done[3] = segment.turn, segment.up
    received.whole = True
