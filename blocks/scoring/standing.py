"""A robot's standing on its feet: the record that all scores share, their tolerances, judgement and metrics."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, radians, sqrt
from typing import Any

from ...mathematics.arrays import Array1D
from ...mathematics.capture_step import support_margin
from ...mathematics.kernel import kernel
from ...mathematics.rotations import tilt
from ...runtime.language.block import Metric
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import RobotTruth, WholeBodyCommand
from .footing import (
    BallFeet,
    Footing,
    add_roll,
    least_load,
    magnitude,
    measure_feet,
    points_missing,
)

NEVER = -1.0
"""The value of a time that has not come yet."""
SETTLING = 0.15
"""A foot that has taken a step may settle for so long [s]."""
Verdict = tuple[Any, str]
"""The outcome of a criterion (Python's or NumPy's bool), and the reason if it does not hold."""


class StandRecord(Signal):
    """Record for the judgement of a robot on its feet; instants are ``NEVER`` before they come."""

    now = Field(unit="s", text="time since the start")
    ticks = Field(dtype="int64", text="ticks recorded")
    fall_time = Field(unit="s", text="time of the fall")
    fall_tilt = Field(unit="rad", text="tilt then")
    fall_height = Field(unit="m", text="height of the base above the ground then")
    standing_height = Field(unit="m", text="height of the com at the start")
    foot = Field(("n_feet", 2), unit="m", text="middle of every foot now")
    direction = Field(("n_feet", 2), unit="m", text="direction of each foot now")
    turned = Field(("n_feet", 3, 3), text="axes of every ball foot in the world, one a row")
    rolled = Field(("n_feet", 2), unit="m", text="way that every ball foot has rolled")
    landed_foot = Field(
        ("n_feet", 2),
        unit="m",
        text="place of every foot when it should stay, less what it rolled",
    )
    foot_slip = Field(unit="m", text="farthest that a foot's middle has moved since then")
    lifted_time = Field("n_feet", unit="s", text="time for which each foot has carried no load")
    steps = Field(dtype="int64", text="steps that feet have taken while they should stand")
    step_end = Field(
        "n_feet", unit="s", text="time at which each foot last carried no load in a step"
    )
    longest_lift = Field(unit="s", text="longest time that was, while it should stand")
    peak_tilt = Field(unit="rad", text="greatest tilt while it should stand")
    judged_time = Field(unit="s", text="time at which the rest was judged")
    tilt = Field(unit="rad", text="tilt, when judged")
    com_speed = Field(unit="m/s", text="speed of the com, when judged")
    angular_speed = Field(unit="rad/s", text="of the base, when judged")
    margin = Field(unit="m", text="distance of the com from the edge of support, when judged")
    load_share = Field(unit="", text="the least loaded foot's share of the weight, when judged")
    points_unloaded = Field(
        dtype="int64", text="contact points that should be loaded and are not, when judged"
    )
    forbidden = Field(dtype="int64", text="physics steps with a forbidden contact")
    forbidden_time = Field(unit="s", text="time of the first one")
    violation = Field(unit="rad", text="largest excess over a joint limit")
    overload = Field(unit="N m", text="largest excess of a motor torque over its limit")
    peak_torque = Field(unit="N m", text="largest motor torque")
    peak_speed = Field(unit="rad/s", text="largest motor speed")
    saturated = Field(unit="", text="sum over ticks of the share of saturated motor samples")
    failures = Field(dtype="int64", text="solver failures")


class StandCriteria(Parameters):
    """The tolerances of a robot that should stand."""

    final_tilt: float = parameter(radians(5), unit="rad", text="largest at rest")
    final_com_speed: float = parameter(0.05, unit="m/s", text="largest at rest")
    final_angular_speed: float = parameter(0.2, unit="rad/s", text="largest at rest")
    support_margin: float = parameter(0.01, unit="m", text="least distance inside the support")
    load_share: float | None = parameter(
        None, text="least share of the weight on each foot at rest; by default 0.4 / feet"
    )
    foot_slip: float = parameter(
        0.005, unit="m", text="standing feet may move so far; 20 mm for a recovered push"
    )
    step_time: float = parameter(
        0.02, unit="s", text="a standing foot unloaded for longer has stepped"
    )
    steps: int = parameter(
        0,
        ge=0,
        text="so many steps are allowed after touchdown; a foot that has taken one is measured "
        "from its new place, and the robot comes to rest from then on",
    )
    peak_tilt: float = parameter(
        radians(15), unit="rad", text="largest while it stands; 45 deg for pushes"
    )
    joint_limit: float = parameter(0.0, unit="rad", ge=0, text="largest excess over a joint limit")
    fall_tilt: float = parameter(radians(69), unit="rad", text="more is a fall")
    fall_height: float | None = parameter(
        None,
        unit="m",
        text="a base lower above the ground has fallen; by default 0.315 of the standing height",
    )

    def for_robot(self, footing: Footing) -> StandCriteria:
        """Return the tolerances, in which those that are not given follow from the robot."""
        given: dict[str, float] = {}
        if self.fall_height is None:
            given["fall_height"] = footing.fall_height
        if self.load_share is None:
            given["load_share"] = footing.load_share
        return self.model_copy(update=given)


class StandConstants(Signal):
    """Constants of a standing robot's record."""

    foot_of_point = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    weight = Field(unit="N", text="of the robot")
    fall_height = Field(unit="m", text="a base lower above the ground has fallen")
    settling = Field(unit="s", text="a foot that has taken a step may settle for so long")
    period = Field(unit="s", text="of a tick of the score")
    clearance = Field(
        unit="m", text="a foot with a point below this height above the ground is not off it"
    )

    def fill(
        self, footing: Footing, criteria: StandCriteria, settling: float, period: float
    ) -> None:
        """Write all fields; ``criteria`` as ``for_robot`` gives them."""
        self.foot_of_point[:] = footing.foot_of_point
        self.weight, self.fall_height = footing.weight, criteria.fall_height
        self.settling, self.period = settling, period
        self.clearance = -1.0  # on level ground only load counts


@kernel
def record_robot(
    now: float,
    truth: RobotTruth,
    wbc: WholeBodyCommand,
    record: StandRecord,
    balls: BallFeet,
    constants: StandConstants,
) -> None:
    """Record one tick of a robot: where its feet are, and what exceeds a limit."""
    orientation = truth.base_orientation
    measure_feet(
        constants.foot_of_point, truth.contact_position, orientation, record.foot, record.direction
    )
    add_roll(balls, truth.joint_position, orientation, record.turned, record.rolled)
    record.now = now
    if record.ticks == 0:
        record.fall_time = NEVER
        record.judged_time = NEVER
        record.forbidden_time = NEVER
        record.standing_height = truth.com[2]
    record.ticks += 1
    if truth.forbidden_contacts != 0 and record.forbidden == 0:
        record.forbidden_time = now
    record.forbidden += truth.forbidden_contacts
    record.saturated += truth.saturated_share
    record.violation = max(record.violation, truth.joint_limit_violation)
    record.overload = max(record.overload, truth.motor_overload)
    record.peak_torque = max(record.peak_torque, largest_magnitude(truth.motor_torque))
    record.peak_speed = max(record.peak_speed, largest_magnitude(truth.motor_speed))
    record.failures = wbc.failures


@kernel
def record_fall(
    truth: RobotTruth, record: StandRecord, params: StandCriteria, constants: StandConstants
) -> bool:
    """Record a fall; returns whether the robot falls in this tick, which happens at most once."""
    tilted = tilt(truth.base_orientation)
    height = truth.base_position[2] - largest_of(truth.ground_height)
    fallen = tilted > params.fall_tilt or height < constants.fall_height
    if not fallen or record.fall_time != NEVER:
        return False
    record.fall_time = record.now
    record.fall_tilt = tilted
    record.fall_height = height
    return True


@kernel
def record_feet(
    truth: RobotTruth,
    record: StandRecord,
    params: StandCriteria,
    constants: StandConstants,
    stay: bool,
) -> None:
    """Record how far feet slide and how long they are off the ground, from when they should ``stay``.

    A foot that is off the ground for longer than a step takes has stepped, if it may. Then it may
    move until it has been on the ground for ``constants.settling``.
    """
    if not stay:
        record.landed_foot[:] = record.foot - record.rolled
        return
    for foot in range(record.foot.shape[0]):
        record_foot(truth, record, params, constants, foot)


@kernel
def record_foot(
    truth: RobotTruth,
    record: StandRecord,
    params: StandCriteria,
    constants: StandConstants,
    foot: int,
) -> None:
    """Record how far a foot that should stay slides, and how long it is off the ground.

    On uneven ground a foot none of whose points is loaded may stand on an edge between them: it is off the
    ground if all its points are higher above it than ``constants.clearance``.
    """
    now, loaded = record.now, False
    for point in range(truth.contact_touched.shape[0]):
        if constants.foot_of_point[point] != foot:
            continue
        above = truth.contact_position[point, 2] - truth.ground_height[point]
        if truth.contact_touched[point] or above < constants.clearance:
            loaded = True
    lifted = 0.0 if loaded else record.lifted_time[foot] + constants.period
    record.lifted_time[foot] = lifted
    end = record.step_end[foot]
    if lifted > params.step_time:
        going_on = end > 0.0 and now - end < 1.5 * constants.period
        if going_on or record.steps < params.steps:
            record.steps += 0 if going_on else 1
            end = now
            record.step_end[foot] = end
    if end > 0.0 and now - end < constants.settling:
        record.landed_foot[foot, :] = record.foot[foot] - record.rolled[foot]
        return
    x = record.foot[foot, 0] - record.rolled[foot, 0] - record.landed_foot[foot, 0]
    y = record.foot[foot, 1] - record.rolled[foot, 1] - record.landed_foot[foot, 1]
    if loaded or params.steps == 0:
        record.foot_slip = max(record.foot_slip, sqrt(x * x + y * y))
    if lifted <= params.step_time or record.steps >= params.steps:
        record.longest_lift = max(record.longest_lift, lifted)


@kernel
def record_rest(truth: RobotTruth, record: StandRecord, constants: StandConstants) -> None:
    """Record how the robot stands now, for the judgement of its rest."""
    feet, touched = record.foot.shape[0], truth.contact_touched
    record.judged_time = record.now
    record.tilt = tilt(truth.base_orientation)
    record.com_speed = magnitude(truth.com_velocity)
    record.angular_speed = magnitude(truth.base_angular_velocity)
    record.points_unloaded = points_missing(constants.foot_of_point, touched, feet)
    record.margin = support_margin(truth.contact_position, touched, truth.com[0], truth.com[1])
    record.load_share = least_load(
        constants.foot_of_point, truth.contact_force, feet, constants.weight
    )


@kernel
def largest_of(values: Array1D) -> float:
    """Return the largest of at least one value, (n,)."""
    largest = values[0]
    for k in range(1, values.shape[0]):
        largest = max(largest, values[k])
    return float(largest)


@kernel
def largest_magnitude(values: Array1D) -> float:
    """Return the largest magnitude of at least one value, (n,)."""
    largest = abs(values[0])
    for k in range(1, values.shape[0]):
        largest = max(largest, abs(values[k]))
    return float(largest)


def judge_safety(r: StandRecord, c: StandCriteria) -> Iterator[Verdict]:
    """Judge that it does not fall, and nothing but its contact points touches."""
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


def judge_machine(r: StandRecord, c: StandCriteria) -> Iterator[Verdict]:
    """Joints stay within their limits, and motors within what their speed allows."""
    yield r.violation <= c.joint_limit, f"a joint went {r.violation:.4f} rad over its limit"
    yield r.overload <= 1e-9, f"a motor gave {r.overload:.3g} N m more than its speed allows"


def judge_rest(
    r: StandRecord, c: StandCriteria, since: str, *, level: bool = True
) -> Iterator[Verdict]:
    """Judge that it stayed upright, and in the end is still and stands on all its feet.

    ``since`` names the time from which it should stand, such as "after touchdown". On ground that is not ``level``
    a sole may carry load between its contact points, where nothing measures it; there only what the
    robot does counts.
    """
    assert c.load_share is not None
    yield (
        r.peak_tilt < c.peak_tilt,
        (f"tilted by {degrees(r.peak_tilt):.1f} deg {since}, limit {degrees(c.peak_tilt):.0f} deg"),
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
        (f"base at rest turns at {r.angular_speed:.3f} rad/s, limit {c.final_angular_speed} rad/s"),
    )
    if not level:
        return
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


def judge_feet(r: StandRecord, c: StandCriteria, since: str) -> Iterator[Verdict]:
    """No foot steps or slides while it should stand."""
    yield (
        r.longest_lift <= c.step_time,
        (f"stepped: a foot was off the ground for {r.longest_lift:.3f} s {since}"),
    )
    yield (
        r.foot_slip < c.foot_slip,
        (f"feet slid {1e3 * r.foot_slip:.1f} mm {since}, limit {1e3 * c.foot_slip:.0f} mm"),
    )


def judgement_metrics(record: StandRecord, failure: str | None) -> dict[str, Metric]:
    """Success, its reason, and what the controller and the motors did in the whole run.

    Args:
        record: of a run of at least one tick.
        failure: the first criterion that does not hold, in words, or ``None``.
    """
    return {
        "success": failure is None,
        "reason": failure or "all criteria hold",
        "qp_failures": int(record.failures),
        "saturated_share": float(record.saturated / record.ticks),
        "peak_motor_torque_nm": float(record.peak_torque),
        "peak_motor_speed_rad_s": float(record.peak_speed),
        "forbidden_contacts": int(record.forbidden),
        "joint_limit_violation_rad": float(record.violation),
        "motor_overload_nm": float(record.overload),
    }


def rest_metrics(record: StandRecord) -> dict[str, Metric]:
    """Return the figures of the robot's stance when its rest was judged."""
    return {
        "final_tilt_deg": degrees(record.tilt),
        "final_com_speed_m_s": float(record.com_speed),
        "final_angular_speed_rad_s": float(record.angular_speed),
        "final_support_margin_m": float(record.margin),
        "final_load_share": float(record.load_share),
    }
