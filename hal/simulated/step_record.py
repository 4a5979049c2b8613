"""What is noted of every physics step of a simulated robot: loads, switches, joint limits."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import Array, Counts, Flags
from ...mathematics.kernel import kernel
from .actuator import raise_to
from .sensors import watch_switches


class StepSensors(NamedTuple):
    """What the simulator knows after a physics step.

    ``load`` (n_contacts, 4) are the contact counts of the contact points and the forces on the ground
    [N], ``accelerometer`` (3,) is the specific force [m/s^2, body], ``contacts`` (1,) the number of all
    contacts, and ``position`` (n_joints,) are the joint angles [rad].
    """

    load: Array
    accelerometer: Array
    contacts: Array
    position: Array


class StepRecord(NamedTuple):
    """Where it is noted: see ``TickRecord``."""

    steps: Counts
    load: Array
    accelerometer: Array
    forbidden: Counts
    violation: Array
    closed: Flags
    bounce_end: Counts


class Cleared(NamedTuple):
    """The sums and extremes of numbers that begin anew with every tick: see ``TickRecord``."""

    load: Array
    accelerometer: Array
    joint_torque: Array
    violation: Array
    overload: Array
    torque_high: Array
    torque_low: Array
    speed_high: Array
    speed_low: Array


@kernel
def clear(steps: Counts, forbidden: Counts, saturated: Counts, record: Cleared) -> None:
    """Begin a new record. ``steps`` and ``forbidden`` are without a dimension."""
    steps[()] = forbidden[()] = 0
    for point in range(record.load.shape[0]):
        for axis in range(4):
            record.load[point, axis] = 0.0
    for axis in range(3):
        record.accelerometer[axis] = 0.0
    for k in range(saturated.shape[0]):
        saturated[k] = 0
        record.joint_torque[k] = record.violation[k] = record.overload[k] = 0.0
        record.torque_high[k] = record.speed_high[k] = -math.inf
        record.torque_low[k] = record.speed_low[k] = math.inf


@kernel
def mean_over_steps(total: Array, steps: Counts, mean: Array) -> None:
    """The ``mean`` (n,) of what has been summed up over ``steps``, a count without a dimension."""
    for k in range(mean.shape[0]):
        mean[k] = float(total[k]) / int(steps[()])


@kernel
def read_encoders(position: Array, offset: Array, reading: Array) -> None:
    """What the drives' own encoders read [rad] of the joints' positions, each (n_joints,)."""
    for joint in range(reading.shape[0]):
        reading[joint] = float(position[joint]) + float(offset[joint])


@kernel
def note_step(
    step: Counts,
    sensors: StepSensors,
    lower: Array,
    upper: Array,
    ground_force: Array,
    bounce_steps: int,
    record: StepRecord,
) -> None:
    """Note a physics step that has been made, and count it.

    Args:
        step: the count, without a dimension.
        lower, upper: the joint limits [rad], (n_joints,).
        ground_force, bounce_steps: as for ``watch_switches``.
    """
    watch_switches(
        int(step[()]), sensors.load, ground_force, bounce_steps, record.closed, record.bounce_end
    )
    step[()] = int(step[()]) + 1
    record.steps[()] = int(record.steps[()]) + 1
    allowed = 0.0
    for point in range(sensors.load.shape[0]):
        allowed += float(sensors.load[point, 0])
        for axis in range(4):
            record.load[point, axis] += sensors.load[point, axis]
    for axis in range(3):
        record.accelerometer[axis] += sensors.accelerometer[axis]
    if sensors.contacts[0] > allowed:
        record.forbidden[()] = int(record.forbidden[()]) + 1
    for joint in range(lower.shape[0]):
        angle = float(sensors.position[joint])
        raise_to(record.violation, joint, float(lower[joint]) - angle)
        raise_to(record.violation, joint, angle - float(upper[joint]))
