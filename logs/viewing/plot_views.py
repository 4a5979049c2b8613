"""The plots of signals over time with their limits, laid out from the graph.

A plot shows one field with its limits, several fields of one unit, or the same field of two runs.
Its
title has the name and the unit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..file.format import LIMITS, SIGNALS, Header, RecordedField, entity_of
from .contacts import FOOT_FORCE, RANGE, WEIGHT
from .scene_ports import ScenePorts, block_of, ports_of
from .signal_names import AXES, element_names, unit_of


def limits_of(field: RecordedField, header: Header) -> list[tuple[str, float]]:
    """Return the limits of a field's elements, each with its name; equal ones are given once.

    Joint angles have the joints' limits, where these have any. Motor torques and speeds have the
    limits of the actuator profile in use. Joint torques have what these motors give at most
    through the transmission.
    """
    robot = header.robot
    if robot is None or "n_joints" not in field.dimensions or not robot.joints:
        return []
    if field.unit == "rad":
        return _once(
            (f"{joint.name} {side}", value)
            for joint in robot.joints
            for side, value in zip(("least", "most"), joint.limits or (), strict=False)
        )
    motors, of_motor = robot.motors, "motor" in field.field_name
    if field.unit == "N m" and of_motor:
        return _both("peak torque", motors.peak_torque.tolist())
    if field.unit == "N m":
        peaks = np.abs(robot.joint_to_motor.T) @ motors.peak_torque
        return _both("peak torque", peaks.tolist())
    if field.unit == "rad/s" and of_motor:
        return _both("no-load speed", motors.no_load_speed.tolist())
    return []


def _both(name: str, values: list[float]) -> list[tuple[str, float]]:
    """Return each value with both signs."""
    signed = (
        (f"{sign}{name}", factor * v) for v in values for sign, factor in (("+", 1), ("-", -1))
    )
    return _once(signed)


def _once(named: Iterable[tuple[str, float]]) -> list[tuple[str, float]]:
    """Return each value once, with the name it had first. What is not finite limits nothing."""
    found: dict[float, tuple[str, float]] = {}
    for name, value in named:
        if np.isfinite(value):
            found.setdefault(round(value, 9), (name, value))
    return list(found.values())


MAIN_FIELDS = ("motor_torque", "motor_speed")
"""Fields of the port that poses the robot, in the first tab beside centre of mass, base and feet.
"""
MOST_IN_LEGEND = 4
"""A legend with more lines than this hides the curves, so it is hidden: the pointer on a curve shows
its name."""
MOST_IN_TAB = 6
"""More plots than this in one tab would be too low to read."""
MOST_PLOTS = 6
"""Shown first of a graph without a robot."""
FEET = "vertical force on each foot"
OTHER = np.array([0xFFA726FF, 0xC0CA33FF, 0x26C6DAFF], np.uint32)
"""x, y and z of what lies over the true values: an estimate, the other run."""
DARK = np.array([0x8E3B38FF, 0x3E6B40FF, 0x2B628EFF], np.uint32)
"""x, y and z of a plan, below the true values."""

EVERY_VALUE = "Off"
"""Rerun's summary of neighbouring values in a plot: none, because a mean over a touchdown halves
the peak of a force, and shows one in the flight before it."""


@dataclass(frozen=True)
class ShownRun:
    """A run in the stream: the ``root`` of its entities and, if there are several, its ``label``."""

    root: str = ""
    label: str = ""


@dataclass(frozen=True)
class PlotLine:
    """A field in a plot; ``label`` says what it is beside the others, ``colors`` are of x, y, z."""

    field: RecordedField
    label: str = ""
    colors: NDArray[np.uint32] | None = None


def plot(header: Header, name: str, lines: Sequence[PlotLine], shown: Sequence[ShownRun]) -> Any:
    """Make one plot of several fields of the same unit, for all runs."""
    import rerun.blueprint as rrb

    if len(shown) > 1 and len(lines) > 1:
        lines = lines[:1]  # of several runs only what is true, or else nobody could tell them apart
    first = lines[0].field
    unit = f" [{found}]" if (found := unit_of(first)) else ""
    frame = f", {first.frame}" if first.frame else ""
    entities, overrides = [], {}
    for k, run in enumerate(shown):
        for line in lines:
            entity = run.root + entity_of(SIGNALS, line.field.name)
            entities.append(entity)
            label = run.label or line.label
            if label:
                overrides[entity] = _series(header, line, label, other=k > 0)
    if limits_of(first, header):
        entities.append(shown[0].root + entity_of(LIMITS, first.name))
    count = sum(len(element_names(line.field, header.robot)) for line in lines) * len(shown)
    return rrb.TimeSeriesView(
        origin="/",
        contents=entities,
        name=f"{name}{unit}{frame}{looks(lines, shown)}",
        overrides=overrides or None,
        plot_legend=legend(count),
    )


def legend(count: int) -> Any:
    """Return the legend of a plot: in a corner, or none where there are too many lines."""
    import rerun.blueprint as rrb

    return rrb.PlotLegend("RightTop", visible=1 < count <= MOST_IN_LEGEND)


def looks(lines: Sequence[PlotLine], shown: Sequence[ShownRun]) -> str:
    """Describe lines that lie over one another in the plot's title, in place of a legend."""
    if len(shown) > 1:
        return f" · bold {shown[0].label}, thin {shown[1].label}"
    how = {"estimated": "bright: estimated", "planned": "dark: planned"}
    told = [how[line.label] for line in lines if line.label in how]
    if told and lines[0].field.shape == (3,):
        told.insert(0, "xyz: RGB")
    return f" · {', '.join(told)}" if told else ""


def feet_plot(header: Header, shown: Sequence[ShownRun]) -> Any:
    """Plot the vertical force on each foot, in a range that shows the stance."""
    import rerun as rr
    import rerun.blueprint as rrb

    assert header.robot is not None
    names, weight = [foot.name for foot in header.robot.feet], header.robot.weight
    overrides = {}
    for run in shown[1:]:
        thin = rr.SeriesLines(
            names=[f"{run.label} {name}" for name in names],
            widths=[0.75] * len(names),
            aggregation_policy=EVERY_VALUE,
        )
        overrides[f"{run.root}{FOOT_FORCE}"] = thin
    return rrb.TimeSeriesView(
        origin="/",
        contents=[f"{run.root}{FOOT_FORCE}" for run in shown] + [f"{shown[0].root}{WEIGHT}"],
        name=f"{FEET} [N]{looks((), shown)}",
        axis_y=rrb.ScalarAxis(range=(RANGE[0] * weight, RANGE[1] * weight)),
        overrides=overrides or None,
        plot_legend=legend(len(names) * len(shown) + 1),
    )


def _series(header: Header, line: PlotLine, label: str, *, other: bool) -> Any:
    """Return the legend of a field that shares its plot with others."""
    import rerun as rr

    names = [f"{label} {name}" for name in element_names(line.field, header.robot)]
    colors = None
    if line.field.shape == (3,):
        colors = OTHER if other else AXES if line.colors is None else line.colors
    widths = [1.0 if other or line.label in ("estimated", "planned") else 2.0] * len(names)
    return rr.SeriesLines(names=names, colors=colors, widths=widths, aggregation_policy=EVERY_VALUE)


def main_plots(header: Header, ports: ScenePorts | None, shown: Sequence[ShownRun]) -> list[Any]:
    """Return the plots that are shown first.

    They show the robot's true, estimated and planned motion, forces and motors. For a graph without a
    robot they show the first signals of its own blocks."""
    return [
        feet_plot(header, shown) if name == FEET else plot(header, name, lines, shown)
        for name, lines in main_lines(header, ports)
    ]


def main_fields(header: Header, ports: ScenePorts | None) -> list[RecordedField]:
    """Return the fields in the plots that are shown first."""
    return [line.field for _, lines in main_lines(header, ports) for line in lines]


def main_lines(header: Header, ports: ScenePorts | None) -> list[tuple[str, list[PlotLine]]]:
    """Name and lines of each plot that is shown first; ``FEET`` has none of a field."""
    fields = {field.name: field for field in header.bus.fields if not field.constant}
    if ports is None:
        own = [field for name, field in fields.items() if "~" not in name]
        return [(field.name, [PlotLine(field)]) for field in own[:MOST_PLOTS]]
    pose = ports.pose.block
    velocity = next(
        (n for end in ("base_linear_velocity", "linear_velocity")
         if (n := f"{pose}.{end}") in fields),
        "",
    )  # fmt: skip
    base = ports.pose.base_position or ""
    estimate = (ports.estimate.base_position or "") if ports.estimate else ""
    overlays = (
        ("centre of mass", ports.com or "", "", f"{ports.plan}.com"),
        ("base", base, estimate, ""),
        ("velocity of the base", velocity, f"{block_of(estimate)}.linear_velocity", ""),
    )
    plots: list[tuple[str, list[PlotLine]]] = []
    for name, actual, guess, plan in overlays:
        known = (("planned", plan, DARK), ("", actual, AXES), ("estimated", guess, OTHER))
        lines = [PlotLine(fields[n], label, c) for label, n, c in known if n in fields]
        if lines:
            lines.sort(key=lambda line: line.label != "")  # the true one first: it names the unit
            plots.append((name, [_named(line) for line in lines]))
    if ports.contact_force is not None and header.robot is not None and header.robot.feet:
        plots.append((FEET, []))
    names = [f"{pose}.{field}" for field in MAIN_FIELDS]
    plots += [(name, [PlotLine(fields[name])]) for name in names if name in fields]
    return plots


def _named(line: PlotLine) -> PlotLine:
    return line if line.label else PlotLine(line.field, "true", line.colors)


def block_tabs(header: Header, shown: Sequence[ShownRun]) -> list[Any]:
    """Make one tab a block, in it all its signals but for large matrices.

    A block with more plots than fit has a tab in its tab for each port, or for each few plots.
    """
    import rerun.blueprint as rrb

    blocks: dict[str, dict[str, list[Any]]] = {}
    for port, fields in ports_of(header).items():
        for field in fields.values():
            if len(element_names(field, header.robot)):
                short = port.rpartition(".")[2]
                view = plot(header, f"{short}.{field.field_name}", [PlotLine(field)], shown)
                blocks.setdefault(block_of(port), {}).setdefault(short, []).append(view)
    tabs = []
    for block, ports in blocks.items():
        views = [view for each in ports.values() for view in each]
        if len(views) <= MOST_IN_TAB:
            tabs.append(_grid(views, block))
        else:
            pages = [page for port, each in ports.items() for page in _pages(each, port)]
            tabs.append(rrb.Tabs(*pages, name=block, active_tab=0))
    return tabs


def _pages(views: Sequence[Any], name: str) -> list[Any]:
    """Split the views into as many grids as are needed, of about equal size."""
    count = -(-len(views) // MOST_IN_TAB)
    parts = [views[k * len(views) // count : (k + 1) * len(views) // count] for k in range(count)]
    if count == 1:
        return [_grid(views, name)]
    return [_grid(part, f"{name} {k + 1} of {count}") for k, part in enumerate(parts)]


def _grid(views: Sequence[Any], name: str) -> Any:
    import rerun.blueprint as rrb

    return rrb.Grid(*views, grid_columns=2 if len(views) > 3 else 1, name=name)
