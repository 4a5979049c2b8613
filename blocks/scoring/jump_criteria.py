"""The record, tolerances and judgement of the success of a jump, or a row of jumps.

The last jump of a row is judged like any jump; those before it by their flight, their lift-off speed,
their apex and where they land.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, pi, radians

from ...mathematics.arrays import Array2D
from ...mathematics.elementary import atan2
from ...mathematics.kernel import kernel
from ...mathematics.rotations import wrap
from ...runtime.language.parameters import parameter
from ...runtime.language.signals import Field, Signal
from .standing import (
    NEVER,
    StandCriteria,
    StandRecord,
    Verdict,
    judge_feet,
    judge_machine,
    judge_rest,
    judge_safety,
)


class JumpRecord(StandRecord):
    """Everything about one jump that the judgement needs; instants are ``NEVER`` before they
    come."""

    unloaded_time = Field(unit="s", text="time at which all points were last found unloaded anew")
    unloaded_speed = Field(unit="m/s", text="vertical speed of the com at that time")
    unloaded_momentum = Field(3, unit="N m s", frame="world", text="k about the com at that time")
    lift_off_time = Field(unit="s", text="start of the flight")
    lift_off_speed = Field(unit="m/s", text="vertical speed of the com at that time")
    lift_off_momentum = Field(3, unit="N m s", frame="world", text="k about the com at that time")
    touchdown_time = Field(unit="s", text="end of the flight")
    touchdown_speed = Field(unit="m/s", text="downward speed of the com just before")
    vertical_speed = Field(unit="m/s", text="vertical speed of the com in the tick before")
    squat_height = Field(unit="m", text="lowest height of the com before lift-off")
    apex_height = Field(unit="m", text="greatest height of the com since lift-off")
    start_foot = Field(("n_feet", 2), unit="m", text="middle of every foot at the start")
    start_direction = Field(("n_feet", 2), unit="m", text="direction of each foot then")
    ground_low = Field(unit="m", text="lowest ground under a contact point, when judged")
    ground_high = Field(unit="m", text="highest ground under a contact point, when judged")
    planned_flight = Field(unit="s", text="flight time of the reference")
    planned_speed = Field(unit="m/s", text="vertical com speed of the reference at lift-off")
    planned_speed_time = Field(unit="s", text="time at which that speed was read")
    planned_standing = Field(unit="m", text="com height of the reference at the start")
    planned_apex = Field(unit="m", text="greatest com height of the reference")
    planned_start = Field(("n_feet", 2), unit="m", text="feet of the reference at the start")
    planned_foot = Field(("n_feet", 2), unit="m", text="feet of the reference now")
    planned_yaw_start = Field(unit="rad", text="mean heading of the reference's feet at the start")
    planned_yaw = Field(unit="rad", text="mean heading of the reference's feet now")


class JumpSeries(Signal):
    """The jumps of a row that are over. Every figure is that of the worst of these jumps."""

    made = Field(dtype="int64", text="number of jumps that have touched down")
    landed_time = Field(unit="s", text="time at which the last of them touched down")
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


class JumpCriteria(StandCriteria):
    """The tolerances of a successful jump. Targets that are not given are the reference's."""

    jumps: int = parameter(1, ge=1, text="number of jumps in a row, each with its own flight")
    series_distance_tolerance: float = parameter(
        0.03, unit="m", gt=0, text="of the feet after every jump of a row but the last"
    )
    distance: list[float] | None = parameter(
        None, unit="m", min_length=2, max_length=2, text="target of the feet, forward and left"
    )
    yaw: float | None = parameter(None, unit="rad", text="target turn of the feet, to the left")
    rise: float | None = parameter(None, unit="m", gt=0, text="target of the apex above standing")
    landing_height: float = parameter(
        0.0, unit="m", text="height of the ground that every contact point must end on"
    )
    ground_tolerance: float = parameter(
        0.0, unit="m", ge=0,
        text="largest distance of the ground under a contact point from that height; or {from: robot.ground_tolerance}, as uneven as the simulator's scene is",
    )  # fmt: skip
    flight_confirmation: float = parameter(
        0.02, unit="s", gt=0, text="all points unloaded for this long is a flight"
    )
    flight_share: float = parameter(0.9, text="least share of the planned flight time")
    lift_off_tolerance: float = parameter(0.1, text="of the planned lift-off speed")
    rise_tolerance: float = parameter(0.1, text="of the target rise")
    distance_tolerance: float = parameter(0.02, unit="m", text="of the feet, forward and left")
    yaw_tolerance: float = parameter(radians(5), unit="rad", text="of the feet")
    rest_time: float = parameter(1.5, unit="s", gt=0, text="from touchdown to judging the rest")
    settle_time: float = parameter(0.1, unit="s", ge=0, text="from there to the end of the run")
    slip_delay: float = parameter(0.15, unit="s", ge=0, text="feet may settle so long")


def feet_moved(record: JumpRecord) -> tuple[float, float]:
    """Return the way of the feet from where they started [m], forward and left, on average."""
    moved = (record.foot - record.start_foot).mean(axis=0)
    return float(moved[0]), float(moved[1])


def feet_turned(record: JumpRecord) -> float:
    """Return the turn of the feet since the start [rad], to the left, on average."""
    return mean_turn(record.start_direction, record.direction)


@kernel
def mean_turn(start: Array2D, now: Array2D) -> float:
    """Return the mean angle [rad] from each row of ``start`` (n, 2) to that of ``now``, to the left.

    Half a turn is the same to the left and to the right, so all angles count as within half a turn
    of the first.
    """
    total, first = 0.0, 0.0
    for foot in range(start.shape[0]):
        ax, ay = start[foot, 0], start[foot, 1]
        bx, by = now[foot, 0], now[foot, 1]
        angle = atan2(ax * by - ay * bx, ax * bx + ay * by)
        if foot == 0:
            first = angle
        elif angle - first > pi:
            angle -= 2.0 * pi
        elif angle - first < -pi:
            angle += 2.0 * pi
        total += angle
    count: int = start.shape[0]
    return total / count


def first_failure(record: JumpRecord, limits: JumpCriteria, planned: bool) -> str | None:
    """Return the first criterion that does not hold, in words with figures, or ``None``."""
    return next((text for holds, text in _judge(record, limits, planned) if not holds), None)


def _judge(r: JumpRecord, c: JumpCriteria, planned: bool) -> Iterator[Verdict]:
    """Every criterion of any jump, in the order in which a failure explains those behind it."""
    yield from judge_safety(r, c)
    yield r.lift_off_time != NEVER, f"never left the ground for {c.flight_confirmation} s"
    yield r.touchdown_time != NEVER, f"no touchdown before the run ended at {r.now:.3f} s"
    flight = float(r.touchdown_time - r.lift_off_time)
    if planned:
        yield r.planned_speed_time != NEVER, "the reference has no lift-off"
        # on ground that is higher than the task says it ends sooner, at about the speed of lift-off
        shorter = c.ground_tolerance / max(abs(float(r.planned_speed)), 1e-9)
        yield (
            flight >= c.flight_share * r.planned_flight - shorter,
            (
                f"flight of {flight:.3f} s is below {c.flight_share:.0%} of the planned "
                f"{r.planned_flight:.3f} s"
            ),
        )
        error = abs(float(r.lift_off_speed - r.planned_speed))
        yield (
            error <= c.lift_off_tolerance * abs(float(r.planned_speed)),
            (
                f"lift-off at {r.lift_off_speed:.3f} m/s is not within {c.lift_off_tolerance:.0%} "
                f"of the planned {r.planned_speed:.3f} m/s"
            ),
        )
    yield from judge_machine(r, c)
    yield (
        r.judged_time != NEVER,
        (f"the run ended {r.now - r.touchdown_time:.3f} s after touchdown, before {c.rest_time} s"),
    )
    yield from judge_rest(r, c, "after touchdown", level=not c.ground_tolerance)
    yield from judge_feet(r, c, "after landing")
    yield from _judge_task(r, c, planned)


def _judge_task(r: JumpRecord, c: JumpCriteria, planned: bool) -> Iterator[Verdict]:
    """Yield the criteria of the task: where it should have jumped, how high, how far round."""
    rise = float(r.apex_height - r.standing_height)
    target = c.rise
    if target is None and planned:
        target = float(r.planned_apex - r.planned_standing)
    if target is not None:
        off = c.ground_tolerance if c.jumps > 1 else 0.0  # of the ground where a jump lifts off
        yield (
            abs(rise - target) <= c.rise_tolerance * target + off,
            (
                f"rose {1e3 * rise:.1f} mm above standing, not within {c.rise_tolerance:.0%} of "
                f"{1e3 * target:.1f} mm"
            ),
        )
    goal = c.distance
    if goal is None and planned:
        goal = (r.planned_foot - r.planned_start).mean(axis=0).tolist()
    if goal is not None:
        x, y = feet_moved(r)
        near = max(abs(x - goal[0]), abs(y - goal[1])) <= c.distance_tolerance
        yield (
            near,
            (
                f"jumped ({1e3 * x:.1f}, {1e3 * y:.1f}) mm, not within "
                f"{1e3 * c.distance_tolerance:.0f} mm of ({1e3 * goal[0]:.1f}, {1e3 * goal[1]:.1f}) mm"
            ),
        )
    turn = c.yaw
    if turn is None and planned:
        turn = float(r.planned_yaw - r.planned_yaw_start)
    if turn is not None:
        error = wrap(feet_turned(r) - turn)
        yield (
            abs(error) <= c.yaw_tolerance,
            (
                f"turned {degrees(feet_turned(r)):.1f} deg, not within "
                f"{degrees(c.yaw_tolerance):.1f} deg of {degrees(turn):.1f} deg"
            ),
        )
    low, high = float(r.ground_low), float(r.ground_high)
    within = f" within {1e3 * c.ground_tolerance:.0f} mm" if c.ground_tolerance else ""
    yield (
        max(abs(low - c.landing_height), abs(high - c.landing_height)) < c.ground_tolerance + 1e-6,
        (
            f"contact points ended above ground at {low:.3f} to {high:.3f} m, not all at "
            f"{c.landing_height:.3f} m{within}"
        ),
    )


def series_failure(series: JumpSeries, limits: JumpCriteria, made: int) -> str | None:
    """Return the first criterion of a row of jumps that does not hold, in words, or ``None``.

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
