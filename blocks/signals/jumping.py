"""Signals of a jump: its phases, the plan at the present instant, the phase the robot is in.

Units, frames and orders are those of the package ``signals``.
"""

from __future__ import annotations

from ...planner.task.phase import Phase
from ...runtime.language.signals import Field, Signal


class JumpReference(Signal):
    """A planned jump at the present instant; positions relative to where the robot stood."""

    time = Field(unit="s", text="time since the plan began")
    phase = Field(dtype="int64", values=Phase, text="planned phase, see Phase")
    lift_off_time = Field(unit="s", text="planned lift-off in plan time")
    touchdown_time = Field(unit="s", text="planned touchdown in plan time")
    com = Field(3, unit="m", frame="world", text="centre of mass")
    com_velocity = Field(3, unit="m/s", frame="world", text="its velocity")
    com_acceleration = Field(3, unit="m/s^2", frame="world", text="its acceleration")
    orientation = Field(4, unit="", quaternion=True, text="base quaternion x, y, z, w")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="base angular velocity")
    angular_acceleration = Field(
        3, unit="rad/s^2", frame="body", text="its rate; zero if not known"
    )
    angular_momentum = Field(3, unit="N m s", frame="world", text="k about the com")
    angular_momentum_rate = Field(3, unit="N m", frame="world", text="its rate")
    contact = Field("n_contacts", dtype="bool", text="points that are planned to carry load")
    toes_first = Field(
        dtype="bool",
        text="the flight under way or next ends on some of the points only, such as the toes",
    )
    foot_position = Field(("n_feet", 3), unit="m", frame="world", text="sole centres")
    foot_velocity = Field(("n_feet", 3), unit="m/s", frame="world", text="their velocities")
    foot_yaw = Field("n_feet", unit="rad", frame="world", text="heading of each foot")
    foot_pitch = Field("n_feet", unit="rad", frame="world", text="of each foot, toes down positive")
    joint_position = Field("n_joints", unit="rad", text="planned joint angles")
    joint_velocity = Field("n_joints", unit="rad/s", text="planned joint velocities")
    joint_acceleration = Field("n_joints", unit="rad/s^2", text="planned; zero if not known")
    joint_torque = Field("n_joints", unit="N m", text="planned joint torques; zero if not known")


class PhaseState(Signal):
    """The phase the robot is really in, by plan time and measured contact."""

    phase = Field(dtype="int64", values=Phase, text="see Phase")
    time_in_phase = Field(unit="s", text="time since the phase began")
    time_to_touchdown = Field(unit="s", text="predicted; zero outside flight")
    time_since_touchdown = Field(unit="s", text="zero before the first touchdown")
    stance = Field("n_contacts", dtype="bool", text="points the controller may push with")
    stepping = Field("n_contacts", dtype="bool", text="points of a foot that takes a step")
    step_acceleration = Field(
        ("n_contacts", 3), unit="m/s^2", frame="world", text="planned acceleration of these points"
    )
