"""A recorded or written table that is played over time."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...mathematics.arrays import Array, Array1D, Array2D, Indices1D
from ...mathematics.interpolation import interpolate, interval
from ...mathematics.kernel import kernel
from ...mathematics.rotations import between
from ...mathematics.ticks import all_in_ticks, since_begin
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Clock, Context, Output, UnmetRequirement
from ...runtime.language.parameters import Parameters, parameter
from .vectors import SourceParameters, UnitFromParameters, Vector

LONGEST_WAIT = 1e7
"""A first time later than this [s], 116 days, is a time of day, also where a run has no end."""
UNIT_LENGTH = 0.01
"""A row's four numbers are a quaternion if their length differs from one by less than this."""


class TablePlayback(UnitFromParameters, Block):
    """Columns of a table over time, from a CSV or NPZ file beside the graph or from ``rows``.

    A CSV file has the columns' names in its first line, an NPZ file one array for each. Times [s]
    must rise. Between them it interpolates ``linear``, or holds the last value (``hold``); before
    the first time the first row holds, behind the last one the last row, or with ``repeat`` it
    begins again: the last row's time is that of the first row again. A time that is meant to be on a
    tick, to a millionth of one, is. Times of day count from the first row with ``from_first``.

    Four neighbouring columns whose names end in x, y, z and w, in any order, and whose rows have length
    one are a quaternion: between rows it turns at an even rate about one axis, the short way round, and
    its length stays one. A row that is on the other side, -q for q, is taken as q.
    """

    class Params(SourceParameters):
        file: str | None = parameter(None, text="the file, relative to the graph's folder")
        rows: list[list[float]] | None = parameter(
            None, text="instead of a file: rows of the time and every column"
        )
        time: str = parameter("time", text="the name of the column with the times")
        columns: list[str] = parameter(text="the names of the columns played", min_length=1)
        between: Literal["linear", "hold"] = parameter("linear", text="rule between two times")
        repeat: bool = parameter(False, text="begins again at the end")
        from_first: bool = parameter(
            False, text="times count from the first row, which is at time zero: for times of day"
        )

    params: Params
    y = Output(Vector, text="the columns at the present time")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` columns."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.columns)}

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a table that is missing or is none, or that begins after the run has ended."""
        assert isinstance(params, cls.Params)
        at = "file" if params.file is not None else "rows"
        try:
            table = read_table(params, context.folder)
        except ValueError as error:
            yield UnmetRequirement(str(error), at)
            return
        first, end = table.times[0], context.duration
        if first > (LONGEST_WAIT if end is None else end) and not params.from_first:
            until = "" if end is None else f", and a run ends after {end:g} s"
            yield UnmetRequirement(
                f"the first time of the table is {first:.12g} s{until}: only its first row would be played",
                at,
                expected="times since the begin of the run",
                found=f"{table.place(0)}: {params.time} = {first:.12g}",
                fix="from_first: true, for times of day",
            )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two columns of three rows."""
        rows = [[0.0, 1.0, 2.0], [0.006, 2.0, 0.0], [0.012, -1.0, 0.5]]
        return {"columns": ["x", "y"], "rows": rows}

    def setup(self) -> None:
        table = read_table(self.params, self.context.folder)
        times, rounding = table.times, 0.0
        self._first = 0.0 if self.params.from_first else float(times[0])
        if self.params.from_first:
            rounding = 4.0 * float(np.spacing(np.abs(times).max()))
            times = times - times[0]
        self.times = all_in_ticks(times, self.context.clock.base_period, rounding)
        self.columns = table.values
        starts = [] if self.params.between == "hold" else quaternions(self.params.columns, table)
        self.quaternions = np.array(starts, np.int64)
        self.rows = np.ascontiguousarray(self.columns.T)
        for start in starts:
            four = self.rows[:, start : start + 4]
            four /= np.sqrt(np.sum(four * four, axis=1))[:, None]
            four *= _sides(four)[:, None]

    def warnings(self) -> Sequence[str]:
        """Warn at the end of a run that nothing but the first row was played."""
        time = self.tick * self.context.clock.base_period
        if not 0.0 < time < self._first:
            return ()
        return (
            (
                f"the first time of the table is {self._first:.12g} s, and the run ended after {time:.9g} s: only its "
                "first row was played; for times of day: from_first: true"
            ),
        )

    @kernel
    @staticmethod
    def step(
        y: Vector,
        params: Params,
        times: Array1D,
        columns: Array2D,
        rows: Array2D,
        quaternions: Indices1D,
        clock: Clock,
    ) -> None:
        count = times.shape[0]
        start, end = times[0], times[count - 1]
        now = float(clock.tick)
        if params.repeat:
            now = start + since_begin(now, start, end - start)
        last = interval(times, 0, count, now)
        if params.between == "linear":
            for k in range(y.value.shape[0]):
                y.value[k] = interpolate(times, columns[k], now, True)
            share = min(max((now - times[last]) / (times[last + 1] - times[last]), 0.0), 1.0)
            for k in range(quaternions.shape[0]):
                first = quaternions[k]
                between(
                    rows[last, first : first + 4],
                    rows[last + 1, first : first + 4],
                    share,
                    y.value[first : first + 4],
                )
        else:
            if now >= times[last + 1]:
                last += 1
            y.value[:] = columns[:, last]


def _sides(four: Array) -> Array:
    """Return for each row, (k,), of quaternions (k, 4) the sign with which it follows the row before
    it by the short way."""
    flips = np.where(np.sum(four[1:] * four[:-1], axis=1) < 0.0, -1.0, 1.0)
    return np.concatenate([[1.0], np.cumprod(flips)])


@dataclass(frozen=True)
class Table:
    """A table that was read.

    Attributes:
        times: of the rows [s], (k,), rising.
        values: of the columns, (n, k).
        place: words for the place of a row in the file or the list, for messages.
    """

    times: Array
    values: Array
    place: Callable[[int], str]


def quaternions(columns: Sequence[str], table: Table) -> list[int]:
    """Return the first columns of all quaternions of a table; see ``TablePlayback``."""
    found: list[int] = []
    for k in range(len(columns) - 3):
        four = columns[k : k + 4]
        same = {name[:-1] for name in four}
        if len(same) > 1 or {name[-1:].lower() for name in four} != set("xyzw"):
            continue
        lengths = np.sqrt(np.sum(table.values[k : k + 4] ** 2, axis=0))
        if (np.abs(lengths - 1.0) < UNIT_LENGTH).all():
            found.append(k)
    return found


def read_table(params: TablePlayback.Params, folder: Path) -> Table:
    """Return the table that the parameters name or hold.

    Raises:
        ValueError: there is no such table, it lacks a column, or its times do not rise. The text gives
            the line and the value.
    """
    if (params.file is None) == (params.rows is None):
        raise ValueError("give either a file or rows")
    names = [params.time, *params.columns]
    if params.file is not None:
        found, place = _read_file(folder / params.file, params.file)
    else:
        found, place = _from_rows(params.rows or [], names), "rows[{}]".format
    for name in names:
        if name not in found:
            raise ValueError(f"the table has no column {name!r}; it has {', '.join(found)}")
    try:
        values = np.array([np.asarray(found[name], np.float64) for name in names])
    except (TypeError, ValueError):
        raise ValueError("the columns must be numbers, as many in each") from None
    if values.ndim != 2 or values.shape[1] < 2:
        raise ValueError("the columns must be vectors of one length, of two rows or more")
    for row, k in np.argwhere(~np.isfinite(values.T))[:1].tolist():
        raise ValueError(f"{place(row)}: {names[k]} is {values[k, row]:g}, which is not finite")
    for row in (np.flatnonzero(np.diff(values[0]) <= 0.0) + 1)[:1].tolist():
        raise ValueError(
            f"{place(row)}: the times in column {params.time!r} do not rise: {values[0, row]:.12g} follows "
            f"{values[0, row - 1]:.12g}"
        )
    return Table(values[0], values[1:], place)


def _from_rows(rows: Sequence[Sequence[float]], names: Sequence[str]) -> Mapping[str, Any]:
    for k, row in enumerate(rows):
        if len(row) != len(names):
            raise ValueError(
                f"rows[{k}] has {len(row)} numbers, expected the time and {len(names) - 1} values"
            )
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def _read_file(path: Path, shown: str) -> tuple[Mapping[str, Any], Callable[[int], str]]:
    try:
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}, "element {}".format
        text = path.read_text("utf-8-sig")  # spreadsheets write a byte order mark
        return _from_csv(text)
    except OSError as error:
        raise ValueError(f"cannot read {shown}: {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001  whatever is wrong with a file is said of the file
        raise ValueError(f"cannot read {shown} as a table: {error}") from None


def _from_csv(text: str) -> tuple[Mapping[str, Any], Callable[[int], str]]:
    """Return the columns by name, and words for the place of a row."""
    reader = csv.reader(text.splitlines(), skipinitialspace=True)
    names: list[str] = []
    body: list[list[float]] = []
    lines: list[int] = []
    for cells in reader:
        if not any(cell.strip() for cell in cells):
            continue
        if not names:
            names = [cell.strip() for cell in cells]
            continue
        if len(cells) != len(names):
            raise ValueError(
                f"line {reader.line_num} has {len(cells)} values, and the first line {len(names)} names"
            )
        body.append(
            [_number(cell, name, reader.line_num) for cell, name in zip(cells, names, strict=True)]
        )
        lines.append(reader.line_num)
    if not names:
        raise ValueError("it is empty; its first line has the columns' names")
    columns = {name: [row[k] for row in body] for k, name in enumerate(names)}
    return columns, lambda row: f"line {lines[row]}"


def _number(cell: str, name: str, line: int) -> float:
    try:
        return float(cell)
    except ValueError:
        raise ValueError(f"line {line}: {name} is {cell.strip()!r}, which is no number") from None
