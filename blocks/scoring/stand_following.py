"""Records how a robot stands on its feet, tick by tick, from the simulation truth."""

from __future__ import annotations

from math import hypot, sqrt

from ...mathematics.rotations import tilt
from ...mathematics.support_margin import support_margin
from ..signals import RobotTruth
from .footing import Footing
from .stand_criteria import NEVER, StandCriteria, StandRecord


def begin(record: StandRecord, truth: RobotTruth) -> None:
    """Start a record in its first tick."""
    for instant in (record.fall_time, record.judged_time, record.forbidden_time):
        instant[()] = NEVER
    record.standing_height[()] = truth.com[2]


def note_machine(record: StandRecord, truth: RobotTruth) -> None:
    """Note forbidden contacts and excesses over the limits of joints and motors."""
    if truth.forbidden_contacts and not record.forbidden:
        record.forbidden_time[()] = record.now
    record.forbidden += truth.forbidden_contacts
    record.saturated += truth.saturated_share
    for largest, value in (
        (record.violation, truth.joint_limit_violation.item()),
        (record.overload, truth.motor_overload.item()),
        (record.peak_torque, max(abs(t) for t in truth.motor_torque.tolist())),
        (record.peak_speed, max(abs(v) for v in truth.motor_speed.tolist())),
    ):
        largest[()] = max(largest.item(), value)


def note_fall(record: StandRecord, truth: RobotTruth, limits: StandCriteria) -> bool:
    """Note a fall; returns whether the robot falls in this tick, which happens at most once."""
    assert limits.fall_height is not None
    tilted = tilt(truth.base_orientation)
    height = truth.base_position.item(2) - max(truth.ground_height.tolist())
    fallen = tilted > limits.fall_tilt or height < limits.fall_height
    if not fallen or record.fall_time != NEVER:
        return False
    record.fall_time[()] = record.now
    record.fall_tilt[()] = tilted
    record.fall_height[()] = height
    return True


def note_feet(
    record: StandRecord,
    truth: RobotTruth,
    footing: Footing,
    period: float,
    stay: bool,
    limits: StandCriteria,
    settling: float,
) -> None:
    """How far the feet slide and for how long one is off the ground, once they should ``stay``.

    A foot that is off the ground for longer than a step takes has stepped, if it may. Then it may
    move until it has been on the ground for ``settling`` [s].
    """
    if not stay:
        record.landed_foot[:] = record.foot
        return
    touched = truth.contact_touched.tolist()
    now = record.now.item()
    for number, points in enumerate(footing.points_of_foot):
        loaded = any(touched[k] for k in points)
        total = 0.0 if loaded else record.lifted_time.item(number) + period
        record.lifted_time[number] = total
        end = record.step_end.item(number)
        if total > limits.step_time:
            going_on = end > 0.0 and now - end < 1.5 * period
            if going_on or record.steps < limits.steps:
                record.steps += 0 if going_on else 1
                record.step_end[number] = end = now
        if end > 0.0 and now - end < settling:
            record.landed_foot[number] = record.foot[number]
            continue
        moved = hypot(
            record.foot.item(number, 0) - record.landed_foot.item(number, 0),
            record.foot.item(number, 1) - record.landed_foot.item(number, 1),
        )
        if loaded or limits.steps == 0:
            record.foot_slip[()] = max(record.foot_slip.item(), moved)
        if total <= limits.step_time or record.steps >= limits.steps:
            record.longest_lift[()] = max(record.longest_lift.item(), total)


def note_rest(record: StandRecord, truth: RobotTruth, footing: Footing) -> None:
    """Note how the robot stands now, for the judgement of its rest."""
    record.judged_time[()] = record.now
    record.tilt[()] = tilt(truth.base_orientation)
    record.com_speed[()] = sqrt(sum(v * v for v in truth.com_velocity.tolist()))
    record.angular_speed[()] = sqrt(sum(w * w for w in truth.base_angular_velocity.tolist()))
    record.points_unloaded[()] = footing.points_missing(truth.contact_touched)
    record.margin[()] = support_margin(
        truth.contact_position, truth.contact_touched, truth.com.item(0), truth.com.item(1)
    )
    record.load_share[()] = footing.least_load(truth.contact_force)
