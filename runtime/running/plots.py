"""Plots of the signals of a run, for notebooks and files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ...plotting import Curve, Panel, panels_svg, save_panels
from ..language.quantities import Quantity
from ..language.selection import Selection, read_selection, select
from ..language.signals import Field
from ..language.stages import BlockSpec, CheckedGraph


class Logged(Protocol):
    """A run that kept every tick of its signals; see ``RunResult``."""

    @property
    def graph(self) -> CheckedGraph | None:
        """The graph that ran."""

    @property
    def time(self) -> NDArray[np.float64]:
        """The time of every tick [s], (ticks,)."""

    def signals(self) -> tuple[str, ...]:
        """Return the names that ``signal`` knows."""

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


def plot_signals(
    run: Logged, names: Sequence[str], start: float | None, end: float | None
) -> SignalPlot:
    """Plot signals of a run that kept a log; see ``RunResult.plot``."""
    if not names:
        raise ValueError("name a signal to plot, such as 'block.output' or 'block.output.field'")
    time = run.time
    kept = np.ones(len(time), bool)
    kept &= time >= start if start is not None else True
    kept &= time <= end if end is not None else True
    if not kept.any():
        raise ValueError(nothing_between(start, end))
    panels = []
    for name in names:
        source, selection = read_selection(name) or (name, Selection())
        base = f"{source}.{selection.field}" if selection.field else source
        known = run.signals()
        found = [base] if base in known else [n for n in known if n.rpartition(".")[0] == base]
        for each in found or [base]:
            values = run.signal(each)[kept]
            shape = values.shape[1:]
            unit, labels, rows, y_names = _declared(run.graph, each, shape)
            try:
                places = select(Selection("", selection.indices), shape, rows).reshape(-1)
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from error
            flat = values.reshape(len(values), -1).astype(np.float64)
            lines = [
                Curve(labels[k] if shape else "", time[kept], flat[:, k]) for k in places.tolist()
            ]
            panels.append(Panel(f"{each} [{unit}]" if unit else each, lines, y_names=y_names))
    title = run.graph.name if run.graph is not None else ""
    return SignalPlot(title, tuple(panels))


def _declared(
    graph: CheckedGraph | None, name: str, shape: tuple[int, ...]
) -> tuple[str, list[str], tuple[str, ...], dict[int, str]]:
    """Return the unit of a field, the name of each of its elements, the names of its rows if they
    have any, and those of its values. Of a result without its graph, as after pickling, only numbers are known."""
    numbers = [", ".join(map(str, place)) for place in np.ndindex(*shape)]
    path, _, rest = name.partition(".")
    spec = None if graph is None else next((s for s in graph.blocks if s.path == path), None)
    field = None if spec is None else _field(spec, rest)
    if graph is None or spec is None or field is None:
        return "", numbers, (), {}
    values = {int(value): value.name.lower() for value in field.values or ()}
    quantity = spec.quantities.get(rest)
    quantity = quantity or Quantity(field.unit)
    text = "" if quantity.unit_text == "1" else quantity.unit_text
    if graph.robot is not None and field.shape == ("n_joints",):
        joints = tuple(joint.name for joint in graph.robot.joints)
        return text, list(joints), joints, values
    axes = list(AXES) if field.shape == (3,) and field.frame else numbers
    return text, axes, (), values


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
