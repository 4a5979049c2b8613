"""The pictures of a study: chooses the runs of each picture; the chart modules draw them.

``polar`` shows, for every line and angle, the largest radius up to which every success rate is at
least ``level``. ``lines`` shows the success rate or a metric over an axis. ``dots`` shows the same
with one row for each cell. Rates have Wilson's 95 % interval; metrics are medians with their 5 %
and 95 % quantiles. Runs that differ only on axes that a picture does not show are taken together.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from ..files.problems import listing, nearest
from ..plotting import COLOURS, FAINT, INK, label_ends, look, new_figure, style, svg_text
from ..runtime.language.errors import AloftError
from ..runtime.language.units import parse_unit
from .execution import Run
from .study import Axis, Plot, Study
from .summary import StudyRow, figures_of, wilson_interval

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MOST_DOTS = 80


@dataclass
class Group:
    """Runs that give one point of a picture together."""

    n: int = 0
    successes: int = 0
    values: list[float] = field(default_factory=list)

    def point(self, x: float, of_rate: bool) -> Point | None:
        """Return the rate or the metric with its interval; ``None`` if no run has the metric."""
        if of_rate:
            low, high = wilson_interval(self.successes, self.n)
            return Point(x, self.successes / self.n, low, high)
        if not self.values:
            return None
        figures = figures_of(self.values)
        return Point(x, figures.median, figures.low, figures.high)


def group(runs: Sequence[Run], plot: Plot, axes: Sequence[str]) -> dict[tuple[str, ...], Group]:
    """Group the runs that the plot shows by their labels on ``axes``."""
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


def draw_plot(study: Study, plot: Plot, runs: Sequence[Run], rows: Sequence[StudyRow]) -> str:
    """Draw the picture as SVG text.

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
    study: Study, runs: Sequence[Run], rows: Sequence[StudyRow], folder: Path
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
    """Return the numbers of an axis by label."""
    axis = study.axis(name)
    assert axis is not None
    return {case.label: float(case.value) for case in axis.cases}


def _polar(study: Study, plot: Plot, runs: Sequence[Run], rows: Sequence[StudyRow]) -> str:
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
    """Return the largest value up to which all rates are at least ``level``; 0 where none is."""
    good = list(itertools.takewhile(lambda v: rates[v] >= level - 1e-12, sorted(rates)))
    return good[-1] if good else 0.0


def _radians(axis: Axis) -> float:
    """Return the factor from an angle of the axis to radians; bare numbers are degrees."""
    unit = parse_unit(axis.unit or "deg")
    rad = parse_unit("rad")
    return unit.factor_to(rad) if unit.same_dimension(rad) else math.radians(1.0)


def _lines(study: Study, plot: Plot, runs: Sequence[Run], rows: Sequence[StudyRow]) -> str:
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


def _dots(study: Study, plot: Plot, runs: Sequence[Run], rows: Sequence[StudyRow]) -> str:
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


MET, MISSED, PLAIN = COLOURS[2], COLOURS[1], COLOURS[0]
"""The colours of a dot whose goal is met, whose goal is missed, and that has no goal."""


@dataclass(frozen=True)
class Dot:
    """One row of the chart.

    Attributes:
        name: what is written at the left.
        value: where the dot is.
        low, high: the ends of its interval.
        note: what is written at the right.
        goal: where the mark of the goal is; ``None`` for no goal.
        met: whether the goal is met.
    """

    name: str
    value: float
    low: float
    high: float
    note: str = ""
    goal: float | None = None
    met: bool | None = None


def dot_chart(title: str, x_label: str, dots: Sequence[Dot], *, share: bool = False) -> str:
    """Draw the chart as SVG text, the first dot at the top.

    With ``share`` the values are shares, and the axis goes from 0 to 100 %.
    """
    from matplotlib.ticker import PercentFormatter

    letters = max((len(dot.name) for dot in dots), default=0)
    notes = max((len(dot.note) for dot in dots), default=0)
    width = max(4.8 + 0.075 * (letters + notes), 0.6 + 0.105 * len(title))
    with style():
        figure = new_figure(width, 1.1 + 0.26 * max(len(dots), 1), title)
        axes = figure.add_subplot()
        axes.grid(axis="y", visible=False)
        for row, dot in enumerate(dots):
            colour = {True: MET, False: MISSED, None: PLAIN}[dot.met]
            axes.plot(
                [dot.low, dot.high], [row, row], color=colour, alpha=0.45, linewidth=3,
                solid_capstyle="round", gid=f"interval-{row}",
            )  # fmt: skip
            if dot.goal is not None:
                axes.plot(
                    dot.goal, row, "|", color=INK, markersize=13, markeredgewidth=1.4, clip_on=False
                )
            axes.plot(
                dot.value, row, "o", color=colour, markersize=6.5, markeredgecolor="white",
                clip_on=False, gid=f"dot-{row}",
            )  # fmt: skip
            axes.annotate(
                dot.note, (1.0, row), (8, 0), xycoords=axes.get_yaxis_transform(),
                textcoords="offset points", va="center", fontsize=8, color=FAINT,
            )  # fmt: skip
        axes.set_yticks(range(len(dots)), [dot.name for dot in dots], color=INK)
        axes.tick_params(axis="y", length=0)
        axes.spines["left"].set_visible(False)
        axes.set_ylim(len(dots) - 0.4, -0.6)
        axes.set_xlabel(x_label)
        if share:
            axes.set_xlim(0.0, 1.0)
            axes.xaxis.set_major_formatter(PercentFormatter(1.0, 0))
        else:
            axes.margins(x=0.05)
            _, high = axes.get_xlim()
            if 0.0 <= min((dot.low for dot in dots), default=1.0) < 0.3 * high:
                axes.set_xlim(0.0, high)
        return svg_text(figure)


MOST_COLUMNS = 4
MOST_BANDS = 3
"""Largest number of lines with bands; for more, intervals are whiskers side by side, because bands
would hide each other."""


@dataclass(frozen=True)
class Point:
    """A value with its interval from ``low`` to ``high``."""

    x: float
    y: float
    low: float
    high: float


Panels = Mapping[str, Mapping[str, Sequence[Point]]]
"""Points by the name of the panel and the name of the line."""


def line_panels(
    title: str, x_label: str, y_label: str, panels: Panels, *, share: bool = False
) -> str:
    """Draw the chart as SVG text. With ``share`` y is a share, and its axis goes from 0 to 100 %."""
    from matplotlib.ticker import PercentFormatter

    names = list(dict.fromkeys(name for lines in panels.values() for name in lines))
    columns = min(len(panels), 3 if len(panels) == 5 else MOST_COLUMNS) or 1
    rows = math.ceil(len(panels) / columns) or 1
    width = 0.9 + 2.9 * columns + 0.085 * max((len(name) for name in names), default=0)
    with style():
        figure = new_figure(
            max(width, 0.6 + 0.105 * len(title)), 0.9 + (3.0 if rows == 1 else 2.4) * rows, title
        )
        grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
        for number, axes in enumerate(grid.flat):
            axes.set_visible(number < len(panels))
        for number, (axes, (panel, lines)) in enumerate(
            zip(grid.flat, panels.items(), strict=False)
        ):
            for line, points in lines.items():
                _draw_line(axes, names.index(line), points, len(names), f"panel-{number}")
            axes.set_title(panel, fontweight="bold")
            axes.tick_params(labelbottom=number + columns >= len(panels))
        figure.supxlabel(x_label, fontsize=9)
        figure.supylabel(y_label, fontsize=9)
        if share:
            grid[0, 0].set_ylim(-0.02, 1.02)
            grid[0, 0].yaxis.set_major_formatter(PercentFormatter(1.0, 0))
        if len(names) > 1 and len(panels) == 1:
            _label(grid[0, 0], next(iter(panels.values())), names)
        elif len(names) > 1:
            handles = [
                grid[0, 0].plot([], [], marker="o", markersize=4, **look(number))[0]
                for number in range(len(names))
            ]
            figure.legend(handles, names, loc="outside right upper")
        return svg_text(figure)


def _draw_line(axes: Axes, number: int, points: Sequence[Point], lines: int, panel: str) -> None:
    """Draw one line with its dots and its intervals."""
    from matplotlib.transforms import ScaledTranslation

    ordered = sorted(points, key=lambda point: point.x)
    x, y = [point.x for point in ordered], [point.y for point in ordered]
    low, high = [point.low for point in ordered], [point.high for point in ordered]
    colour = look(number)["color"]
    if lines <= MOST_BANDS:
        axes.fill_between(x, low, high, color=colour, alpha=0.13, linewidth=0)
    else:
        figure = axes.get_figure(root=True)
        assert figure is not None
        aside = ScaledTranslation(
            1.8 * (number - 0.5 * (lines - 1)) / 72.0, 0.0, figure.dpi_scale_trans
        )
        axes.vlines(
            x, low, high, color=colour, alpha=0.45, linewidth=1.0, transform=axes.transData + aside
        )
    axes.plot(
        x, y, marker="o", markersize=4.5, markeredgecolor="white", markeredgewidth=0.7,
        gid=f"{panel}-line-{number}", **look(number),
    )  # fmt: skip


def _label(axes: Axes, lines: Mapping[str, Sequence[Point]], names: Sequence[str]) -> None:
    """Write the lines' names at their right ends."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    label_ends(
        axes,
        [
            (name, max(points, key=lambda point: point.x).y, COLOURS[names.index(name) % 8])
            for name, points in lines.items()
        ],
    )


MOST_FILLED = 3
"""Largest number of filled curves; more are not filled but turned a little against one another,
because they would hide each other."""
TURN = math.radians(1.0)
"""The angle between neighbours among many curves [rad]."""


def polar_chart(
    title: str,
    subtitle: str,
    curves: Mapping[str, Sequence[tuple[float, float]]],
    rings: Sequence[float],
    unit: str,
) -> str:
    """Draw the chart as SVG text.

    Args:
        title: stands on top.
        subtitle: stands below it.
        curves: points (angle [rad], radius) by the curve's name. Angle zero is up, and angles grow
            to the left, as seen from above. A curve whose angles go once around is closed.
        rings: the radii that are drawn and labelled; the largest one is the edge.
        unit: what the radius is, with its unit.
    """
    edge = max(rings, default=1.0)
    letters = max((len(name) for name in curves), default=0)
    width = max(6.0 + 0.085 * letters, 0.6 + 0.105 * len(title), 0.6 + 0.08 * len(subtitle))
    with style():
        figure = new_figure(width, 6.2, f"{title}\n")
        figure.text(0.01, 1.0 - 0.42 / 6.2, subtitle, color=FAINT, va="center")
        axes = figure.add_subplot(projection="polar")
        axes.set_theta_zero_location("N")
        axes.set_theta_direction(1)
        axes.set_thetagrids(range(0, 360, 45))
        axes.set_ylim(0.0, edge)
        axes.set_rgrids(
            rings, [f"{ring:g}" for ring in rings], angle=-22.5, fontsize=8, color=FAINT,
            ha="center", va="center",
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"},
        )  # fmt: skip
        axes.text(math.radians(-22.5), 1.1 * edge, unit, color=FAINT, fontsize=8, ha="left")
        for number, (name, points) in enumerate(curves.items()):
            ordered = sorted(points)
            closed = goes_around([angle for angle, _ in ordered])
            if closed:
                ordered.append(ordered[0])
            aside = 0.0
            if len(curves) > MOST_FILLED:
                aside = TURN * (number - 0.5 * (len(curves) - 1))
            angles = [angle + aside for angle, _ in ordered]
            radii = [radius for _, radius in ordered]
            if closed and len(curves) <= MOST_FILLED:
                axes.fill(angles, radii, color=look(number)["color"], alpha=0.06, linewidth=0)
            axes.plot(
                angles, radii, marker="o", markersize=4.5, markeredgecolor="white", clip_on=False,
                markeredgewidth=0.7, label=name, gid=f"line-{number}", **look(number),
            )  # fmt: skip
        figure.legend(loc="outside right center")
        return svg_text(figure)


def goes_around(angles: Sequence[float]) -> bool:
    """Tell whether no two neighbours of the sorted angles [rad] are more than a quarter turn apart."""
    if len(angles) < 3:
        return False
    around = [*angles, angles[0] + 2 * math.pi]
    return max(b - a for a, b in pairwise(around)) <= math.pi / 2 + 1e-9
