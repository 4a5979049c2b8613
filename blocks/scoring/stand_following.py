"""Records how a robot stands on its feet, tick by tick, from the simulation truth."""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple, TypeVar

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Array2D,
    Flags1D,
    Indices0D,
    Indices1D,
)
from ...mathematics.capture_step import support_margin
from ...mathematics.kernel import kernel
from ...mathematics.rotations import tilt
from ...runtime.language.signals import Signal
from .footing import Footing, least_load, points_missing
from .stand_criteria import NEVER, StandCriteria

Fields = TypeVar("Fields", bound=tuple[Any, ...])


class Truth(NamedTuple):
    """The fields of ``RobotTruth`` that a judge of a robot on its feet reads."""

    base_position: Array1D
    base_orientation: Array1D
    base_angular_velocity: Array1D
    com: Array1D
    com_velocity: Array1D
    contact_position: Array2D
    contact_force: Array2D
    contact_touched: Flags1D
    ground_height: Array1D
    forbidden_contacts: Indices0D
    joint_limit_violation: Array0D
    motor_overload: Array0D
    saturated_share: Array0D
    motor_torque: Array1D
    motor_speed: Array1D


class Stand(NamedTuple):
    """The fields of ``StandRecord`` that are followed here."""

    now: Array0D
    ticks: Indices0D
    fall_time: Array0D
    fall_tilt: Array0D
    fall_height: Array0D
    standing_height: Array0D
    foot: Array2D
    landed_foot: Array2D
    foot_slip: Array0D
    lifted_time: Array1D
    steps: Indices0D
    step_end: Array1D
    longest_lift: Array0D
    peak_tilt: Array0D
    judged_time: Array0D
    tilt: Array0D
    com_speed: Array0D
    angular_speed: Array0D
    margin: Array0D
    load_share: Array0D
    points_unloaded: Indices0D
    forbidden: Indices0D
    forbidden_time: Array0D
    violation: Array0D
    overload: Array0D
    peak_torque: Array0D
    peak_speed: Array0D
    saturated: Array0D
    failures: Indices0D


class Limits(NamedTuple):
    """What following a robot on its feet must know: ``fall_tilt`` [rad], ``fall_height`` [m],
    ``step_time`` [s] and ``steps`` of the ``StandCriteria``, for how long [s] a foot that has taken a
    step may settle, the ``period`` of the block [s], the robot's ``weight`` [N], and for every contact
    point the index of its foot, (n_contacts,)."""

    fall_tilt: float
    fall_height: float
    step_time: float
    steps: int
    settling: float
    period: float
    weight: float
    foot_of_point: Indices1D


def fields_of(kind: type[Fields], signal: Signal) -> Fields:
    """The fields of a signal that a named tuple has, as kernels take them."""
    names: tuple[str, ...] = kind._fields  # type: ignore[attr-defined]  # a NamedTuple's
    return kind._make(getattr(signal, name) for name in names)  # type: ignore[attr-defined, no-any-return]  # a NamedTuple's


def following_limits(
    criteria: StandCriteria, footing: Footing, settling: float, period: float
) -> Limits:
    """The limits of a robot; ``criteria`` as ``for_robot`` gives them."""
    assert criteria.fall_height is not None
    return Limits(
        criteria.fall_tilt, criteria.fall_height, criteria.step_time, criteria.steps, settling,
        period, footing.weight, footing.foot_of_point,
    )  # fmt: skip


@kernel
def keep_largest(largest: Array0D, value: float) -> None:
    """``largest``, without a dimension, becomes ``value`` if that is larger."""
    largest[()] = max(largest[()], value)


@kernel
def keep_least(least: Array0D, value: float) -> None:
    """``least``, without a dimension, becomes ``value`` if that is smaller."""
    least[()] = min(least[()], value)


@kernel
def largest_of(values: Array1D) -> float:
    """The largest of at least one value, (n,)."""
    largest = values[0]
    for k in range(1, values.shape[0]):
        largest = max(largest, values[k])
    return float(largest)


@kernel
def largest_magnitude(values: Array1D) -> float:
    """The largest magnitude of at least one value, (n,)."""
    largest = abs(values[0])
    for k in range(1, values.shape[0]):
        largest = max(largest, abs(values[k]))
    return float(largest)


@kernel
def any_touched(touched: Flags1D) -> bool:
    """Whether any contact point carries load."""
    found = False
    for point in range(touched.shape[0]):
        found = found or bool(touched[point])
    return found


@kernel
def begin(record: Stand, truth: Truth) -> None:
    """Start a record in its first tick."""
    record.fall_time[()] = record.judged_time[()] = record.forbidden_time[()] = NEVER
    record.standing_height[()] = truth.com[2]


@kernel
def note_machine(record: Stand, truth: Truth) -> None:
    """Note forbidden contacts and excesses over the limits of joints and motors."""
    forbidden = truth.forbidden_contacts[()]
    if forbidden != 0 and record.forbidden[()] == 0:
        record.forbidden_time[()] = record.now[()]
    record.forbidden[()] = record.forbidden[()] + forbidden
    record.saturated[()] = record.saturated[()] + truth.saturated_share[()]
    keep_largest(record.violation, truth.joint_limit_violation[()])
    keep_largest(record.overload, truth.motor_overload[()])
    keep_largest(record.peak_torque, largest_magnitude(truth.motor_torque))
    keep_largest(record.peak_speed, largest_magnitude(truth.motor_speed))


@kernel
def note_fall(record: Stand, truth: Truth, limits: Limits) -> bool:
    """Note a fall; returns whether the robot falls in this tick, which happens at most once."""
    tilted = tilt(truth.base_orientation)
    height = truth.base_position[2] - largest_of(truth.ground_height)
    fallen = tilted > limits.fall_tilt or height < limits.fall_height
    if not fallen or record.fall_time[()] != NEVER:
        return False
    record.fall_time[()] = record.now[()]
    record.fall_tilt[()] = tilted
    record.fall_height[()] = height
    return True


@kernel
def note_feet(record: Stand, touched: Flags1D, limits: Limits, stay: bool) -> None:
    """How far the feet slide and for how long one is off the ground, once they should ``stay``.

    A foot that is off the ground for longer than a step takes has stepped, if it may. Then it may
    move until it has been on the ground for ``limits.settling``.
    """
    for foot in range(record.foot.shape[0]):
        if stay:
            note_foot(record, touched, limits, foot)
            continue
        for axis in range(2):
            record.landed_foot[foot, axis] = record.foot[foot, axis]


@kernel
def note_foot(record: Stand, touched: Flags1D, limits: Limits, foot: int) -> None:
    """The same of one foot that should stay."""
    now, loaded = record.now[()], False
    for point in range(touched.shape[0]):
        if limits.foot_of_point[point] == foot and touched[point]:
            loaded = True
    total = 0.0 if loaded else record.lifted_time[foot] + limits.period
    record.lifted_time[foot] = total
    end = record.step_end[foot]
    if total > limits.step_time:
        going_on = end > 0.0 and now - end < 1.5 * limits.period
        if going_on or record.steps[()] < limits.steps:
            record.steps[()] = record.steps[()] + (0 if going_on else 1)
            record.step_end[foot] = end = now
    if end > 0.0 and now - end < limits.settling:
        for axis in range(2):
            record.landed_foot[foot, axis] = record.foot[foot, axis]
        return
    x = record.foot[foot, 0] - record.landed_foot[foot, 0]
    y = record.foot[foot, 1] - record.landed_foot[foot, 1]
    if loaded or limits.steps == 0:
        keep_largest(record.foot_slip, sqrt(x * x + y * y))
    if total <= limits.step_time or record.steps[()] >= limits.steps:
        keep_largest(record.longest_lift, total)


@kernel
def speed_of(velocity: Array1D) -> float:
    """The magnitude of a vector (3,)."""
    x, y, z = velocity[0], velocity[1], velocity[2]
    return sqrt(x * x + y * y + z * z)


@kernel
def note_rest(record: Stand, truth: Truth, limits: Limits) -> None:
    """Note how the robot stands now, for the judgement of its rest."""
    feet = record.foot.shape[0]
    record.judged_time[()] = record.now[()]
    record.tilt[()] = tilt(truth.base_orientation)
    record.com_speed[()] = speed_of(truth.com_velocity)
    record.angular_speed[()] = speed_of(truth.base_angular_velocity)
    record.points_unloaded[()] = points_missing(limits.foot_of_point, truth.contact_touched, feet)
    record.margin[()] = support_margin(
        truth.contact_position, truth.contact_touched, truth.com[0], truth.com[1]
    )
    record.load_share[()] = least_load(
        limits.foot_of_point, truth.contact_force, feet, limits.weight
    )
