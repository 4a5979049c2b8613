"""Poles over one parameter of a graph: the root locus of whatever the parameter changes.

At each value the graph is loaded, run up to the instant and linearised, so the operating point moves with the parameter. The
poles z of two neighbouring values are paired so that they move least in all (linear assignment), and are shown as
s = log(z) / period.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mathematics.arrays import Array
from ...runtime.graph import load
from ...runtime.language.errors import AloftError
from .linearisation import linearise

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DEADBEAT = 1e-4
"""Poles with a smaller |z| are those of delays; they have no place in the plane of s."""
DRIFT = 0.02
"""A mode that grows or fades by less than this [1/s] drifts: what an estimator learns, and a place that nothing measures."""
_RANGE = re.compile(
    r"\s*(?P<key>[^=\s]+)\s*=\s*(?P<low>[^:\s]+)\s*(?P<unit>[^:]*?)\s*:\s*(?P<high>\S+)\s*(?P<same>.*?)\s*$"
)


@dataclass(frozen=True)
class RootLocus:
    """Poles over a parameter.

    Attributes:
        parameter, unit: which, and the unit of its values.
        values: of the parameter, (n,).
        poles: z at each value, (n, poles), complex; a column is one pole that moves. Where models have
            fewer states than others the rest is zero.
        period: between two states of the models [s].
        limits: the values at which a mode begins to grow faster than ``DRIFT``, between neighbours interpolated.
    """

    parameter: str
    unit: str
    values: Array
    poles: Any
    period: float
    limits: tuple[float, ...]

    @property
    def leading(self) -> Any:
        """The largest pole at each value that is no drift, (n,); the largest of all where all are."""
        size = np.maximum(np.abs(self.poles), 1e-300)
        moves = np.abs(np.log(size)) / self.period > DRIFT
        chosen = np.where(moves | ~moves.any(axis=1, keepdims=True), size, 0.0).argmax(axis=1)
        return self.poles[np.arange(len(chosen)), chosen]

    @property
    def continuous(self) -> Any:
        """The poles s = log(z) / period [1/s], (n, poles); ``nan`` for those of delays."""
        tiny = np.abs(self.poles) < DEADBEAT
        found = np.log(np.where(tiny, 1.0, self.poles).astype(complex)) / self.period
        return np.where(tiny, np.nan, found)

    def as_data(self) -> dict[str, Any]:
        """Return all fields as plain data."""
        return {
            "parameter": self.parameter, "unit": self.unit, "values": self.values.tolist(),
            "poles": [[[float(p.real), float(p.imag)] for p in row] for row in self.poles],
            "period_s": self.period, "limits": list(self.limits),
        }  # fmt: skip


def root_locus(
    graph: str | Path,
    over: str,
    *,
    inputs: str | Sequence[str],
    outputs: str | Sequence[str],
    steps: int = 20,
    overrides: Sequence[str] | Mapping[str, Any] = (),
    at: float | None = None,
    when: str = "",
) -> RootLocus:
    """Return the poles between some signals of a graph over one parameter.

    Args:
        graph: the graph's file, or its text.
        over: the parameter and its range, ``pd.kp=10:200`` or ``robot.latency=0 ms:8 ms``.
        inputs, outputs, at, when: as for ``linearise``.
        steps: how many values, evenly spaced.
        overrides: of other parameters.

    Raises:
        AloftError: the range cannot be read, or as ``linearise``.
        LoadError: the graph may not run with one of the values.
    """
    match = _RANGE.match(over)
    try:
        assert match is not None and match["unit"] == match["same"]
        ends = float(match["low"]), float(match["high"])
    except (AssertionError, ValueError):
        raise AloftError(
            f"{over!r} is no range of a parameter; write block.parameter=1:10, or =0 ms:8 ms"
        ) from None
    if steps < 2:
        raise AloftError(f"a locus has at least 2 values, not {steps}")
    key, unit = match["key"], match["unit"]
    values = np.linspace(*ends, steps)
    others = overrides if isinstance(overrides, Mapping) else None
    models = []
    for value in values.tolist():
        text = f"{value:.12g} {unit}".strip()
        settings = (
            {**others, key: text if unit else value}
            if others is not None
            else [*overrides, f"{key}={text}"]
        )
        models.append(
            linearise(load(graph, settings), inputs=inputs, outputs=outputs, at=at, when=when)
        )
    most = max(len(model.a) for model in models)
    poles = np.array([np.pad(model.poles, (0, most - len(model.a))) for model in models]).astype(
        complex
    )
    period = models[0].period
    limits = tuple(_limits(values, poles, period))
    return RootLocus(key, unit, values, _traced(poles), period, limits)


def _traced(poles: Any) -> Any:
    """Return the same poles, in the order of those at the value before."""
    from scipy.optimize import linear_sum_assignment

    found = poles.copy()
    for k in range(1, len(found)):
        distance = np.abs(found[k - 1][:, None] - found[k])
        found[k] = found[k, linear_sum_assignment(distance)[1]]
    return found


def _limits(values: Array, poles: Any, period: float) -> list[float]:
    size = np.abs(poles).max(axis=1) - np.exp(DRIFT * period)
    found = []
    for k in np.flatnonzero((size[1:] > 0.0) != (size[:-1] > 0.0)).tolist():
        share = size[k] / (size[k] - size[k + 1])
        found.append(float(values[k] + share * (values[k + 1] - values[k])))
    return found


def locus_figure(found: RootLocus, title: str) -> Figure:
    """Return the poles in the plane of s, from open circles at the first value to crosses at the last."""
    from ...plotting import COLOURS, FAINT, new_figure

    figure = new_figure(6.0, 4.5, title)
    axes = figure.subplots()
    poles = found.continuous
    for k in range(poles.shape[1]):
        colour, line = COLOURS[k % len(COLOURS)], poles[:, k]
        axes.plot(line.real, line.imag, ".-", color=colour, markersize=2.5, linewidth=0.8)
        axes.plot(line.real[:1], line.imag[:1], "o", color=colour, fillstyle="none", markersize=5)
        axes.plot(line.real[-1:], line.imag[-1:], "x", color=colour, markersize=5)
    axes.axvline(0.0, color=FAINT, linewidth=0.7)
    ends = f"{found.values[0]:g} (o) to {found.values[-1]:g} (x) {found.unit}".strip()
    axes.set(
        xlabel=f"real part [1/s]; {found.parameter} from {ends}", ylabel="imaginary part [rad/s]"
    )
    return figure
