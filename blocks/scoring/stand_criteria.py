"""The criteria of standing: the tolerances that all scores share, and their judgement."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, radians
from typing import Any

from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .footing import Footing

NEVER = -1.0
"""The value of a time that has not come yet."""
Verdict = tuple[Any, str]
"""Whether a criterion holds (as Python's or NumPy's bool), and the reason if it does not."""


class StandRecord(Signal):
    """What a judgement needs of a robot on its feet; instants are ``NEVER`` before they come."""

    now = Field(unit="s", text="time since the start")
    ticks = Field(dtype="int64", text="ticks recorded")
    fall_time = Field(unit="s", text="when the robot fell")
    fall_tilt = Field(unit="rad", text="tilt then")
    fall_height = Field(unit="m", text="height of the base above the ground then")
    standing_height = Field(unit="m", text="height of the com at the start")
    foot = Field(("n_feet", 2), unit="m", text="middle of every foot now")
    direction = Field(("n_feet", 2), unit="m", text="where it points now")
    landed_foot = Field(("n_feet", 2), unit="m", text="middle of every foot when it should stay")
    foot_slip = Field(unit="m", text="farthest that a foot's middle has moved since then")
    lifted_time = Field("n_feet", unit="s", text="for how long each foot has carried no load")
    steps = Field(dtype="int64", text="steps that feet have taken while they should stand")
    step_end = Field("n_feet", unit="s", text="when each foot last carried no load in a step")
    longest_lift = Field(unit="s", text="longest time that was, while it should stand")
    peak_tilt = Field(unit="rad", text="greatest tilt while it should stand")
    judged_time = Field(unit="s", text="when the rest was judged")
    tilt = Field(unit="rad", text="tilt, when judged")
    com_speed = Field(unit="m/s", text="speed of the com, when judged")
    angular_speed = Field(unit="rad/s", text="of the base, when judged")
    margin = Field(unit="m", text="distance of the com from the edge of support, when judged")
    load_share = Field(unit="", text="the least loaded foot's share of the weight, when judged")
    points_unloaded = Field(
        dtype="int64", text="contact points that should be loaded and are not, when judged"
    )
    forbidden = Field(dtype="int64", text="physics steps with a forbidden contact")
    forbidden_time = Field(unit="s", text="when the first one was")
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
        """The tolerances, in which those that are not given follow from the robot."""
        given: dict[str, float] = {}
        if self.fall_height is None:
            given["fall_height"] = footing.fall_height
        if self.load_share is None:
            given["load_share"] = footing.load_share
        return self.model_copy(update=given)


def judge_safety(r: StandRecord, c: StandCriteria) -> Iterator[Verdict]:
    """It does not fall, and nothing but its contact points touches."""
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


def judge_rest(r: StandRecord, c: StandCriteria, since: str) -> Iterator[Verdict]:
    """It stayed upright, and in the end it is still and stands on all its feet.

    ``since`` says from when on it should stand, such as "after touchdown".
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
