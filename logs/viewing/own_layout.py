"""The layout of the viewer that a user writes: ``view.yaml`` beside a graph, or any file for ``--layout``::

    follow: false                        # the camera stays where it is
    tabs:
      - name: Balance
        plots:
          - robot.truth.com              # a signal
          - title: both velocities       # several of the same unit
            signals: [estimator.base.linear_velocity, robot.truth.base_linear_velocity]
            range: [-1, 2]
            legend: true

Its tabs come before those that the viewer makes from the graph. It changes what is shown only: it is
read when a recording is looked at, not when it is made.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field

from ...files.problems import Code, LoadError, Problems, nearest
from ...files.validation import location_of, path_text, read_model
from ..file.format import SIGNALS, Header, RecordedField, entity_of
from .blueprint import recording_blueprint
from .plot_views import MOST_IN_TAB, legend
from .signal_names import element_names, unit_of

FILE_NAME = "view.yaml"


class LayoutError(LoadError):
    """A layout that cannot be used; the text reports every mistake at its place."""


class PlotEntry(BaseModel):
    """A plot: its title, its signals, the range of its axis, and whether it has a legend."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    signals: tuple[str, ...] = Field(min_length=1)
    title: str = ""
    range: tuple[float, float] | None = None
    legend: bool | None = None


class TabEntry(BaseModel):
    """A tab with plots; a plot may be just the name of a signal."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    plots: tuple[str | PlotEntry, ...] = Field(min_length=1, max_length=3 * MOST_IN_TAB)


class ViewLayout(BaseModel):
    """The contents of a layout file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    follow: bool = True
    tabs: tuple[TabEntry, ...] = ()


def layout_beside(header: Header) -> Path | None:
    """Find the file ``view.yaml`` beside the graph file of a run."""
    path = Path(header.source).parent / FILE_NAME
    return path if header.source and path.is_file() else None


def read_layout(path: Path, header: Header) -> ViewLayout:
    """Read the layout in a file.

    Raises:
        LayoutError: the file cannot be read or has faults; the message names all, with their places.
    """
    problems = Problems()
    layout, tree = read_model(
        path, ViewLayout, problems, ("a layout", "follow, tabs"), may_be_empty=True
    )
    if layout is not None and tree is not None:
        for at, message, near in _unknown_signals(layout, header):
            problems.add(
                Code.UNKNOWN_SOURCE if near else Code.BAD_VALUE, message, location_of(tree, at),
                at=path_text(at), nearest=near, fix=near[0] if near else "",
            )  # fmt: skip
    if len(problems) or layout is None:
        raise LayoutError(problems.report(str(path)))
    return layout


def _unknown_signals(
    layout: ViewLayout, header: Header
) -> Iterator[tuple[tuple[str | int, ...], str, tuple[str, ...]]]:
    """Yield signals that the run has not, that are too large to be drawn, or of another unit, each
    with the names nearest to it."""
    fields = _fields(header)
    for i, tab in enumerate(layout.tabs):
        for j, plot in enumerate(tab.plots):
            at: tuple[str | int, ...] = ("tabs", i, "plots", j)
            names = (plot,) if isinstance(plot, str) else plot.signals
            units: dict[str, str] = {}
            for k, name in enumerate(names):
                here = at if isinstance(plot, str) else (*at, "signals", k)
                if name not in fields:
                    yield here, f"no signal {name!r}", nearest(name, fields, cutoff=0.0)
                elif not element_names(fields[name], header.robot):
                    yield here, f"{name} has too many elements for a plot", ()
                else:
                    units[unit_of(fields[name])] = name
            if len(units) > 1:
                told = " and ".join(f"{name} [{unit}]" for unit, name in units.items())
                yield at, f"one plot has one unit, but these have two: {told}", ()


def _fields(header: Header) -> dict[str, RecordedField]:
    return {field.name: field for field in header.bus.fields if not field.constant}


def blueprint_with(layout: ViewLayout, header: Header) -> Any:
    """Return the usual layout of a run, with a user's own tabs first."""
    import rerun.blueprint as rrb

    fields = _fields(header)
    tabs = []
    for tab in layout.tabs:
        views = [_view(plot, fields, header) for plot in tab.plots]
        tabs.append(rrb.Grid(*views, grid_columns=2 if len(views) > 3 else 1, name=tab.name))
    return recording_blueprint(header, first_tabs=tabs, follow=layout.follow)


def _view(entry: str | PlotEntry, fields: dict[str, RecordedField], header: Header) -> Any:
    import rerun.blueprint as rrb

    plot = PlotEntry(signals=(entry,)) if isinstance(entry, str) else entry
    chosen = [fields[name] for name in plot.signals]
    unit = f" [{found}]" if (found := unit_of(chosen[0])) else ""
    shown = legend(sum(len(element_names(field, header.robot)) for field in chosen))
    if plot.legend is not None:
        shown = rrb.PlotLegend("RightTop", visible=plot.legend)
    return rrb.TimeSeriesView(
        origin="/",
        contents=[entity_of(SIGNALS, name) for name in plot.signals],
        name=f"{plot.title or ', '.join(plot.signals)}{unit}",
        axis_y=rrb.ScalarAxis(range=plot.range) if plot.range else None,
        plot_legend=shown,
    )
