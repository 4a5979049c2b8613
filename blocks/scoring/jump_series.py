"""Several jumps in a row: the record of those that are over, and their judgement.

The last jump of a row is judged like any jump; those before it by their flight, their lift-off speed,
their apex and where they land.
"""

from __future__ import annotations

from math import degrees, pi, sqrt
from typing import NamedTuple

from ...mathematics.arrays import Array, Array0D, Array1D, Array2D, Counts, Indices0D
from ...mathematics.kernel import kernel
from ...runtime.language.signals import Field, Signal
from .jump_criteria import JumpCriteria, mean_turn
from .stand_criteria import NEVER


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


class Jump(NamedTuple):
    """The fields of ``JumpRecord`` that are followed in a jump, and where the feet point now."""

    direction: Array2D
    unloaded_time: Array0D
    unloaded_speed: Array0D
    unloaded_momentum: Array1D
    lift_off_time: Array0D
    lift_off_speed: Array0D
    lift_off_momentum: Array1D
    touchdown_time: Array0D
    touchdown_speed: Array0D
    vertical_speed: Array0D
    squat_height: Array0D
    apex_height: Array0D
    start_foot: Array2D
    start_direction: Array2D
    ground_low: Array0D
    ground_high: Array0D


class Planned(NamedTuple):
    """The fields of ``JumpRecord`` whose names begin with ``planned_``."""

    flight: Array0D
    speed: Array0D
    speed_time: Array0D
    standing: Array0D
    apex: Array0D
    start: Array2D
    foot: Array2D
    yaw_start: Array0D
    yaw: Array0D


class Series(NamedTuple):
    """The fields of ``JumpSeries``."""

    made: Indices0D
    landed_time: Array0D
    planned_lift_off: Array0D
    flight_share: Array0D
    flight_jump: Indices0D
    speed_error: Array0D
    speed_jump: Indices0D
    rise_error: Array0D
    rise_jump: Indices0D
    place_error: Array0D
    place_now: Array0D
    place_jump: Indices0D
    turn_error: Array0D
    turn_now: Array0D
    turn_jump: Indices0D


@kernel
def keep_worst(worst: Array, of_jump: Counts, error: float, jump: int) -> None:
    """``error`` becomes the ``worst`` one if it is larger, and ``jump`` the number of its jump."""
    if error > worst[()]:
        worst[()] = error
        of_jump[()] = jump


@kernel
def note_landing(
    standing: float, jump: Jump, planned: Planned, series: Series, compared: bool
) -> None:
    """Record a jump that has touched down, and prepare for the next lift-off.

    Args:
        standing: the height of the com at the start [m].
        compared: whether there is a reference to compare the jump with.
    """
    made = series.made[()] + 1
    series.made[()] = made
    series.landed_time[()] = jump.touchdown_time[()]
    if made == 1:
        series.flight_share[()] = 1e9
    if compared:
        flight = jump.touchdown_time[()] - jump.lift_off_time[()]
        share = flight / max(planned.flight[()], 1e-9)
        if share < series.flight_share[()]:
            series.flight_share[()] = share
            series.flight_jump[()] = made
        speed = planned.speed[()]
        error = abs(jump.lift_off_speed[()] - speed) / max(abs(speed), 1e-9)
        keep_worst(series.speed_error, series.speed_jump, error, made)
        rise = planned.apex[()] - planned.standing[()]
        error = abs(jump.apex_height[()] - standing - rise) / max(rise, 1e-9)
        keep_worst(series.rise_error, series.rise_jump, error, made)
    jump.lift_off_time[()] = jump.touchdown_time[()] = jump.unloaded_time[()] = NEVER


@kernel
def note_place(foot: Array, jump: Jump, planned: Planned, series: Series) -> None:
    """Between two jumps: note how far the feet, (n_feet, 2), are from their planned position."""
    x, y, feet = 0.0, 0.0, foot.shape[0]
    for k in range(feet):
        moved = float(foot[k, 0]) - jump.start_foot[k, 0]
        x += (moved - (planned.foot[k, 0] - planned.start[k, 0])) / feet
        moved = float(foot[k, 1]) - jump.start_foot[k, 1]
        y += (moved - (planned.foot[k, 1] - planned.start[k, 1])) / feet
    series.place_now[()] = sqrt(x * x + y * y)
    turn = planned.yaw[()] - planned.yaw_start[()]
    error = abs(mean_turn(jump.start_direction, jump.direction) - turn)
    # Half a turn to the left is the same as half a turn to the right.
    series.turn_now[()] = abs(error - 2.0 * pi) if error > pi else error


@kernel
def keep_place(series: Series) -> None:
    """When the next jump lifts off: keep the last landing's error if it is the largest."""
    made = series.made[()]
    keep_worst(series.place_error, series.place_jump, series.place_now[()], made)
    keep_worst(series.turn_error, series.turn_jump, series.turn_now[()], made)


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
