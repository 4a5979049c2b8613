"""The state of a simulated robot from tick to tick, as signals."""

from __future__ import annotations

from ...runtime.language.signals import Field, Signal


class PhysicsState(Signal):
    """The complete state of the simulator (MuJoCo's integration state) and of all random streams.

    It is written before a snapshot and read back after a restore.
    """

    step = Field(dtype="int64", text="physics steps since the run began")
    integration = Field("n_integration", text="time, positions, velocities, warm start, forces")
    random = Field("n_random", dtype="int64", text="the state of the random streams")


class DriveState(Signal):
    """The drives' commands: a ring of ``n_queue`` slots for the active one and those to arrive."""

    active = Field(dtype="int64", text="slot of the command being executed")
    pending = Field(dtype="int64", text="number of slots behind it that have not arrived")
    last_due = Field(dtype="int64", text="arrival of the command sent last; arrivals keep order")
    due = Field("n_queue", dtype="int64", text="physics step at which each arrives")
    mode = Field("n_queue", dtype="int64", text="see CommandMode")
    torque = Field(("n_queue", "n_joints"), unit="N m", text="feedforward joint torques")
    position = Field(("n_queue", "n_joints"), unit="rad", text="joint angle targets")
    velocity = Field(("n_queue", "n_joints"), unit="rad/s", text="joint velocity targets")
    stiffness = Field(("n_queue", "n_joints"), unit="N m/rad", text="gains on position")
    damping = Field(("n_queue", "n_joints"), unit="N m s/rad", text="gains on velocity")


class TickRecord(Signal):
    """Sums and extremes over the physics steps of one tick, and the memory of the switches."""

    steps = Field(dtype="int64", text="physics steps recorded")
    load = Field(("n_contacts", 4), text="sum of contact counts and forces on the ground [N]")
    accelerometer = Field(3, unit="m/s^2", frame="body", text="sum of specific forces")
    forbidden = Field(
        dtype="int64", text="steps with a contact other than a contact point's on the ground"
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
