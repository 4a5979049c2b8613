"""Plots of the signals of a run, for notebooks and files."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...plotting import Curve, Panel, panels_svg, save_panels
from ..language.quantities import Quantity
from ..language.selection import Selection, read_selection, select
from ..language.signals import Field
from ..language.stages import BlockSpec, CheckedGraph


class Timed(Protocol):
    """A run of which the values of some signals are known at every tick."""

    @property
    def time(self) -> NDArray[np.float64]:
        """The time of every tick [s], (ticks,)."""

    def signals(self) -> Collection[str]:
        """Return the names of the signals."""


class Logged(Timed, Protocol):
    """A run that kept every tick of its signals; see ``RunResult``."""

    @property
    def graph(self) -> CheckedGraph | None:
        """The graph that ran."""

    def signal(self, name: str) -> NDArray[Any]:
        """All values of ``block.output.field``, (ticks, ...)."""


AXES = ("x", "y", "z")


@dataclass(frozen=True)
class SignalPlot:
    """Panels over time, one below the other. A notebook shows it."""

    title: str
    panels: tuple[Panel, ...]

    def __repr__(self) -> str:
        return f"<SignalPlot of {', '.join(panel.title for panel in self.panels)}>"

    def _repr_svg_(self) -> str:
        return self.svg()

    def svg(self) -> str:
        """Return the text of an SVG file."""
        return panels_svg(self.panels, self.title)

    def save(self, path: str | Path) -> None:
        """Write the plot into a file, in the format of its ending: ``.svg`` or ``.png``.

        Raises:
            ValueError: it is another ending.
            OSError: the file cannot be written.
        """
        save_panels(self.panels, self.title, Path(path))


@dataclass(frozen=True)
class Legend:
    """Texts of a signal in a plot: its ``unit``, a name for each of its ``elements`` or none, the names of its
    ``rows`` if they have any, by which they can be selected, and those of its ``values``."""

    unit: str = ""
    elements: Sequence[str] = ()
    rows: Sequence[str] = ()
    values: Mapping[int, str] = field(default_factory=dict)


def panels_of(
    run: Timed,
    values: Callable[[str], NDArray[Any]],
    legend: Callable[[str, tuple[int, ...]], Legend],
    name: str,
    start: float | None,
    end: float | None,
) -> list[Panel]:
    """Make one panel for every field that ``name`` says, of a result or of a recording.

    Args:
        run: tells the time of every tick and the names of its signals.
        values: gives all values of a field, (ticks, ...).
        legend: gives the legend of a field by its name and shape.
        name: ``block.port.field``, ``block.port`` for all its fields, or some elements of either.
        start: from this time [s].
        end: up to this time [s].

    Raises:
        KeyError: there is no such signal; the message has the nearest names.
        ValueError: there is no such element, or nothing was recorded in that time.
    """
    time = run.time
    kept = np.ones(len(time), bool)
    kept &= time >= start if start is not None else True
    kept &= time <= end if end is not None else True
    if not kept.any():
        raise ValueError(nothing_between(start, end))
    source, selection = read_selection(name) or (name, Selection())
    base = f"{source}.{selection.field}" if selection.field else source
    known = run.signals()
    found = [base] if base in known else [n for n in known if n.rpartition(".")[0] == base]
    panels = []
    for each in found or [base]:
        kept_values = values(each)[kept]
        shape = kept_values.shape[1:]
        text = legend(each, shape)
        try:
            places = select(Selection("", selection.indices), shape, text.rows).reshape(-1)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
        flat = kept_values.reshape(len(kept_values), -1).astype(np.float64)
        labels = text.elements or [str(k) for k in range(flat.shape[1])]
        named = shape not in ((), (1,))  # the only element needs no name
        lines = [Curve(labels[k] if named else "", time[kept], flat[:, k]) for k in places.tolist()]
        title = f"{each} [{text.unit}]" if text.unit else each
        panels.append(Panel(title, lines, y_names=text.values))
    return panels


def plot_signals(
    run: Logged, names: Sequence[str], start: float | None, end: float | None
) -> SignalPlot:
    """Plot signals of a run that kept a log; see ``RunResult.plot``."""
    if not names:
        raise ValueError("name a signal to plot, such as 'block.output' or 'block.output.field'")
    graph = run.graph
    panels = [
        panel
        for name in names
        for panel in panels_of(run, run.signal, partial(_declared, graph), name, start, end)
    ]
    return SignalPlot(graph.name if graph is not None else "", tuple(panels))


def _declared(graph: CheckedGraph | None, name: str, shape: tuple[int, ...]) -> Legend:
    """Return the legend of a field. Of a result without its graph, as after pickling, only numbers are known."""
    numbers = [", ".join(map(str, place)) for place in np.ndindex(*shape)]
    path, _, rest = name.partition(".")
    spec = None if graph is None else next((s for s in graph.blocks if s.path == path), None)
    declared = None if spec is None else _field(spec, rest)
    if graph is None or spec is None or declared is None:
        return Legend("", numbers)
    values = {int(value): value.name.lower() for value in declared.values or ()}
    quantity = spec.quantities.get(rest) or Quantity(declared.unit)
    unit = "" if quantity.unit_text == "1" else quantity.unit_text
    if graph.robot is not None and declared.shape == ("n_joints",):
        joints = tuple(joint.name for joint in graph.robot.joints)
        return Legend(unit, joints, joints, values)
    axes = AXES if declared.shape == (3,) and declared.frame else numbers
    return Legend(unit, axes, (), values)


def _field(spec: BlockSpec, name: str) -> Field | None:
    """Return the declaration of ``port.field`` among a block's ports."""
    port, _, key = name.partition(".")
    found = {**spec.block_type.inputs, **spec.block_type.outputs}.get(port)
    return None if found is None else found.signal.fields.get(key)


def nothing_between(start: float | None, end: float | None) -> str:
    """Return what to say of a stretch of time without ticks, of which the ends may be open."""
    if start is None and end is None:
        return "nothing was recorded: there is no tick"
    if end is None:
        return f"nothing was recorded from {start:g} s on"
    if start is None:
        return f"nothing was recorded until {end:g} s"
    return f"nothing was recorded between {start:g} s and {end:g} s"
