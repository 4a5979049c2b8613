"""Push recovery in flight, as in the paper's figure: (a) along +x, (b) along +y."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..charts.svg import colour
from .canvas import PUSH, Column, Curve, Panel, Shade, draw_columns
from .trace import Trace, pitch_and_roll

if TYPE_CHECKING:
    from PIL.Image import Image

Array = NDArray[np.float64]

RIGHT, LEFT = 0, 1
"""The feet in the robot's description."""


def draw_push(arms: Mapping[str, Sequence[Trace]]) -> Image:
    """Both directions, +x first, with a curve for every arm; only the flight is shown."""
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
        look = colour(number)
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
        Panel(
            title, named if k == 0 else [unnamed(c) for c in named], (0.0, longest or 1.0), shades
        )
        for k, (title, named) in enumerate(zip(titles, rows, strict=True))
    ]
    return Column(header, panels, "time since lift-off [ms]")


def _feet(arm: str, t: Array, places: Array, look: str) -> list[Curve]:
    return [
        Curve(arm, t, places[:, LEFT, 1], look),
        Curve("", t, places[:, RIGHT, 1], look, True),
    ]


def unnamed(curve: Curve) -> Curve:
    """The same without an entry in the legend."""
    return Curve("", curve.x, curve.y, curve.colour, curve.dashed)


def _push(trace: Trace, flight: slice) -> list[Shade]:
    pushed = np.flatnonzero(np.abs(trace.signals["push.push.force"]).any(axis=1))
    if not len(pushed):
        return []
    lift_off, period = trace.time[flight.start], trace.time[1] - trace.time[0]
    start, end = trace.time[pushed[0]] - lift_off, trace.time[pushed[-1]] + period - lift_off
    return [Shade(1000.0 * float(start), 1000.0 * float(end), PUSH)]


def push_numbers(trace: Trace, axis: int) -> Mapping[str, float]:
    """What the push changed, and how far the feet went, by names with units in them."""
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
