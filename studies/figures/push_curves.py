"""Push recovery in flight, as in the paper's figure: (a) along +x, (b) along +y."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...mathematics.arrays import Array
from ...plotting import COLOURS, Line, Panel, Shade
from .canvas import Column, draw_columns
from .trace import Trace, pitch_and_roll

if TYPE_CHECKING:
    from PIL.Image import Image


RIGHT, LEFT = 0, 1
"""The feet in the robot's description."""


def draw_push(arms: Mapping[str, Sequence[Trace]]) -> Image:
    """The figure with both directions, +x first, and a curve for every arm. Only the flight is shown."""
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
            f"{arm}: " + ", ".join("stood" if run.outcome.success else "fell" for run in found)
            for arm, found in arms.items()
        )
        + " (+x, +y of the seed shown)",
    ]
    return draw_columns("Push in flight: 70 N on the torso for 0.01 s", notes, columns)


def _column(header: str, axis: int, traces: Mapping[str, Trace]) -> Column:
    """``axis`` is 0 for a push along x, 1 along y."""
    other, letter, about = (1, "x", "y") if axis == 0 else (0, "y", "x")
    rows: list[list[Line]] = [[], [], [], [], []]
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
        rows[0].append(Line(arm, t, trace.truth("com_velocity")[ticks, axis], look))
        rows[1].append(Line(arm, t, trace.truth("angular_momentum")[ticks, other], look))
        if axis == 0:
            rows[2].append(Line(arm, t, placed[:, :, 0].mean(axis=1), look))
            rows[3].append(Line(arm, t, reached[:, :, 0].mean(axis=1), look))
        else:
            rows[2] += _feet(arm, t, placed, look)
            rows[3] += _feet(arm, t, reached, look)
        rows[4].append(Line(arm, t, tilt, look))
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


def _feet(arm: str, t: Array, places: Array, look: str) -> list[Line]:
    return [
        Line(arm, t, places[:, LEFT, 1], look),
        Line("", t, places[:, RIGHT, 1], look, dashed=True),
    ]


def _push(trace: Trace, flight: slice) -> list[Shade]:
    pushed = np.flatnonzero(np.abs(trace.signals["push.push.force"]).any(axis=1))
    if not len(pushed):
        return []
    lift_off, period = trace.time[flight.start], trace.time[1] - trace.time[0]
    start, end = trace.time[pushed[0]] - lift_off, trace.time[pushed[-1]] + period - lift_off
    return [Shade(1000.0 * float(start), 1000.0 * float(end), "push")]


def push_numbers(trace: Trace, axis: int) -> Mapping[str, float]:
    """What the push changed and how far the feet moved, by names that contain the units."""
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
