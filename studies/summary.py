"""Sums up a study: for every cell a success rate with its interval, and whether the goal is met."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .confidence import wilson_interval
from .execution import Run
from .expansion import Cell
from .study import Study


@dataclass(frozen=True)
class Figures:
    """One metric over the runs that have it; ``low`` and ``high`` are its 5 % and 95 % quantiles."""

    n: int
    mean: float
    median: float
    low: float
    high: float

    def to_json(self) -> dict[str, Any]:
        """As plain data."""
        return dict(vars(self))


@dataclass(frozen=True)
class Row:
    """The runs of one cell, together. ``goal`` and ``met`` are ``None`` for a cell without a goal."""

    cell: Cell
    n: int
    successes: int
    errors: int
    ci_low: float
    ci_high: float
    goal: float | None
    metrics: Mapping[str, Figures]
    reasons: Mapping[str, int]
    """Why runs did not succeed, the most frequent first."""

    @property
    def rate(self) -> float:
        """The share of the runs that succeeded."""
        return self.successes / self.n if self.n else 0.0

    @property
    def met(self) -> bool | None:
        """Whether the rate reaches the goal."""
        return None if self.goal is None else self.n > 0 and self.rate >= self.goal - 1e-12

    def to_json(self) -> dict[str, Any]:
        """As plain data; the coordinates are keys of their own."""
        return {
            "task": self.cell.task, "arm": self.cell.arm, **self.cell.coordinates,
            "n": self.n, "successes": self.successes, "errors": self.errors, "rate": self.rate,
            "ci_low": self.ci_low, "ci_high": self.ci_high, "goal": self.goal, "met": self.met,
            "metrics": {name: figures.to_json() for name, figures in self.metrics.items()},
            "reasons": dict(self.reasons),
        }  # fmt: skip


def summarise(study: Study, runs: Sequence[Run]) -> list[Row]:
    """One row for each cell, in the order of the study, with Wilson's 95 % interval of its success rate."""
    by_cell: dict[int, list[Run]] = {}
    for run in runs:
        by_cell.setdefault(id(run.cell), []).append(run)
    return [_row(study, group) for group in by_cell.values()]


def _row(study: Study, runs: Sequence[Run]) -> Row:
    cell = runs[0].cell
    outcomes = [run.outcome for run in runs if run.outcome is not None]
    successes = sum(outcome.success for outcome in outcomes)
    goals = [goal.rate for goal in study.goals if goal.cells.takes(cell.labels)]
    values: dict[str, list[float]] = {}
    reasons: dict[str, int] = {}
    for outcome in outcomes:
        for name, value in outcome.metrics.items():
            if isinstance(value, (int, float)) and not isinstance(value, bool):
                values.setdefault(name, []).append(float(value))
        if not outcome.success:
            reasons[outcome.reason] = reasons.get(outcome.reason, 0) + 1
    low, high = wilson_interval(successes, len(outcomes))
    return Row(
        cell,
        len(outcomes),
        successes,
        sum(bool(outcome.error) for outcome in outcomes),
        low,
        high,
        goals[-1] if goals else None,
        {name: figures_of(values[name]) for name in sorted(values)},
        dict(sorted(reasons.items(), key=lambda item: (-item[1], item[0]))),
    )


def figures_of(values: Sequence[float]) -> Figures:
    """The median and the quantiles of at least one value."""
    ordered = sorted(values)
    return Figures(
        len(ordered),
        math.fsum(ordered) / len(ordered),
        quantile(ordered, 0.5),
        quantile(ordered, 0.05),
        quantile(ordered, 0.95),
    )


def quantile(ordered: Sequence[float], share: float) -> float:
    """The quantile of sorted values, linear between them."""
    place = share * (len(ordered) - 1)
    low = math.floor(place)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (place - low) * (ordered[high] - ordered[low])
