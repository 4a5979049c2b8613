"""Several jumps in a row: the record of those that are over, and their judgement.

The last jump of a row is judged like any jump; those before it by their flight, their lift-off speed,
their apex and where they land.
"""

from __future__ import annotations

from math import degrees, hypot

from ...runtime.language.signals import Field, Signal
from .jump_criteria import JumpCriteria, JumpRecord, feet_turned
from .stand_criteria import NEVER

EARLY_LIFT_OFF = 0.1
"""Feet that leave the ground more than this time [s] before the planned lift-off have bounced."""


class JumpSeries(Signal):
    """The jumps of a row that are over. Every figure is that of the worst of these jumps."""

    made = Field(dtype="int64", text="number of jumps that have touched down")
    landed_time = Field(unit="s", text="when the last of them touched down")
    planned_lift_off = Field(unit="s", text="the planned lift-off of the jump under way or next")
    flight_share = Field(unit="", text="least share of the planned flight time")
    flight_jump = Field(dtype="int64", text="number of that jump, from 1")
    speed_error = Field(
        unit="", text="greatest error of the lift-off speed, as a share of the planned one"
    )
    speed_jump = Field(dtype="int64", text="number of that jump")
    rise_error = Field(unit="", text="greatest error of the apex, as a share of the planned rise")
    rise_jump = Field(dtype="int64", text="number of that jump")
    place_error = Field(unit="m", text="greatest distance of the feet from where they should land")
    place_now = Field(unit="m", text="error of the present landing")
    place_jump = Field(dtype="int64", text="number of that jump")
    turn_error = Field(unit="rad", text="greatest error of the feet's heading")
    turn_now = Field(unit="rad", text="error of the present landing")
    turn_jump = Field(dtype="int64", text="number of that jump")


def goes_on(series: JumpSeries, limits: JumpCriteria) -> bool:
    """Whether more jumps must follow the one under way."""
    return int(series.made) + 1 < limits.jumps


def note_landing(record: JumpRecord, series: JumpSeries, planned: bool) -> None:
    """Record a jump that has touched down, and prepare for the next lift-off."""
    series.made += 1
    series.landed_time[()] = record.touchdown_time
    if series.made == 1:
        series.flight_share[()] = 1e9
    if planned:
        jump = int(series.made)
        flight = float(record.touchdown_time - record.lift_off_time)
        share = flight / max(float(record.planned_flight), 1e-9)
        if share < series.flight_share:
            series.flight_share[()], series.flight_jump[()] = share, jump
        speed = abs(float(record.planned_speed))
        error = abs(float(record.lift_off_speed) - float(record.planned_speed)) / max(speed, 1e-9)
        if error > series.speed_error:
            series.speed_error[()], series.speed_jump[()] = error, jump
        rise = float(record.planned_apex - record.planned_standing)
        error = abs(float(record.apex_height - record.standing_height) - rise) / max(rise, 1e-9)
        if error > series.rise_error:
            series.rise_error[()], series.rise_jump[()] = error, jump
    for instant in (record.lift_off_time, record.touchdown_time, record.unloaded_time):
        instant[()] = NEVER
    record.peak_tilt[()] = 0.0


def note_place(record: JumpRecord, series: JumpSeries) -> None:
    """Between two jumps: note how far the feet are from their planned position."""
    off = [0.0, 0.0]
    for foot in range(record.foot.shape[0]):
        for axis in range(2):
            moved = record.foot.item(foot, axis) - record.start_foot.item(foot, axis)
            planned = record.planned_foot.item(foot, axis) - record.planned_start.item(foot, axis)
            off[axis] += (moved - planned) / record.foot.shape[0]
    series.place_now[()] = hypot(*off)
    turn = float(record.planned_yaw - record.planned_yaw_start)
    series.turn_now[()] = abs(feet_turned(record) - turn)


def keep_place(series: JumpSeries) -> None:
    """When the next jump lifts off: keep the last landing's error if it is the largest."""
    jump = int(series.made)
    if series.place_now > series.place_error:
        series.place_error[()], series.place_jump[()] = series.place_now, jump
    if series.turn_now > series.turn_error:
        series.turn_error[()], series.turn_jump[()] = series.turn_now, jump


def series_failure(series: JumpSeries, limits: JumpCriteria, made: int) -> str | None:
    """The first criterion of a row of jumps that does not hold, in words, or ``None``.

    ``made`` is the number of jumps that are over, including the last.
    """
    s, c = series, limits
    verdicts = (
        (made == c.jumps, f"made {made} of {c.jumps} jumps"),
        (
            s.flight_share >= c.flight_share,
            (
                f"jump {int(s.flight_jump)}: flight of {float(s.flight_share):.0%} of the planned one, "
                f"below {c.flight_share:.0%}"
            ),
        ),
        (
            s.speed_error <= c.lift_off_tolerance,
            (
                f"jump {int(s.speed_jump)}: lift-off speed {float(s.speed_error):.0%} off the plan, "
                f"limit {c.lift_off_tolerance:.0%}"
            ),
        ),
        (
            s.rise_error <= c.rise_tolerance,
            (
                f"jump {int(s.rise_jump)}: apex {float(s.rise_error):.0%} off the planned rise, limit "
                f"{c.rise_tolerance:.0%}"
            ),
        ),
        (
            s.place_error <= c.series_distance_tolerance,
            (
                f"jump {int(s.place_jump)}: landed {1e3 * float(s.place_error):.1f} mm from its place, "
                f"limit {1e3 * c.series_distance_tolerance:.0f} mm"
            ),
        ),
        (
            s.turn_error <= c.yaw_tolerance,
            (
                f"jump {int(s.turn_jump)}: landed {degrees(float(s.turn_error)):.1f} deg off its "
                f"heading, limit {degrees(c.yaw_tolerance):.0f} deg"
            ),
        ),
    )
    return next((text for holds, text in verdicts if not holds), None)
