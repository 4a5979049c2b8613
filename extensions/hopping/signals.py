"""Signals of jumps that are commanded while the robot moves.

Units, frames and orders are those of the package ``signals``. Commands and requests are relative to the
feet: ahead and to the left of their middle, in the direction in which they point. A command may be a place in the
world instead.
"""

from __future__ import annotations

from ...runtime.language.signals import Field, Signal
from .planner.plan_outcome import PlanOutcome

SEGMENT_ROWS = 20
"""Rows of a plan that are handed over at a time."""
PLAN_ROWS = 240
"""Rows of a plan at most."""
STONES_SEEN = 2
"""Largest number of stones seen ahead."""


class JumpCommand(Signal):
    """Command of the next jump's landing."""

    number = Field(
        dtype="int64", text="counts the commands; a jump follows a number that is greater"
    )
    replaces = Field(
        dtype="bool",
        text="it takes the place of a command whose jump has not begun; else it waits for it",
    )
    placed = Field(
        dtype="bool",
        text="the rest is a foothold in the estimator's world: x, y, heading and height of the ground",
    )
    ahead = Field(unit="m", text="distance ahead of the feet")
    aside = Field(unit="m", text="distance to their left")
    turn = Field(unit="rad", text="change of heading, to the left")
    up = Field(unit="m", text="height of the ground there above the present one")


class BodyTwist(Signal):
    """The commanded velocity, with the fields of ROS 2's ``Twist``."""

    linear = Field(
        3, unit="m/s", frame="body", text="ahead and to the left; upwards: a jump on the spot"
    )
    angular = Field(3, unit="rad/s", frame="body", text="the third: to the left")


class FootholdPose(Signal):
    """Commanded place of the feet, with the fields of ROS 2's ``PoseStamped``."""

    position = Field(3, unit="m", frame="world", text="of the middle of the feet, on the ground")
    orientation = Field(4, text="their heading, as a quaternion; all zeros: none yet")


class SeenStones(Signal):
    """The next footholds, in the order in which they follow."""

    count = Field(dtype="int64", text="number of stones seen; rows behind them keep their numbers")
    place = Field(
        (STONES_SEEN, 3), unit="m", frame="world", text="places for the middle of the feet"
    )


class PlanRequest(Signal):
    """The jump that should be planned, from where the feet stand."""

    number = Field(dtype="int64", text="counts the requests, from 1; zero: none yet")
    command = Field(dtype="int64", text="number of the command that it answers")
    waits = Field(dtype="bool", text="its jump has not begun yet")
    ahead = Field(unit="m", text="distance ahead of the feet")
    aside = Field(unit="m", text="distance to their left")
    turn = Field(unit="rad", text="change of heading, to the left")
    up = Field(unit="m", text="height of the ground there above the present one")


class PlanSegment(Signal):
    """A few rows of a plan, which is handed over part by part; see ``JumpTable``."""

    number = Field(dtype="int64", text="of the request; zero: no plan yet")
    segment = Field(dtype="int64", text="number of this segment, from 0")
    segments = Field(dtype="int64", text="number of segments of the plan")
    time = Field(SEGMENT_ROWS, unit="s", text="of each row, since the plan begins")
    rows = Field((SEGMENT_ROWS, "plan_width"), text="columns of the reference, side by side")
    contact = Field((SEGMENT_ROWS, "n_contacts"), dtype="bool", text="points that carry load")
    marks = Field(2, unit="s", text="times at which squat and recovery begin")
    jump = Field(3, unit="s", text="times at which thrust, flight and landing begin")
    toes_first = Field(dtype="bool", text="the flight ends on some of the points only")
    outcome = Field(dtype="int64", values=PlanOutcome, text="kind of the plan")
    ahead = Field(unit="m", text="distance of the landing ahead of the feet")
    aside = Field(unit="m", text="distance to their left")
    turn = Field(unit="rad", text="its change of heading")
    up = Field(unit="m", text="height of the ground there above the present one")


class PlanRows(Signal):
    """A whole plan of one jump as state, as ``TableRows`` has it: rows behind the last one repeat it."""

    time = Field(PLAN_ROWS, unit="s", text="of each row, since the plan begins")
    rows = Field((PLAN_ROWS, "plan_width"), text="columns of the reference, side by side")
    contact = Field((PLAN_ROWS, "n_contacts"), dtype="bool", text="points that carry load")
    marks = Field(2, unit="s", text="times at which squat and recovery begin")
    jumps = Field((1, 3), unit="s", text="times at which thrust, flight and landing begin")
    toes_first = Field(1, dtype="bool", text="the flight ends on some of the points only")
    outcome = Field(dtype="int64", values=PlanOutcome, text="kind of the plan")
    done = Field(4, text="place of the landing: ahead, aside [m], turn [rad] and up [m]")


class JumpFrame(Signal):
    """The frame of the jump that is made: the middle of the feet before it, and their heading."""

    origin = Field(3, unit="m", frame="world", text="in the estimator's world")
    heading = Field(unit="rad", frame="world", text="about its vertical")


class CourseGoal(Signal):
    """Goal of the feet after the last command that was taken, by all commands so far."""

    number = Field(dtype="int64", text="jumps that were begun")
    position = Field(
        2, unit="m", text="middle of the feet, from where they stood when the run began"
    )
    heading = Field(unit="rad", text="their heading since then, to the left")
    height = Field(unit="m", text="of the ground there, above that where the run began")
    outcome = Field(
        dtype="int64", values=PlanOutcome, text="kind of the plan that the last jump follows"
    )
