"""The table of all runs, with one row for each run in the order of the study, as a Parquet file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..runtime.language.errors import AloftError
from .execution import Run
from .study import FIRST_REPORT_SEED

if TYPE_CHECKING:
    import pyarrow


def make_table(runs: Sequence[Run]) -> pyarrow.Table:
    """The table: ``task``, ``arm``, a column for every axis, ``seed``, ``tuning_seed`` (whether
    it is one), ``success``, ``reason``, ``error``, ``run_hash``, every metric, ``wall_time_s``.

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
    """The values as an array of one type: truth values, integers, numbers, or else texts."""
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

    partial = path.with_name(f".{path.name}.partial")
    try:
        parquet.write_table(table, partial, compression="zstd")
        partial.replace(path)
    except OSError as error:
        raise AloftError(f"cannot write {path}: {error.strerror or error}") from error
