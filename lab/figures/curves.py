"""A figure of columns of panels: a title, lines of notes, panels under each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...mathematics.arrays import Array
from ...plotting import (
    COLOURS,
    FAINT,
    Curve,
    Panel,
    Shade,
    draw_panels,
    image,
    new_figure,
    style,
)
from .trace import Trace, pitch_and_roll

if TYPE_CHECKING:
    from PIL.Image import Image

    from ...robots.description import RobotDescription


COLUMN_WIDTH, PANEL_HEIGHT = 5.0, 1.35
"""The sizes of a column and of a panel with its title [inch]."""
NOTE_HEIGHT = 0.2


@dataclass(frozen=True)
class Column:
    """Panels under each other with a header; what x is stands under the last one."""

    header: str
    panels: Sequence[Panel]


def draw_columns(title: str, notes: Sequence[str], columns: Sequence[Column]) -> Image:
    """Draw the figure as a picture, the columns side by side.

    ``notes`` are lines of text between the title and the panels.
    """
    rows = max(len(column.panels) for column in columns)
    head = 0.45 + NOTE_HEIGHT * len(notes)
    height = head + 0.5 + rows * PANEL_HEIGHT
    with style():
        figure = new_figure(len(columns) * COLUMN_WIDTH, height)
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.set(rect=(0.0, 0.0, 1.0, 1.0 - head / height))
        inch = 1.0 / height
        figure.text(0.012, 1.0 - 0.1 * inch, title, va="top", fontsize=12, fontweight="bold")
        for number, note in enumerate(notes):
            below = 0.4 + NOTE_HEIGHT * number
            figure.text(0.012, 1.0 - below * inch, note, va="top", fontsize=8, color=FAINT)
        grid = figure.subplots(rows, len(columns), squeeze=False)
        pairs = []
        for place, column in enumerate(columns):
            for row, panel in enumerate(column.panels):
                last = row == len(column.panels) - 1
                axes = grid[row, place]
                pairs.append((axes, panel if last else replace(panel, x_label="")))
                axes.tick_params(labelbottom=last)
        draw_panels(pairs)
        for place, column in enumerate(columns):
            if column.header:
                # two lines above the title of the first panel
                grid[0, place].annotate(
                    column.header, (0.0, 1.0), (0.0, 20.0), xycoords="axes fraction",
                    textcoords="offset points", fontsize=10, fontweight="bold",
                )  # fmt: skip
        return image(figure)


BEFORE, AFTER = 0.6, 0.7
"""Time shown before lift-off and after touchdown [s]."""
AXES = ("x", "y", "z")
MEASURED, PLANNED = COLOURS[0], COLOURS[1]


def draw_jump(trace: Trace, robot: RobotDescription) -> Image:
    """Draw CoM, momenta, torso pitch, contact force, joint velocities and torques of one jump."""
    t, flight = trace.time, trace.flight_times
    shades = [Shade(*flight)] if flight else []
    start, end = flight or (float(t[0]), float(t[-1]))
    x_range = (max(float(t[0]), start - BEFORE), min(float(t[-1]), end + AFTER))
    mass = robot.total_mass

    def panel(title: str, *lines: Curve) -> Panel:
        return Panel(title, lines, "time [s]", x_range, shades)

    def both(title: str, name: str, axis: int, scale: float = 1.0) -> Panel:
        return panel(
            title,
            Curve("simulated", t, scale * trace.truth(name)[:, axis], MEASURED),
            Curve("plan", t, scale * trace.plan(name)[:, axis], PLANNED, True),
        )

    momentum = [
        Curve(f"l_{axis}", t, mass * trace.truth("com_velocity")[:, k], COLOURS[k])
        for k, axis in enumerate(AXES)
    ]
    angular = [
        Curve(f"k_{axis}", t, trace.truth("angular_momentum")[:, k], COLOURS[k])
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
        Curve(name, t, trace.truth("joint_velocity")[:, k], COLOURS[n])
        for n, (k, name) in enumerate(left)
    ]
    torque = [
        Curve(name, t, trace.signals["robot.joints.torque"][:, k], COLOURS[n])
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
                Curve("simulated", t, np.degrees(pitch), MEASURED),
                Curve("plan", t, np.degrees(planned_pitch), PLANNED, True),
            ),
            panel("contact force, vertical [N]", Curve("", t, force, MEASURED)),
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
    """Return the numbers that belong to the figure, by names that contain the units."""
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
        planned = np.degrees(pitch_and_roll(trace.plan("orientation"))[0])[flight]
        thrust = trace.truth("angular_momentum")[: flight.start, 1]
        squat = float(com[: flight.start].min())
        numbers |= {
            "com_squat_to_apex_cm": 100.0 * (float(com[flight].max()) - squat),
            "pitch_change_in_flight_deg": float(pitch[-1] - pitch[0]),
            "planned_pitch_change_in_flight_deg": float(planned[-1] - planned[0]),
            "k_y_at_most_in_thrust_nms": float(np.abs(thrust).max()),
            "k_y_in_flight_nms": float(momentum.mean()),
            "flight_s": float(np.diff(trace.flight_times or (0.0, 0.0))[0]),
        }
    return numbers


RIGHT, LEFT = 0, 1
"""The feet in the robot's description."""


def draw_push(arms: Mapping[str, Sequence[Trace]]) -> Image:
    """Draw the figure with both directions, +x first, and a curve for every arm. Only the flight is
    shown."""
    columns = []
    for number, header in enumerate(("(a) push along +x", "(b) push along +y")):
        traces = {arm: found[number] for arm, found in arms.items() if len(found) > number}
        columns.append(_column(header, number, traces))
    notes = [
        (
            "Closed loop in the standard trial, flight only; the push is shaded. Landing places and feet "
            "are seen from the CoM, world axes."
        ),
        "; ".join(
            f"{arm}: "
            + ", ".join("fell" if "fell" in run.outcome.reason else "stood" for run in found)
            for arm, found in arms.items()
        )
        + " (+x, +y of the seed shown)",
    ]
    return draw_columns("Push in flight: 70 N on the torso for 0.01 s", notes, columns)


def _column(header: str, axis: int, traces: Mapping[str, Trace]) -> Column:
    """Make a column; ``axis`` is 0 for a push along x, 1 along y."""
    other, letter, about = (1, "x", "y") if axis == 0 else (0, "y", "x")
    rows: list[list[Curve]] = [[], [], [], [], []]
    shades: list[Shade] = []
    longest = 0.0
    for number, (arm, trace) in enumerate(traces.items()):
        ticks = trace.flight
        if ticks is None:
            continue
        t = 1000.0 * (trace.time[ticks] - trace.time[ticks.start])
        longest = max(longest, float(t[-1]))
        shades = shades or _push(trace, ticks)
        look = COLOURS[number]
        pitch, roll = pitch_and_roll(trace.truth("base_orientation"))
        tilt = np.degrees(pitch if axis == 0 else roll)[ticks]
        placed = 100.0 * trace.signals["landing.feet.landing"][ticks]
        reached = 100.0 * (trace.feet - trace.truth("com")[:, None])[ticks]
        rows[0].append(Curve(arm, t, trace.truth("com_velocity")[ticks, axis], look))
        rows[1].append(Curve(arm, t, trace.truth("angular_momentum")[ticks, other], look))
        if axis == 0:
            rows[2].append(Curve(arm, t, placed[:, :, 0].mean(axis=1), look))
            rows[3].append(Curve(arm, t, reached[:, :, 0].mean(axis=1), look))
        else:
            rows[2] += _feet(arm, t, placed, look)
            rows[3] += _feet(arm, t, reached, look)
        rows[4].append(Curve(arm, t, tilt, look))
    feet = "both feet's middle" if axis == 0 else "left solid, right dashed"
    lean = "pitch" if axis == 0 else "roll"
    titles = (
        f"CoM velocity {letter} [m/s]",
        f"angular momentum k_{about} [N m s]",
        f"landing place wanted {letter} [cm], {feet}",
        f"foot position {letter} [cm], {feet}",
        f"torso {lean} [deg]",
    )
    panels = [
        Panel(title, named, "time since lift-off [ms]", (0.0, longest or 1.0), shades)
        for title, named in zip(titles, rows, strict=True)
    ]
    return Column(header, panels)


def _feet(arm: str, t: Array, places: Array, look: str) -> list[Curve]:
    return [
        Curve(arm, t, places[:, LEFT, 1], look),
        Curve("", t, places[:, RIGHT, 1], look, dashed=True),
    ]


def _push(trace: Trace, flight: slice) -> list[Shade]:
    pushed = np.flatnonzero(np.abs(trace.signals["push.push.force"]).any(axis=1))
    if not len(pushed):
        return []
    lift_off, period = trace.time[flight.start], trace.time[1] - trace.time[0]
    start, end = trace.time[pushed[0]] - lift_off, trace.time[pushed[-1]] + period - lift_off
    return [Shade(1000.0 * float(start), 1000.0 * float(end), "push")]


def push_numbers(trace: Trace, axis: int) -> Mapping[str, float]:
    """Return the changes by the push and the motion of the feet, by names that contain the units."""
    ticks = trace.flight
    pushed = np.flatnonzero(np.abs(trace.signals["push.push.force"]).any(axis=1))
    if ticks is None or not len(pushed):
        return {}
    before, after = int(pushed[0]), min(int(pushed[-1]) + 1, len(trace.time) - 1)
    other = 1 - axis
    speed = trace.truth("com_velocity")[:, axis]
    momentum = trace.truth("angular_momentum")[:, other]
    feet = 100.0 * (trace.feet - trace.truth("com")[:, None])
    placed = 100.0 * trace.signals["landing.feet.landing"]
    last = ticks.stop - 1
    times = trace.flight_times or (0.0, 0.0)
    numbers = {
        "flight_s": times[1] - times[0],
        "com_velocity_change_m_s": float(speed[after] - speed[before]),
        "angular_momentum_change_nms": float(momentum[after] - momentum[before]),
    }
    for name, foot in (("right", RIGHT), ("left", LEFT)):
        wanted = float(placed[last, foot, axis] - placed[before, foot, axis])
        numbers |= {
            f"{name}_foot_wanted_cm": wanted,
            f"{name}_foot_moved_cm": float(feet[last, foot, axis] - feet[before, foot, axis]),
        }
    return numbers
