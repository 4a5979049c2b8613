"""Columns of a log: which they are, their units and signs, and their rows on one clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array, Array1D, Array2D, Flags, Indices1D
from ...mathematics.kernel import kernel
from ...runtime.language.errors import UnitError
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.units import parse_unit
from .log_file import LogError, LogFile

MOST_JITTER = 0.2
"""A spread of the steps between stamps, relative to their mean, above which they are arrival times."""


class LogColumns(Parameters):
    """Columns of a log with their unit, sign and zero: value = scale * (column - offset)."""

    columns: str | list[str] = parameter(
        text="the name of an array, of one column of it as name[2], or one name for each number"
    )
    unit: str | None = parameter(
        None, text="the columns' unit, such as deg or mm; none: the file's, or SI"
    )
    scale: list[float] = parameter([1.0], text="factor of each column, or of all: -1 turns a sign")
    offset: list[float] = parameter(
        [0.0], text="zero of each column, or of all, in the columns' unit"
    )


Columns = str | list[str] | LogColumns
"""A name, names, or names with unit, scale and offset."""


class LogClock(Parameters):
    """When the rows were taken: by stamps, by an even grid between the first and the last, or at a rate."""

    stamps: str | None = parameter(
        None, text="the column of stamps; none: the file's own, of each topic"
    )
    unit: str = parameter("s", text="of the stamps, such as ns")
    even: bool = parameter(
        False,
        text="rows are evenly apart from the first stamp to the last: stamps are arrival times",
    )
    rate: float | None = parameter(
        None, unit="Hz", gt=0.0, text="rows a second, in place of stamps"
    )


def numbers(
    log: LogFile, columns: Columns, count: int | None, unit: str
) -> tuple[Array, Array | None]:
    """Return the numbers (n, k) of columns in ``unit``, and their own stamps (n,) [s] if the file has some.

    Raises:
        LogError: a column is missing, their number is not ``count``, they have different lengths, or
            the unit is none or of another dimension.
    """
    spec = columns if isinstance(columns, LogColumns) else LogColumns(columns=columns)
    names = [spec.columns] if isinstance(spec.columns, str) else spec.columns
    found = [log.array(name) for name in names]
    lengths = {len(each.values) for each in found}
    if len(lengths) > 1:
        raise LogError(f"the columns {', '.join(names)} have different lengths: {sorted(lengths)}")
    values = (
        found[0].values
        if len(found) == 1
        else np.concatenate([each.values for each in found], axis=1)
    )
    if count is not None and values.shape[1] != count:
        raise LogError(f"{', '.join(names)} has {values.shape[1]} columns, expected {count}")
    width = values.shape[1]
    for what, given in (("scale", spec.scale), ("offset", spec.offset)):
        if len(given) not in (1, width):
            raise LogError(
                f"{what} of {', '.join(names)} has {len(given)} numbers, expected 1 or {width}"
            )
    factors = [
        _factor(spec.unit or each.unit, unit, name)
        for name, each in zip(names, found, strict=True)
        for _ in range(each.values.shape[1])
    ]
    if any(spec.offset) or {*spec.scale, *factors} != {1.0}:
        values = (values - np.array(spec.offset)) * np.array(spec.scale) * np.array(factors)
    return values, found[0].stamps


def _factor(given: str | None, wanted: str, name: str) -> float:
    """Return the factor from a column's unit to the one that is wanted."""
    if given is None or not wanted:
        return 1.0
    try:
        found, expected = parse_unit(given), parse_unit(wanted)
    except UnitError as error:
        raise LogError(f"unit of {name}: {error}") from None
    if not found.same_dimension(expected):
        raise LogError(f"{name} is in {given}, expected a unit like {wanted}")
    return found.factor_to(expected)


def stamps_of(log: LogFile, clock: LogClock, rows: int, own: Array1D | None) -> Array1D:
    """Return the time of each of ``rows`` rows [s], by the clock.

    Raises:
        LogError: there are no stamps, as many of them as rows, or they do not rise.
    """
    if clock.rate is not None:
        return np.arange(rows) / clock.rate
    if clock.stamps is not None:
        try:
            factor = parse_unit(clock.unit).factor_to(parse_unit("s"))
        except UnitError as error:
            raise LogError(f"clock.unit: {error}") from None
        times = log.array(clock.stamps).values
        if times.shape[1] != 1:
            raise LogError(f"clock.stamps: {clock.stamps} has {times.shape[1]} columns, expected 1")
        if len(times) != rows and own is None:
            raise LogError(f"clock.stamps: {clock.stamps} has {len(times)} stamps for {rows} rows")
        stamps = times[:, 0] * factor if len(times) == rows else own
    else:
        stamps = own
    if stamps is None:
        raise LogError("the rows have no time: give clock.stamps, a column, or clock.rate")
    steps = np.diff(stamps)
    if not np.isfinite(stamps).all() or (steps < 0.0).any():
        row = int(np.argmax(~(steps >= 0.0))) + 1
        raise LogError(
            f"the stamps do not rise: row {row} has {stamps[row]:.9g} after {stamps[row - 1]:.9g}"
        )
    if clock.even:
        return np.linspace(stamps[0], stamps[-1], rows)
    return np.asarray(stamps, np.float64)


def jitter_of(log: LogFile, clock: LogClock, rows: int, own: Array1D | None) -> float:
    """Return the standard deviation of the steps between stamps relative to their mean; zero without stamps."""
    if clock.rate is not None:
        return 0.0
    steps = np.diff(stamps_of(log, clock.model_copy(update={"even": False}), rows, own))
    return float(steps.std() / steps.mean()) if steps.size and steps.mean() > 0.0 else 0.0


class TimedRows(NamedTuple):
    """Rows with their times, of which a tick takes those about its own time: ``values`` (n, k) at ``stamps`` (n,) [s].

    ``column`` (j,) is that of each number that is wanted, -1 where there is none and it stays ``otherwise`` (j,). ``times`` (m,) [s]
    are the ticks', ``last`` (m,) the row at or before each. ``linear`` (1,) is true between rows, false where the last row holds.
    """

    stamps: Array1D
    values: Array2D
    column: Indices1D
    otherwise: Array1D
    times: Array1D
    last: Indices1D
    linear: Flags

    def at_ticks(self) -> Array:
        """Return what every tick takes, (m, j)."""
        rows = np.tile(self.otherwise, (len(self.times), 1))
        own = self.column >= 0
        at = at_times(self.stamps, self.values, self.times, not self.linear[0])
        rows[:, own] = at[:, self.column[own]]
        return rows


def last_rows(stamps: Array1D, times: Array1D, hold: bool = False) -> Indices1D:
    """Return the row at or before each time (m,), the first one before all stamps; where it holds, a stamp may be 1 ns late."""
    late = 1e-9 if hold else 0.0
    found = np.searchsorted(stamps, times + late, side="right") - 1
    return np.clip(found, 0, len(stamps) - 1)


@kernel
def take_row(rows: TimedRows, tick: int, out: Array1D) -> None:
    """Write the numbers (j,) of a tick, with the bytes of ``at_times``."""
    last = rows.last[tick]
    since = rows.times[tick] - rows.stamps[last]
    between = rows.linear[0] and last + 1 < rows.stamps.shape[0] and since > 0.0
    span = rows.stamps[last + 1] - rows.stamps[last] if between else 1.0
    for j in range(out.shape[0]):
        column = rows.column[j]
        if column < 0:
            out[j] = rows.otherwise[j]
        elif between:
            here = rows.values[last, column]
            out[j] = (rows.values[last + 1, column] - here) / span * since + here
        else:
            out[j] = rows.values[last, column]


def at_times(stamps: Array1D, values: Array, times: Array1D, hold: bool = False) -> Array:
    """Return rows (m, k) at other times (m,): linear between rows, or that of the last row before."""
    if hold:
        return values[last_rows(stamps, times, hold)]
    return np.stack([np.interp(times, stamps, column) for column in values.T], axis=1)


def mean_over(stamps: Array1D, values: Array, times: Array1D, period: float) -> Array:
    """Return the means (m, k) over the ``period`` before each time, of values that are linear between rows."""
    steps = np.diff(stamps)[:, None]
    areas = np.vstack(
        [np.zeros(values.shape[1]), np.cumsum(0.5 * (values[1:] + values[:-1]) * steps, axis=0)]
    )

    def area(at: Array1D) -> Array:
        at = np.clip(at, stamps[0], stamps[-1])
        last = np.clip(np.searchsorted(stamps, at, side="right") - 1, 0, len(stamps) - 2)
        since = (at - stamps[last])[:, None]
        return areas[last] + 0.5 * since * (values[last] + at_times(stamps, values, at))

    span = np.clip(times, stamps[0], stamps[-1]) - np.clip(times - period, stamps[0], stamps[-1])
    means = (area(times) - area(times - period)) / np.maximum(span, 1e-12)[:, None]
    return np.where(span[:, None] > 1e-9, means, at_times(stamps, values, times))


def repeats_of(values: Array) -> Flags:
    """Return for each row (n,) whether it is exactly the row before: a sample that was not renewed."""
    same: Flags = (values[1:] == values[:-1]).all(axis=1)
    return np.concatenate([np.zeros(1, bool), same])


def with_hysteresis(force: Array1D, closes: float, opens: float) -> Flags:
    """Return whether a switch is closed at each force (n,): it closes above ``closes`` and opens below ``opens``."""
    change = np.where(force > closes, 1, np.where(force < opens, -1, 0))
    change[0] = change[0] or (1 if force[0] >= opens else -1)
    last = np.maximum.accumulate(np.where(change != 0, np.arange(len(force)), 0))
    closed: Flags = change[last] > 0
    return closed


def match_joints(names: Sequence[str], robot: Sequence[str]) -> tuple[list[int], list[str]]:
    """Return for each joint of the robot its column, -1 without one, and the names that the robot lacks."""
    columns = [names.index(name) if name in names else -1 for name in robot]
    return columns, [name for name in names if name not in robot]
