"""Sensitivity of a metric to the parameters of a graph: elementary effects of all, Sobol indices of
some.

A trajectory begins somewhere in the ranges and changes one parameter after the other; each change gives one
elementary effect, dy over the share of the range. The mean of their sizes ranks the parameters, and their spread shows
what depends on the others (Morris, Factorial Sampling Plans, Technometrics 33, 1991; Campolongo, Cariboni and
Saltelli, Environmental Modelling and Software 22, 2007). Sobol's first and total indices are the shares of the
variance that a parameter explains alone, and with all others (Saltelli et al., Variance Based Sensitivity Analysis of
Model Output, Computer Physics Communications 181, 2010). Both are computed by SALib.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from ....files.pip_line import pip_line
from ....files.problems import LoadError, Position, listing, nearest
from ....files.validation import unit_of
from ....mathematics.arrays import Array
from ....plotting import COLOURS, FAINT, image, new_figure, style, svg_text
from ....runtime.language.errors import AloftError
from ....runtime.language.parameters import given_values
from ....studies.execution import Run
from ....studies.expansion import Cell, load_cell
from ....studies.tuning import Make, draw_runs

Evaluate = Callable[[Array], Array]
"""The metric at points, (n, parameters) to (n,)."""
MOST_BARS = 20
DIGITS = 12
"""Digits of the values that are run, so that a run is the same on every machine."""


@dataclass(frozen=True)
class Varied:
    """A parameter and its range."""

    key: str
    low: float
    high: float
    unit: str = ""


@dataclass(frozen=True)
class Effect:
    """The effect of a parameter on the metric over its range.

    Attributes:
        key: the parameter.
        mean_size: mean size of its elementary effects, mu*, with half its 95 % interval.
        mean, spread: their mean and standard deviation.
        first, total: Sobol's indices with half their 95 % intervals; ``None`` where not asked for.
    """

    key: str
    mean_size: float
    mean_size_interval: float
    mean: float
    spread: float
    first: float | None = None
    first_interval: float | None = None
    total: float | None = None
    total_interval: float | None = None


def import_salib() -> Any:
    """Import the package SALib. Raises ``AloftError`` where it is not installed."""
    try:
        import SALib
        import SALib.analyze.morris
        import SALib.analyze.sobol
        import SALib.sample.morris
        import SALib.sample.sobol
    except ImportError as error:
        raise AloftError(
            f"SALib is not installed; install it with: {pip_line('analysis')}"
        ) from error
    return SALib


def elementary_effects(
    varied: Sequence[Varied], evaluate: Evaluate, trajectories: int, seed: int
) -> list[Effect]:
    """Compute the effects of all parameters, the largest first."""
    salib, problem = import_salib(), _problem(varied)
    points = salib.sample.morris.sample(problem, trajectories, num_levels=4, seed=seed)
    found = salib.analyze.morris.analyze(problem, points, evaluate(points), num_levels=4, seed=seed)
    rows = zip(found["mu_star"], found["mu_star_conf"], found["mu"], found["sigma"], strict=True)
    effects = [Effect(v.key, *map(float, row)) for v, row in zip(varied, rows, strict=True)]
    return sorted(effects, key=lambda each: -each.mean_size)


def sobol_indices(
    varied: Sequence[Varied], evaluate: Evaluate, samples: int, seed: int
) -> dict[str, tuple[float, float, float, float]]:
    """Compute first index and half its interval, total index and half its, by parameter."""
    salib, problem = import_salib(), _problem(varied)
    points = salib.sample.sobol.sample(problem, samples, calc_second_order=False, seed=seed)
    values = evaluate(points)
    if float(np.ptp(values)) == 0.0:
        return {each.key: (0.0, 0.0, 0.0, 0.0) for each in varied}
    found = salib.analyze.sobol.analyze(problem, values, calc_second_order=False, seed=seed)
    rows = zip(found["S1"], found["S1_conf"], found["ST"], found["ST_conf"], strict=True)
    return {v.key: tuple(map(float, row)) for v, row in zip(varied, rows, strict=True)}  # type: ignore[misc]  # four numbers


def _problem(varied: Sequence[Varied]) -> dict[str, Any]:
    return {
        "num_vars": len(varied), "names": [each.key for each in varied],
        "bounds": [[each.low, each.high] for each in varied],
    }  # fmt: skip


def numeric_parameters(
    cell: Cell, spread: float, chosen: Sequence[str] = ("*",)
) -> tuple[list[Varied], list[str]]:
    """Return the numbers among the parameters of a cell's graph, ranged within a share of their
    value.

    Args:
        cell: the graph with its overrides.
        spread: the share.
        chosen: patterns of their names.

    Returns:
        What can be varied, and the names of what cannot: zero, or the graph may not run with an end of
        the range.
    """
    graph = load_cell(cell.graph, cell.include, cell.sets, cell.origin, cell.behind).checked
    found, left = [], []
    for spec in graph.blocks:
        if "~" in spec.path:
            continue
        for name, value, info in given_values(spec.params):
            key = f"{spec.path}.{name}"
            asked = any(fnmatchcase(key, pattern) for pattern in chosen)
            if not asked or not isinstance(value, float):
                continue
            low, high = sorted((value * (1.0 - spread), value * (1.0 + spread)))
            if low < high and all(_loads(cell, key, end) for end in (low, high)):
                found.append(Varied(key, low, high, unit_of(info)))
            else:
                left.append(key)
    return found, left


def _loads(cell: Cell, key: str, value: float) -> bool:
    """Tell whether the graph may run with a value."""
    tried = cell.with_sets({key: value}, Position("the sensitivity", 0, 0))
    try:
        load_cell(tried.graph, tried.include, tried.sets, tried.origin, tried.behind)
    except LoadError:
        return False
    return True


def metric_at(points: Array, varied: Sequence[Varied], metric: str, cell: Cell, seeds: Sequence[int], make: Make) -> Array:  # fmt: skip
    """Compute the mean of a metric over the seeds at each point; ``success`` is 1 for a run that
    succeeds.

    Raises:
        AloftError: a run has no such metric; the text names those that it has.
    """
    runs = [
        run
        for point in points
        for run in draw_runs(
            {v.key: float(f"{x:.{DIGITS}g}") for v, x in zip(varied, point.tolist(), strict=True)},
            "the sensitivity", [cell], seeds,
        )
    ]  # fmt: skip
    values = [_value(run, metric) for run in make(runs)]
    means: Array = np.array(values).reshape(len(points), len(seeds)).mean(axis=1)
    return means


def _value(run: Run, metric: str) -> float:
    outcome = run.outcome
    assert outcome is not None
    if metric == "success":
        return float(outcome.success)
    found = outcome.metrics.get(metric)
    if not isinstance(found, int | float) or not math.isfinite(found):
        numbers = [k for k, v in outcome.metrics.items() if isinstance(v, int | float)]
        near = listing(nearest(metric, numbers, cutoff=0.3) or ("success", *numbers))
        text = f"a run has no number {metric!r} ({outcome.reason}); there is {near}"
        raise AloftError(f"{text}. 'success' is known of every run")
    return float(found)


def write_chart(effects: Sequence[Effect], title: str, folder: Path) -> dict[str, str]:
    """Draw a chart of the effects with bars, as SVG and PNG, and return the paths by format."""
    shown = list(reversed(effects[:MOST_BARS]))
    indexed = [each for each in shown if each.total is not None]
    folder.mkdir(parents=True, exist_ok=True)
    with style():
        figure = new_figure(7.0, 1.2 + 0.22 * len(shown), title)
        axes = figure.subplots(1, 2 if indexed else 1, squeeze=False)[0]
        axes[0].barh([e.key for e in shown], [e.mean_size for e in shown], color=COLOURS[0],
                     xerr=[e.mean_size_interval for e in shown], ecolor=FAINT)  # fmt: skip
        axes[0].set(xlabel="mean size of the elementary effects")
        if indexed:
            places = np.arange(len(indexed))
            for shift, colour, name in ((0.2, COLOURS[0], "first"), (-0.2, COLOURS[1], "total")):
                values = [getattr(e, name) for e in indexed]
                wide = [getattr(e, f"{name}_interval") for e in indexed]
                axes[1].barh(
                    places + shift, values, 0.38, color=colour, xerr=wide, ecolor=FAINT, label=name
                )
            axes[1].set(xlabel="Sobol index", yticks=places, yticklabels=[e.key for e in indexed])
            axes[1].legend(fontsize=7.0)
        paths = {"svg": folder / "sensitivity.svg", "png": folder / "sensitivity.png"}
        paths["svg"].write_text(svg_text(figure), encoding="utf-8")
        image(figure).save(paths["png"], format="PNG")
    return {name: str(path) for name, path in paths.items()}


def as_data(effects: Sequence[Effect]) -> list[dict[str, Any]]:
    """Return the effects as plain data."""
    return [asdict(each) for each in effects]
