"""The pictures of a study: chooses the runs of each picture; the chart modules draw them.

``polar`` shows, for every line and angle, the largest radius up to which every success rate is at
least ``level``. ``lines`` shows the success rate or a metric over an axis. ``dots`` shows the same
with one row for each cell. Rates have Wilson's 95 % interval; metrics are medians with their 5 %
and 95 % quantiles. Runs that differ only on axes that a picture does not show are taken together.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ...runtime.language.errors import AloftError
from ...runtime.language.units import parse_unit
from ...runtime.loading.problems import listing, nearest
from ..confidence import wilson_interval
from ..execution import Run
from ..study import Axis, Plot, Study
from ..summary import Row, figures_of
from .dot_chart import Dot, dot_chart
from .line_panels import Point, line_panels
from .polar_chart import polar_chart

MOST_DOTS = 80


@dataclass
class Group:
    """Runs that give one point of a picture together."""

    n: int = 0
    successes: int = 0
    values: list[float] = field(default_factory=list)

    def point(self, x: float, of_rate: bool) -> Point | None:
        """The rate or the metric with its interval; ``None`` if no run has the metric."""
        if of_rate:
            low, high = wilson_interval(self.successes, self.n)
            return Point(x, self.successes / self.n, low, high)
        if not self.values:
            return None
        figures = figures_of(self.values)
        return Point(x, figures.median, figures.low, figures.high)


def group(runs: Sequence[Run], plot: Plot, axes: Sequence[str]) -> dict[tuple[str, ...], Group]:
    """The runs that the plot shows, by their labels on ``axes``."""
    groups: dict[tuple[str, ...], Group] = {}
    for run in runs:
        outcome = run.outcome
        if outcome is None or not plot.cells.takes(run.cell.labels):
            continue
        found = groups.setdefault(tuple(run.cell.labels[a] for a in axes), Group())
        found.n += 1
        found.successes += outcome.success
        value = outcome.metrics.get(plot.y)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            found.values.append(float(value))
    return groups


def draw_plot(study: Study, plot: Plot, runs: Sequence[Run], rows: Sequence[Row]) -> str:
    """The picture as SVG text.

    Raises:
        AloftError: no run has the metric that is to be shown, or the plot shows no run.
    """
    known = sorted({name for row in rows for name in row.metrics})
    if plot.y != "rate" and plot.y not in known:
        near = nearest(plot.y, known)
        hint = f"the nearest is {near[0]}" if near else f"there is {listing(known)}"
        raise AloftError(f"plot {plot.name!r}: no run has a metric {plot.y!r}; {hint}")
    if not any(plot.cells.takes(run.cell.labels) for run in runs):
        raise AloftError(f"plot {plot.name!r} shows no run")
    drawn = {"polar": _polar, "lines": _lines, "dots": _dots}[plot.kind]
    return drawn(study, plot, runs, rows)


def write_plots(
    study: Study, runs: Sequence[Run], rows: Sequence[Row], folder: Path
) -> tuple[dict[str, Path], list[str]]:
    """Draw all plots. Returns the files by the plots' names, and why other plots could not be drawn."""
    written: dict[str, Path] = {}
    problems = []
    for plot in study.plots:
        path = folder / (plot.name if plot.name.endswith(".svg") else f"{plot.name}.svg")
        try:
            path.write_text(draw_plot(study, plot, runs, rows), encoding="utf-8")
            written[plot.name] = path
        except AloftError as error:
            problems.append(str(error))
        except OSError as error:
            problems.append(f"cannot write {path}: {error.strerror or error}")
    return written, problems


def _values(study: Study, name: str) -> dict[str, float]:
    """The numbers of an axis by label."""
    axis = study.axis(name)
    assert axis is not None
    return {case.label: float(case.value) for case in axis.cases}


def _polar(study: Study, plot: Plot, runs: Sequence[Run], rows: Sequence[Row]) -> str:
    angle_axis, radius_axis = study.axis(plot.angle), study.axis(plot.radius)
    assert angle_axis is not None and radius_axis is not None
    groups = group(runs, plot, (plot.lines, plot.angle, plot.radius))
    angles, radii = _values(study, plot.angle), _values(study, plot.radius)
    scale = _radians(angle_axis)
    curves: dict[str, list[tuple[float, float]]] = {}
    for line in study.labels_of(plot.lines):
        for label, angle in angles.items():
            rates = {
                value: found.successes / found.n
                for radius, value in radii.items()
                if (found := groups.get((line, label, radius)))
            }
            if rates:
                reached = reach(rates, plot.level)
                curves.setdefault(line, []).append((angle * scale, reached))
    unit = f"{plot.radius} [{radius_axis.unit}]" if radius_axis.unit else plot.radius
    subtitle = (
        f"the largest {plot.radius} up to which at least {plot.level:.0%} of the runs succeed; "
        f"{plot.angle} from 0° (up) to the left"
    )
    rings = sorted(value for value in radii.values() if value > 0)
    return polar_chart(plot.title or study.title, subtitle, curves, rings, unit)


def reach(rates: dict[float, float], level: float) -> float:
    """The largest value up to which all rates are at least ``level``; 0 where none is."""
    good = list(itertools.takewhile(lambda v: rates[v] >= level - 1e-12, sorted(rates)))
    return good[-1] if good else 0.0


def _radians(axis: Axis) -> float:
    """The factor from an angle of the axis to radians; bare numbers are degrees."""
    unit = parse_unit(axis.unit or "deg")
    rad = parse_unit("rad")
    return unit.factor_to(rad) if unit.same_dimension(rad) else math.radians(1.0)


def _lines(study: Study, plot: Plot, runs: Sequence[Run], rows: Sequence[Row]) -> str:
    of_rate = plot.y == "rate"
    axes = (plot.lines, plot.x, *([plot.panels] if plot.panels else []))
    groups = group(runs, plot, axes)
    places = _values(study, plot.x)
    panels: dict[str, dict[str, list[Point]]] = {}
    for panel in study.labels_of(plot.panels) if plot.panels else ("",):
        for line in study.labels_of(plot.lines):
            keys = ((line, label, *([panel] if plot.panels else [])) for label in places)
            points = [
                point
                for key in keys
                if key in groups
                and (point := groups[key].point(places[key[1]], of_rate)) is not None
            ]
            if points:
                panels.setdefault(panel, {})[line] = points
    axis = study.axis(plot.x)
    unit = f" [{axis.unit}]" if axis and axis.unit else ""
    y_label = "runs that succeed" if of_rate else plot.y
    return line_panels(plot.title or study.title, f"{plot.x}{unit}", y_label, panels, share=of_rate)


def _dots(study: Study, plot: Plot, runs: Sequence[Run], rows: Sequence[Row]) -> str:
    of_rate = plot.y == "rate"
    dots = []
    axes = [a for a in study.axis_names if len(study.labels_of(a)) > 1] or ["task"]
    groups = group(runs, plot, axes)
    by_labels = {tuple(row.cell.labels[a] for a in axes): row for row in rows}
    for key, found in groups.items():
        point, row = found.point(0.0, of_rate), by_labels[key]
        if point is None:
            continue
        note = f"{found.successes}/{found.n}" if of_rate else f"{point.y:.3g}"
        goal, met = (row.goal, row.met) if of_rate else (None, None)
        dots.append(Dot(", ".join(key), point.y, point.low, point.high, note, goal, met))
    if len(dots) > MOST_DOTS:
        raise AloftError(f"plot {plot.name!r} has {len(dots)} lines; choose some with 'where'")
    label = "runs that succeed, with 95 % interval" if of_rate else plot.y
    return dot_chart(plot.title or study.title, label, dots, share=of_rate)
