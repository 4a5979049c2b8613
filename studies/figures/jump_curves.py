"""The in-situ jump over time, as in the paper's figure of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ...plotting import COLOURS, Line, Panel, Shade
from .canvas import Column, draw_columns
from .trace import Trace, pitch_and_roll

if TYPE_CHECKING:
    from PIL.Image import Image

    from ...robots.description import RobotDescription

BEFORE, AFTER = 0.6, 0.7
"""What is shown before lift-off and after touchdown [s]."""
AXES = ("x", "y", "z")
MEASURED, PLANNED = COLOURS[0], COLOURS[1]


def draw_jump(trace: Trace, robot: RobotDescription) -> Image:
    """CoM, momenta, torso pitch, contact force, joint velocities and torques of one jump."""
    t, flight = trace.time, trace.flight_times
    shades = [Shade(*flight)] if flight else []
    start, end = flight or (float(t[0]), float(t[-1]))
    x_range = (max(float(t[0]), start - BEFORE), min(float(t[-1]), end + AFTER))
    mass = robot.total_mass

    def panel(title: str, *lines: Line) -> Panel:
        return Panel(title, lines, "time [s]", x_range, shades)

    def both(title: str, name: str, axis: int, scale: float = 1.0) -> Panel:
        return panel(
            title,
            Line("simulated", t, scale * trace.truth(name)[:, axis], MEASURED),
            Line("plan", t, scale * trace.plan(name)[:, axis], PLANNED, True),
        )

    momentum = [
        Line(f"l_{axis}", t, mass * trace.truth("com_velocity")[:, k], COLOURS[k])
        for k, axis in enumerate(AXES)
    ]
    angular = [
        Line(f"k_{axis}", t, trace.truth("angular_momentum")[:, k], COLOURS[k])
        for k, axis in enumerate(AXES)
    ]
    pitch, _ = pitch_and_roll(trace.truth("base_orientation"))
    planned_pitch, _ = pitch_and_roll(trace.plan("orientation"))
    force = trace.truth("contact_force")[:, :, 2].sum(axis=1)
    left = [
        (k, joint.name.removeprefix("left_").replace("_", " "))
        for k, joint in enumerate(robot.joints)
        if joint.name in ("left_hip_pitch", "left_knee", "left_ankle")
    ]
    velocity = [
        Line(name, t, trace.truth("joint_velocity")[:, k], COLOURS[n])
        for n, (k, name) in enumerate(left)
    ]
    torque = [
        Line(name, t, trace.signals["robot.joints.torque"][:, k], COLOURS[n])
        for n, (k, name) in enumerate(left)
    ]
    body = Column(
        "",
        [
            both("CoM height [cm]", "com", 2, 100.0),
            both("CoM vertical velocity [m/s]", "com_velocity", 2),
            both("CoM forward position [cm]", "com", 0, 100.0),
            panel(
                "torso pitch [deg], forward positive",
                Line("simulated", t, np.degrees(pitch), MEASURED),
                Line("plan", t, np.degrees(planned_pitch), PLANNED, True),
            ),
            panel("contact force, vertical [N]", Line("", t, force, MEASURED)),
        ],
    )
    legs = Column(
        "",
        [
            panel("linear momentum [kg m/s]", *momentum),
            panel("angular momentum about the CoM, all axes [N m s]", *angular),
            both("angular momentum about the CoM, k_y [N m s]", "angular_momentum", 1),
            panel("joint velocity, left leg [rad/s]", *velocity),
            panel("joint torque, left leg [N m]", *torque),
        ],
    )
    verdict = "succeeded" if trace.outcome.success else f"no success: {trace.outcome.reason}"
    notes = [f"Closed loop in the standard trial, seed {trace.seed}: {verdict}. Flight shaded."]
    return draw_columns("In-situ jump", notes, [body, legs])


def jump_numbers(trace: Trace) -> Mapping[str, float]:
    """The numbers that belong to the figure, by names that contain the units."""
    com = trace.truth("com")[:, 2]
    flight = trace.flight
    numbers = {
        "com_change_cm": 100.0 * float(com.max() - com.min()),
        "peak_joint_torque_nm": float(np.abs(trace.signals["robot.joints.torque"]).max()),
        "peak_joint_velocity_rad_s": float(np.abs(trace.truth("joint_velocity")).max()),
    }
    if flight is not None:
        pitch = np.degrees(pitch_and_roll(trace.truth("base_orientation"))[0])[flight]
        momentum = trace.truth("angular_momentum")[flight, 1]
        squat = float(com[: flight.start].min())
        numbers |= {
            "com_squat_to_apex_cm": 100.0 * (float(com[flight].max()) - squat),
            "pitch_change_in_flight_deg": float(pitch[-1] - pitch[0]),
            "k_y_in_flight_nms": float(momentum.mean()),
            "flight_s": float(np.diff(trace.flight_times or (0.0, 0.0))[0]),
        }
    return numbers
