"""When a jump counts as a success: the tolerances, and the judgement of a recorded jump."""

from __future__ import annotations

from collections.abc import Iterator
from math import atan2, cos, degrees, radians, sin
from typing import Any

from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal

NEVER = -1.0
"""The value of an instant that has not come."""
Verdict = tuple[Any, str]
"""Whether a criterion holds (Python's truth value or NumPy's), and what to say if it does not."""


class JumpRecord(Signal):
    """Everything about one jump that the judgement needs; instants are ``NEVER`` before they
    come."""

    now = Field(unit="s", text="time since the start")
    fall_time = Field(unit="s", text="when the robot fell")
    fall_tilt = Field(unit="rad", text="tilt then")
    fall_height = Field(unit="m", text="height of the base above the ground then")
    unloaded_time = Field(unit="s", text="when all points were last found unloaded anew")
    unloaded_speed = Field(unit="m/s", text="vertical speed of the com then")
    unloaded_momentum = Field(3, unit="N m s", frame="world", text="k about the com then")
    lift_off_time = Field(unit="s", text="when the flight began")
    lift_off_speed = Field(unit="m/s", text="vertical speed of the com then")
    lift_off_momentum = Field(3, unit="N m s", frame="world", text="k about the com then")
    touchdown_time = Field(unit="s", text="when it ended")
    touchdown_speed = Field(unit="m/s", text="downward speed of the com just before")
    vertical_speed = Field(unit="m/s", text="vertical speed of the com in the tick before")
    judged_time = Field(unit="s", text="when the rest was judged")
    standing_height = Field(unit="m", text="height of the com at the start")
    squat_height = Field(unit="m", text="lowest height of the com before lift-off")
    apex_height = Field(unit="m", text="greatest height of the com since lift-off")
    start_foot = Field(("n_feet", 2), unit="m", text="middle of every foot at the start")
    start_direction = Field(("n_feet", 2), unit="m", text="where it points then")
    foot = Field(("n_feet", 2), unit="m", text="middle of every foot now")
    direction = Field(("n_feet", 2), unit="m", text="where it points now")
    landed_foot = Field(("n_feet", 2), unit="m", text="middle of every foot after touchdown")
    foot_slip = Field(unit="m", text="farthest that a foot's middle has moved since then")
    lifted_time = Field("n_feet", unit="s", text="for how long each foot has carried no load")
    longest_lift = Field(unit="s", text="longest time that was, after landing")
    peak_tilt = Field(unit="rad", text="greatest tilt since touchdown")
    tilt = Field(unit="rad", text="tilt now, or when judged")
    com_speed = Field(unit="m/s", text="speed of the com, when judged")
    angular_speed = Field(unit="rad/s", text="of the base, when judged")
    margin = Field(unit="m", text="distance of the com from the edge of support, when judged")
    load_share = Field(unit="", text="the least loaded foot's share of the weight, when judged")
    points_unloaded = Field(
        dtype="int64", text="contact points that should be loaded and are not, when judged"
    )
    ground_low = Field(unit="m", text="lowest ground under a contact point, when judged")
    ground_high = Field(unit="m", text="highest ground under a contact point, when judged")
    forbidden = Field(dtype="int64", text="physics steps with a forbidden contact")
    forbidden_time = Field(unit="s", text="when the first one was")
    violation = Field(unit="rad", text="largest excess over a joint limit")
    overload = Field(unit="N m", text="largest excess of a motor torque over its limit")
    peak_torque = Field(unit="N m", text="largest motor torque")
    peak_speed = Field(unit="rad/s", text="largest motor speed")
    saturated = Field(unit="", text="sum over ticks of the share of saturated motor samples")
    ticks = Field(dtype="int64", text="ticks recorded")
    failures = Field(dtype="int64", text="solver failures")
    planned_flight = Field(unit="s", text="flight time of the reference")
    planned_speed = Field(unit="m/s", text="vertical com speed of the reference at lift-off")
    planned_speed_time = Field(unit="s", text="when it was read")
    planned_standing = Field(unit="m", text="com height of the reference at the start")
    planned_apex = Field(unit="m", text="greatest com height of the reference")
    planned_start = Field(("n_feet", 2), unit="m", text="feet of the reference at the start")
    planned_foot = Field(("n_feet", 2), unit="m", text="feet of the reference now")
    planned_yaw_start = Field(unit="rad", text="mean heading of its feet at the start")
    planned_yaw = Field(unit="rad", text="mean heading of its feet now")


class JumpCriteria(Parameters):
    """The tolerances of a successful jump. Targets that are not given are the reference's."""

    jumps: int = parameter(1, ge=1, text="how many jumps in a row, each with its own flight")
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
    final_tilt: float = parameter(radians(5), unit="rad", text="largest at rest")
    final_com_speed: float = parameter(0.05, unit="m/s", text="largest at rest")
    final_angular_speed: float = parameter(0.2, unit="rad/s", text="largest at rest")
    support_margin: float = parameter(0.01, unit="m", text="least distance inside the support")
    load_share: float | None = parameter(
        None, text="least share of the weight on each foot at rest; by default 0.4 / feet"
    )
    slip_delay: float = parameter(0.15, unit="s", ge=0, text="feet may settle so long")
    foot_slip: float = parameter(
        0.005, unit="m", text="feet may move so far after that; 20 mm for a recovered push"
    )
    step_time: float = parameter(
        0.02, unit="s", text="a foot unloaded for longer after that has stepped"
    )
    peak_tilt: float = parameter(
        radians(15), unit="rad", text="largest after touchdown; 45 deg for pushes"
    )
    joint_limit: float = parameter(0.0, unit="rad", ge=0, text="largest excess over a joint limit")
    fall_tilt: float = parameter(radians(69), unit="rad", text="more is a fall")
    fall_height: float | None = parameter(
        None,
        unit="m",
        text="a base lower above the ground has fallen; by default 0.315 of the standing height",
    )


def feet_moved(record: JumpRecord) -> tuple[float, float]:
    """How far the feet are from where they started [m], forward and left, on average."""
    moved = (record.foot - record.start_foot).mean(axis=0)
    return float(moved[0]), float(moved[1])


def feet_turned(record: JumpRecord) -> float:
    """How far the feet have turned since the start [rad], to the left, on average."""
    turns = [
        atan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])
        for a, b in zip(record.start_direction.tolist(), record.direction.tolist(), strict=True)
    ]
    return sum(turns) / len(turns)


def first_failure(record: JumpRecord, limits: JumpCriteria, planned: bool) -> str | None:
    """The first criterion that does not hold, in words with figures, or ``None``."""
    return next((text for holds, text in _judge(record, limits, planned) if not holds), None)


def _judge(r: JumpRecord, c: JumpCriteria, planned: bool) -> Iterator[Verdict]:
    """Every criterion of any jump, in the order in which a failure explains those behind it."""
    assert c.fall_height is not None and c.load_share is not None
    yield (
        r.fall_time == NEVER,
        (
            f"fell at {r.fall_time:.3f} s: tilt {degrees(r.fall_tilt):.1f} deg (fall from "
            f"{degrees(c.fall_tilt):.0f} deg), base {r.fall_height:.3f} m above the ground (fall "
            f"below {c.fall_height} m)"
        ),
    )
    yield (
        r.forbidden == 0,
        (
            f"something other than the contact points touched, first at {r.forbidden_time:.3f} s, "
            f"in {r.forbidden} physics steps"
        ),
    )
    yield r.lift_off_time != NEVER, f"never left the ground for {c.flight_confirmation} s"
    yield r.touchdown_time != NEVER, f"no touchdown before the run ended at {r.now:.3f} s"
    flight = float(r.touchdown_time - r.lift_off_time)
    if planned:
        yield r.planned_speed_time != NEVER, "the reference has no lift-off"
        yield (
            flight >= c.flight_share * r.planned_flight,
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
    yield r.violation <= c.joint_limit, f"a joint went {r.violation:.4f} rad over its limit"
    yield r.overload <= 1e-9, f"a motor gave {r.overload:.3g} N m more than its speed allows"
    yield (
        r.judged_time != NEVER,
        (f"the run ended {r.now - r.touchdown_time:.3f} s after touchdown, before {c.rest_time} s"),
    )
    yield (
        r.peak_tilt < c.peak_tilt,
        (
            f"tilted by {degrees(r.peak_tilt):.1f} deg after touchdown, limit "
            f"{degrees(c.peak_tilt):.0f} deg"
        ),
    )
    yield (
        r.tilt < c.final_tilt,
        (f"tilt at rest {degrees(r.tilt):.2f} deg, limit {degrees(c.final_tilt):.1f} deg"),
    )
    yield (
        r.com_speed < c.final_com_speed,
        (f"centre of mass at rest moves at {r.com_speed:.3f} m/s, limit {c.final_com_speed} m/s"),
    )
    yield (
        r.angular_speed < c.final_angular_speed,
        (
            f"torso at rest turns at {r.angular_speed:.3f} rad/s, limit {c.final_angular_speed} rad/s"
        ),
    )
    yield (
        r.points_unloaded == 0,
        (f"{r.points_unloaded} contact points carry no load at rest: a sole is not flat"),
    )
    yield (
        r.load_share > c.load_share,
        (f"a foot carries {r.load_share:.0%} of the weight at rest, limit {c.load_share:.0%}"),
    )
    yield (
        r.margin >= c.support_margin,
        (
            f"centre of mass {1e3 * r.margin:.1f} mm inside the support at rest, limit "
            f"{1e3 * c.support_margin:.0f} mm"
        ),
    )
    yield (
        r.longest_lift <= c.step_time,
        (f"stepped: a foot was off the ground for {r.longest_lift:.3f} s after landing"),
    )
    yield (
        r.foot_slip < c.foot_slip,
        (f"feet slid {1e3 * r.foot_slip:.1f} mm after landing, limit {1e3 * c.foot_slip:.0f} mm"),
    )
    yield from _judge_task(r, c, planned)


def _judge_task(r: JumpRecord, c: JumpCriteria, planned: bool) -> Iterator[Verdict]:
    """The criteria of the task: where it should have jumped, how high, how far round."""
    rise = float(r.apex_height - r.standing_height)
    target = c.rise
    if target is None and planned:
        target = float(r.planned_apex - r.planned_standing)
    if target is not None:
        yield (
            abs(rise - target) <= c.rise_tolerance * target,
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
        error = feet_turned(r) - turn
        error = atan2(sin(error), cos(error))
        yield (
            abs(error) <= c.yaw_tolerance,
            (
                f"turned {degrees(feet_turned(r)):.1f} deg, not within "
                f"{degrees(c.yaw_tolerance):.1f} deg of {degrees(turn):.1f} deg"
            ),
        )
    low, high = float(r.ground_low), float(r.ground_high)
    yield (
        max(abs(low - c.landing_height), abs(high - c.landing_height)) < 1e-6,
        (
            f"contact points ended above ground at {low:.3f} to {high:.3f} m, not all at "
            f"{c.landing_height:.3f} m"
        ),
    )
