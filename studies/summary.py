"""Sums up a study: for every cell a success rate with its interval, and whether the goal is met."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..runtime.language.errors import AloftError
from .execution import Run
from .expansion import Cell
from .study import FIRST_REPORT_SEED, Study

if TYPE_CHECKING:
    import pyarrow


Z_95 = 1.959963984540054
"""The standard normal's quantile that leaves 2.5 % above it."""


def wilson_interval(successes: int, n: int) -> tuple[float, float]:
    """Compute the 95 % score interval of E. B. Wilson (1927) for a probability of success.

        centre = (p + z^2 / 2n) / (1 + z^2 / n)
        half   = z / (1 + z^2 / n) sqrt(p (1 - p) / n + z^2 / 4n^2)

    with p = successes / n and z = ``Z_95``. Unlike the interval around p it never leaves [0, 1], and it says
    something also where all runs succeed: 40 of 40 give 0.912 to 1. Without runs it is (0, 1).

    Raises:
        ValueError: there are fewer than no successes, or more of them than runs.
    """
    if not 0 <= successes <= n:
        raise ValueError(f"{successes} successes of {n} runs")
    if n == 0:
        return 0.0, 1.0
    p, z = successes / n, Z_95
    scale = 1.0 + z * z / n
    centre = (p + z * z / (2 * n)) / scale
    half = z / scale * math.sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n))
    low = 0.0 if successes == 0 else max(0.0, centre - half)
    high = 1.0 if successes == n else min(1.0, centre + half)
    return low, high


@dataclass(frozen=True)
class Figures:
    """One metric over the runs that have it; ``low`` and ``high`` are its 5 % and 95 % quantiles."""

    n: int
    mean: float
    median: float
    low: float
    high: float

    def to_json(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        return dict(vars(self))


@dataclass(frozen=True)
class StudyRow:
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
    """Reasons of runs that did not succeed, the most frequent first."""

    @property
    def rate(self) -> float:
        """The share of the runs that succeeded."""
        return self.successes / self.n if self.n else 0.0

    @property
    def met(self) -> bool | None:
        """True if the rate reaches the goal."""
        return None if self.goal is None else self.n > 0 and self.rate >= self.goal - 1e-12

    def to_json(self) -> dict[str, Any]:
        """Return the row as plain data; the coordinates are keys of their own."""
        return {
            "task": self.cell.task, "arm": self.cell.arm, **self.cell.coordinates,
            "n": self.n, "successes": self.successes, "errors": self.errors, "rate": self.rate,
            "ci_low": self.ci_low, "ci_high": self.ci_high, "goal": self.goal, "met": self.met,
            "metrics": {name: figures.to_json() for name, figures in self.metrics.items()},
            "reasons": dict(self.reasons),
        }  # fmt: skip


def summarise(study: Study, runs: Sequence[Run]) -> list[StudyRow]:
    """Return one row for each cell, in the order of the study, with Wilson's 95 % interval of its
    success rate."""
    by_cell: dict[int, list[Run]] = {}
    for run in runs:
        by_cell.setdefault(id(run.cell), []).append(run)
    return [_row(study, group) for group in by_cell.values()]


def _row(study: Study, runs: Sequence[Run]) -> StudyRow:
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
    return StudyRow(
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
    """Compute the median and the quantiles of at least one value."""
    ordered = sorted(values)
    return Figures(
        len(ordered),
        math.fsum(ordered) / len(ordered),
        quantile(ordered, 0.5),
        quantile(ordered, 0.05),
        quantile(ordered, 0.95),
    )


def quantile(ordered: Sequence[float], share: float) -> float:
    """Compute the quantile of sorted values, linear between them."""
    place = share * (len(ordered) - 1)
    low = math.floor(place)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (place - low) * (ordered[high] - ordered[low])


def make_table(runs: Sequence[Run]) -> pyarrow.Table:
    """Make the table: ``task``, ``arm``, a column for every axis, ``seed``, ``tuning_seed``
    (whether it is one), ``success``, ``reason``, ``error``, ``run_hash``, every metric,
    ``wall_time_s``.

    A metric that a run does not have is null. The same runs give the same table, except its last
    column, no matter which processes made them and how often the study was interrupted.
    """
    import pyarrow

    outcomes = [run.outcome for run in runs]
    columns: dict[str, Any] = {
        "task": pyarrow.array([run.cell.task for run in runs], pyarrow.string()),
        "arm": pyarrow.array([run.cell.arm for run in runs], pyarrow.string()),
    }
    for name in dict.fromkeys(name for run in runs for name in run.cell.coordinates):
        columns[name] = _array([run.cell.coordinates.get(name) for run in runs])
    columns["seed"] = pyarrow.array([run.seed for run in runs], pyarrow.int64())
    columns["tuning_seed"] = pyarrow.array(
        [run.seed < FIRST_REPORT_SEED for run in runs], pyarrow.bool_()
    )
    columns["success"] = pyarrow.array([o.success if o else None for o in outcomes])
    for name in ("reason", "error", "run_hash"):
        values = [getattr(o, name) if o else None for o in outcomes]
        columns[name] = pyarrow.array(values, pyarrow.string())
    for name in sorted({name for o in outcomes if o for name in o.metrics}):
        values = [o.metrics.get(name) if o else None for o in outcomes]
        columns[name if name not in columns else f"metric.{name}"] = _array(values)
    times = [o.wall_time_s if o else None for o in outcomes]
    columns["wall_time_s"] = pyarrow.array(times, pyarrow.float64())
    return pyarrow.table(columns)


def _array(values: list[Any]) -> pyarrow.Array:
    """Return the values as an array of one type: truth values, integers, numbers, or else texts."""
    import pyarrow

    there = [value for value in values if value is not None]
    if all(isinstance(value, bool) for value in there) and there:
        return pyarrow.array(values, pyarrow.bool_())
    if any(isinstance(value, (str, bool)) for value in there):
        texts = [None if value is None else str(value) for value in values]
        return pyarrow.array(texts, pyarrow.string())
    if all(isinstance(value, int) for value in there) and there:
        return pyarrow.array(values, pyarrow.int64())
    numbers = [None if value is None else float(value) for value in values]
    return pyarrow.array(numbers, pyarrow.float64())


def write_table(path: Path, table: pyarrow.Table) -> None:
    """Write the table. After a failure there is no half-written file. Raises ``AloftError``."""
    from pyarrow import parquet

    from ..logs.exporting.export import with_statistics

    partial = path.with_name(f".{path.name}.partial")
    try:
        statistics = with_statistics(table.schema)
        parquet.write_table(table, partial, compression="zstd", write_statistics=statistics)
        partial.replace(path)
    except OSError as error:
        raise AloftError(f"cannot write {path}: {error.strerror or error}") from error
