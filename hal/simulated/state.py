"""The state of a simulated robot from tick to tick, and the record of every physics step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from ...mathematics.arrays import (
    Array1D,
    Array2D,
    Flags1D,
    Indices0D,
    Indices1D,
    Vector3,
)
from ...mathematics.kernel import kernel
from ...runtime.language.signals import Field, Signal, StateElements
from ..drive_control import CommandTargets

if TYPE_CHECKING:
    from mujoco import MjModel


class PhysicsState(Signal):
    """The complete state of the simulator (MuJoCo's integration state) and of all random streams.

    It is written before a snapshot and read back after a restore.
    """

    step = Field(dtype="int64", text="physics steps since the run began")
    integration = Field("n_integration", text="time, positions, velocities, warm start, forces")
    random = Field("n_random", dtype="int64", text="the state of the random streams")
    imu_filters = Field(("n_imu_filters", 2), text="memory of the IMU's filters")
    imu_samples = Field(("n_imu_slots", "n_imu_axes"), text="past samples: rate and force")
    imu_taken = Field(1, dtype="int64", text="number of samples the IMU has taken")
    imu_reading = Field("n_imu_axes", text="readings of the IMU: rate and force")
    encoder_samples = Field(("n_encoder_slots", "n_sensed_joints"), text="past joint angles")
    speed_samples = Field(("n_encoder_slots", "n_sensed_joints"), text="past joint velocities")
    encoder_play = Field(
        "n_sensed_joints", unit="rad", text="places of the rotors within their play"
    )
    encoder_taken = Field(1, dtype="int64", text="number of samples the encoders have taken")
    encoder_position = Field("n_sensed_joints", unit="rad", text="readings of the encoders")
    encoder_velocity = Field("n_sensed_joints", unit="rad/s", text="joint rates made of them")
    motor_torque = Field("n_real_motors", unit="N m", text="behind the drives' current loops")
    rotor_angle = Field("n_rotors", unit="rad", text="of rotors behind gears that yield")
    rotor_speed = Field("n_rotors", unit="rad/s", text="of them")
    switch_closed = Field("n_late_switches", dtype="bool", text="behind debouncing and sticking")
    switch_waits = Field("n_late_switches", dtype="int64", text="steps that a change has lasted")
    gantry = Field("n_gantry", text="rope paid out, and to be; step when; distance of its ends")
    battery = Field("n_battery", text="voltage, charge gone, voltage to recover, current")
    winding_temperature = Field("n_windings", text="of every winding [deg C]")


class DriveState(CommandTargets):
    """The drives' commands: a ring of ``n_queue`` slots for the active one and those to arrive."""

    active = Field(dtype="int64", text="slot of the command being executed")
    pending = Field(dtype="int64", text="number of slots behind it that have not arrived")
    last_due = Field(dtype="int64", text="arrival of the command sent last; arrivals keep order")
    due = Field("n_queue", dtype="int64", text="physics step at which each arrives")
    mode = Field("n_queue", dtype="int64", text="see CommandMode")


class TickRecord(Signal):
    """Sums and extremes over the physics steps of one tick, and the memory of the switches."""

    steps = Field(dtype="int64", text="physics steps recorded")
    load = Field(("n_contacts", 4), text="sum of contact counts and forces on the ground [N]")
    accelerometer = Field(3, unit="m/s^2", frame="body", text="sum of specific forces")
    forbidden = Field(
        dtype="int64", text="steps with a contact other than a contact point's on the ground"
    )
    sole = Field(
        dtype="int64",
        text="steps of the run in which a sole touched uneven ground between its contact points",
    )
    violation = Field("n_joints", unit="rad", text="largest excess over a joint limit")
    joint_torque = Field("n_joints", unit="N m", text="sum of the joint torques")
    torque_high = Field("n_joints", unit="N m", text="highest motor torque")
    torque_low = Field("n_joints", unit="N m", text="lowest motor torque")
    speed_high = Field("n_joints", unit="rad/s", text="highest motor speed")
    speed_low = Field("n_joints", unit="rad/s", text="lowest motor speed")
    overload = Field("n_joints", unit="N m", text="largest excess of a motor torque over its limit")
    saturated = Field("n_joints", dtype="int64", text="steps in which the motor was at its limit")
    closed = Field("n_contacts", dtype="bool", text="switch pressed, before bounce")
    bounce_end = Field("n_contacts", dtype="int64", text="physics step up to which it chatters")


class SensorMemory(Signal):
    """Memory of the sensors that the description mounts, from tick to tick."""

    total = Field("n_sensed", text="sums over the physics steps since the last sample")
    steps = Field("n_mounted", dtype="int64", text="physics steps since the last sample")
    samples = Field("n_sensor_samples", text="past samples, for readings that are late")
    count = Field("n_mounted", dtype="int64", text="samples so far")


def integration_elements(model: MjModel) -> list[StateElements]:
    """Return the parts of MuJoCo's integration state, in their order."""
    import mujoco

    kinds = mujoco.mjtJoint
    position: dict[int, list[tuple[str, int, str, str]]] = {
        int(kinds.mjJNT_FREE): [("position", 3, "m", ""), ("orientation", 4, "", "wxyz")],
        int(kinds.mjJNT_BALL): [("orientation", 4, "", "wxyz")],
        int(kinds.mjJNT_SLIDE): [("position", 1, "m", "")],
        int(kinds.mjJNT_HINGE): [("position", 1, "rad", "")],
    }
    velocity: dict[int, list[tuple[str, int, str, str]]] = {
        int(kinds.mjJNT_FREE): [("velocity", 3, "m/s", ""), ("angular_velocity", 3, "rad/s", "")],
        int(kinds.mjJNT_BALL): [("angular_velocity", 3, "rad/s", "")],
        int(kinds.mjJNT_SLIDE): [("velocity", 1, "m/s", "")],
        int(kinds.mjJNT_HINGE): [("velocity", 1, "rad/s", "")],
    }
    found = []
    names = [model.joint(k).name or f"joint{k}" for k in range(model.njnt)]
    parts = [p for p in mujoco.mjtState.__members__.values() if int(p) & (int(p) - 1) == 0 < int(p)]
    for part in sorted(parts, key=int):
        size = mujoco.mj_stateSize(model, part)
        if not int(part) & int(mujoco.mjtState.mjSTATE_INTEGRATION) or not size:
            continue
        if part in (mujoco.mjtState.mjSTATE_QPOS, mujoco.mjtState.mjSTATE_QVEL):
            table = position if part == mujoco.mjtState.mjSTATE_QPOS else velocity
            for name, kind in zip(names, model.jnt_type.tolist(), strict=True):
                found += [
                    StateElements(f"{name}.{what}", count, unit, order)
                    for what, count, unit, order in table[kind]
                ]
        else:
            guess = part == mujoco.mjtState.mjSTATE_WARMSTART
            name = "" if guess else part.name.removeprefix("mjSTATE_").lower()
            found.append(StateElements(name, size))
    return found


class StepSensors(NamedTuple):
    """True values of the simulator after a physics step.

    ``load`` (n_contacts, 4) are the contact counts of the contact points and the forces on the ground
    [N], ``soles`` (n_soles,) all contacts of soles with uneven ground, ``accelerometer`` (3,) is the specific force [m/s^2, body], ``contacts`` (1,) the number of all
    contacts, and ``position`` (n_joints,) are the joint angles [rad].
    """

    load: Array2D
    soles: Array1D
    accelerometer: Vector3
    contacts: Array1D
    position: Array1D


@kernel
def clear(record: TickRecord) -> None:
    """Begin a new record, except for the memory of the switches."""
    record.steps = 0
    record.forbidden = 0
    record.load[:, :] = 0.0
    record.accelerometer[:] = 0.0
    record.saturated[:] = 0
    record.joint_torque[:] = 0.0
    record.violation[:] = 0.0
    record.overload[:] = 0.0
    record.torque_high[:] = -math.inf
    record.torque_low[:] = math.inf
    record.speed_high[:] = -math.inf
    record.speed_low[:] = math.inf


@kernel
def mean_over_steps(total: Array1D, steps: Indices0D, mean: Array1D) -> None:
    """Compute the ``mean`` (n,) of what has been summed up over ``steps``, a count without a dimension."""
    mean[:] = total / steps[()]


@kernel
def read_encoders(position: Array1D, offset: Array1D, reading: Array1D) -> None:
    """Read the drives' own encoders [rad] from the joints' positions, each (n_joints,)."""
    reading[:] = position + offset


@kernel
def watch_switches(
    step: int,
    load: Array2D,
    ground_force: Array1D,
    bounce_steps: int,
    closed: Flags1D,
    bounce_end: Indices1D,
) -> None:
    """Update the switches in one physics step.

    Args:
        load: the contact points' contact counts and forces on the ground [N], (n_contacts, 4); the
            vertical force is negative where the robot presses.
        ground_force: up to which force every switch is closed [N], (n_contacts,).
        bounce_steps: how long a switch that has changed chatters.
        closed, bounce_end: as in ``TickRecord``.
    """
    for point in range(closed.shape[0]):
        now = load[point, 3] <= ground_force[point]
        if bounce_steps > 0 and now != closed[point]:
            bounce_end[point] = step + 1 + bounce_steps
        closed[point] = now


@kernel
def update_maximum(highest: Array1D, k: int, value: float) -> None:
    """Element ``k`` becomes ``value`` if that is higher, or not a number."""
    if value > highest[k] or math.isnan(value):
        highest[k] = value


@kernel
def update_minimum(lowest: Array1D, k: int, value: float) -> None:
    """Element ``k`` becomes ``value`` if that is lower, or not a number."""
    if value < lowest[k] or math.isnan(value):
        lowest[k] = value


@kernel
def record_step(
    step: Indices0D,
    sensors: StepSensors,
    lower: Array1D,
    upper: Array1D,
    ground_force: Array1D,
    bounce_steps: int,
    record: TickRecord,
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
    step[()] = step[()] + 1
    record.steps = record.steps + 1
    allowed = 0.0
    for point in range(sensors.load.shape[0]):
        allowed += sensors.load[point, 0]
    on_soles = 0.0
    for sole in range(sensors.soles.shape[0]):
        on_soles += sensors.soles[sole]
    if on_soles > allowed:
        record.sole = record.sole + 1
        allowed = on_soles
    record.load[:, :] += sensors.load
    record.accelerometer[:] += sensors.accelerometer
    if sensors.contacts[0] > allowed:
        record.forbidden = record.forbidden + 1
    for joint in range(lower.shape[0]):
        angle = sensors.position[joint]
        update_maximum(record.violation, joint, lower[joint] - angle)
        update_maximum(record.violation, joint, angle - upper[joint])
