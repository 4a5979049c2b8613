"""Columns of a log: which they are, their units and signs, and their rows on one clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
MOST_APART = 0.5
"""Rows of a robot's log are hardly so far apart [s]: larger steps are in another unit."""
LATE = 1e-6
"""A stamp may be so late and still be that of a tick [s]: floats of seconds since 1970 are rounded to a quarter of it."""
GRAVITIES = {"g": 9.80665, "mg": 9.80665e-3}
"""Accelerations in units that are gram and milligram elsewhere [m/s^2]."""
COUNTER = 2.0**32
"""Values of a counter of 32 bits, which begins again after them."""


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
    """Times of the rows: by stamps, by an even grid between the first and the last, or at a rate."""

    stamps: str | None = parameter(
        None, text="the column of stamps; none: the file's own, of each topic"
    )
    unit: str | None = parameter(
        None, text="of the stamps, such as ns; none: what the file says, or s"
    )
    even: bool = parameter(
        False,
        text="rows are evenly apart from the first stamp to the last: stamps are arrival times",
    )
    rate: float | None = parameter(
        None, unit="Hz", gt=0.0, text="rows a second, in place of stamps"
    )
    sort: bool = parameter(
        False, text="rows that are out of order in the file are put in that of their stamps"
    )


class Moments(NamedTuple):
    """The moments of rows: ``times`` (n,) [s] since the first stamp, in the file's order, or in that of ``order`` (n,).

    ``jitter`` is the standard deviation of the stamps' steps relative to their mean, ``wraps`` how often their counter began
    again, ``shift`` [s] the median distance of an even grid from the stamps.
    """

    times: Array1D
    order: Indices1D | None = None
    jitter: float = 0.0
    wraps: int = 0
    shift: float = 0.0


Units = str | Sequence[str] | Mapping[int, Sequence[str]]
"""A unit of all columns, one of each, or those of each by how many columns there are."""


def numbers(
    log: LogFile, columns: Columns, units: Units, count: int | None = None
) -> tuple[Array, Array1D | None]:
    """Return the numbers (n, k) of columns, and their own stamps (n,) [s] if the file has some.

    Args:
        count: how many columns there must be, if ``units`` does not tell.

    Raises:
        LogError: a column is missing, their number is another, they differ in length or clock, or a unit is none or of another dimension.
    """
    spec = columns if isinstance(columns, LogColumns) else LogColumns(columns=columns)
    names = names_of(columns)
    if not names:
        raise LogError("no column is named")
    found = [log.array(name) for name in names]
    lengths = {len(each.values) for each in found}
    if len(lengths) > 1:
        raise LogError(f"the columns {', '.join(names)} have different lengths: {sorted(lengths)}")
    own = found[0].stamps
    if any(_other(own, each.stamps) for each in found):
        raise LogError(f"the columns {', '.join(names)} have clocks of their own")
    values = (
        found[0].values
        if len(found) == 1
        else np.concatenate([each.values for each in found], axis=1)
    )
    width = values.shape[1]
    if isinstance(units, str):
        units = [units] * (width if count is None else count)
    by_width = units if isinstance(units, Mapping) else {len(units): units}
    if width not in by_width:
        expected = " or ".join(map(str, by_width))
        raise LogError(f"{', '.join(names)} has {width} columns, expected {expected}")
    for what, given in (("scale", spec.scale), ("offset", spec.offset)):
        if len(given) not in (1, width):
            raise LogError(
                f"{what} of {', '.join(names)} has {len(given)} numbers, expected 1 or {width}"
            )
    said = [
        (name, each.unit)
        for name, each in zip(names, found, strict=True)
        for _ in range(each.values.shape[1])
    ]
    factors = [
        _factor(spec.unit, unit, to, name)
        for (name, unit), to in zip(said, by_width[width], strict=True)
    ]
    if any(spec.offset) or {*spec.scale, *factors} != {1.0}:
        values = (values - np.array(spec.offset)) * np.array(spec.scale) * np.array(factors)
    return values, own


def names_of(columns: Columns) -> list[str]:
    """Return the names of columns."""
    names = columns.columns if isinstance(columns, LogColumns) else columns
    return [names] if isinstance(names, str) else names


def _other(own: Array1D | None, stamps: Array1D | None) -> bool:
    """Tell whether columns of the same length have different stamps."""
    if own is stamps:
        return False
    return own is None or stamps is None or not np.array_equal(own, stamps)


def _factor(given: str | None, said: str | None, wanted: str, name: str) -> float:
    """Return the factor to the unit that is wanted from the one that is given, or that the file says."""
    unit = given or said
    if unit is None or not wanted:
        return 1.0
    expected = parse_unit(wanted)
    if unit in GRAVITIES and expected.same_dimension(parse_unit("m/s^2")):
        return GRAVITIES[unit]
    try:
        found = parse_unit(unit)
    except UnitError as error:
        fix = f"; the file says so, and `unit: {wanted}` beside `columns` says otherwise"
        raise LogError(f"unit of {name}: {error}{'' if given else fix}") from None
    if not found.same_dimension(expected):
        raise LogError(f"{name} is in {unit}, expected a unit like {wanted}")
    return found.factor_to(expected)


def moments_of(log: LogFile, clock: LogClock, rows: int, own: Array1D | None) -> Moments:
    """Return when each of ``rows`` rows was taken, by the clock.

    Raises:
        LogError: there are no stamps, as many of them as rows, or they do not rise.
    """
    if clock.rate is not None:
        return Moments(np.arange(rows) / clock.rate)
    wraps, order = 0, None
    if clock.stamps is not None:
        stamps, wraps = _column_of_stamps(log, clock.stamps, clock.unit, rows)
    elif own is not None:
        stamps = own
    else:
        raise LogError("the rows have no time: give clock.stamps, a column, or clock.rate")
    if not np.isfinite(stamps).all():
        row = int(np.argmin(np.isfinite(stamps)))
        raise LogError(f"the stamps do not rise: row {row} has {stamps[row]}")
    if clock.sort:
        order = np.argsort(stamps, kind="stable")
        stamps = stamps[order]
    steps = np.diff(stamps)
    if (steps < 0.0).any():
        row = int(np.argmax(steps < 0.0)) + 1
        raise LogError(
            f"the stamps do not rise: row {row} is {-steps[row - 1]:.9g} s before row {row - 1}, the first of {int((steps < 0.0).sum())} that "
            "go back. Where rows are only out of order in the file, clock.sort: true puts them right"
        )
    if stamps[-1] <= stamps[0]:
        raise LogError("the stamps do not rise: all are the same")
    jitter = float(steps.std() / steps.mean())
    if not clock.even:
        return Moments(stamps, order, jitter, wraps)
    even = np.linspace(stamps[0], stamps[-1], rows)
    return Moments(even, order, jitter, wraps, float(np.median(np.abs(stamps - even))))


def _column_of_stamps(log: LogFile, name: str, given: str | None, rows: int) -> tuple[Array1D, int]:
    """Return a column of stamps [s] since its first, and how often their counter of 32 bits began again."""
    column = log.array(name)
    unit = given or column.unit
    try:
        factor = parse_unit(unit or "s").factor_to(parse_unit("s"))
    except UnitError as error:
        raise LogError(f"clock.unit: {error}") from None
    if column.values.shape[1] != 1:
        raise LogError(f"clock.stamps: {name} has {column.values.shape[1]} columns, expected 1")
    if len(column.values) != rows:
        raise LogError(f"clock.stamps: {name} has {len(column.values)} stamps for {rows} rows")
    if column.whole is not None:
        since, wraps = (column.whole - column.whole[0]).astype(np.float64), 0
    else:
        counts = column.values[:, 0]
        since, wraps = counts - counts[0], 0
        if np.ptp(counts) < COUNTER and (counts == np.floor(counts)).all():
            again = np.cumsum(np.diff(counts, prepend=counts[0]) < -0.5 * COUNTER)
            since, wraps = since + COUNTER * again, int(again[-1])
    usual = usual_step(since)
    if unit is None and usual > MOST_APART:
        fits = [each for each, per in (("ms", 1e3), ("us", 1e6), ("ns", 1e9)) if usual < MOST_APART * per]  # fmt: skip
        raise LogError(
            f"clock.unit: {name} has steps of {usual:g}, hardly seconds, and the file names no unit; expected one, such as {fits[0] if fits else 'ns'}"
        )
    return since * factor, wraps


def usual_step(stamps: Array1D) -> float:
    """Return the median of the steps between stamps that differ; zero without any."""
    steps = np.abs(np.diff(stamps))
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if steps.size else 0.0


def rows_to_keep(times: Array1D, values: Array) -> tuple[Flags, int, int]:
    """Return which rows count (n,), how many are no numbers, and how many have the time of a later one, which counts."""
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    last = np.diff(times[rows], append=np.inf) > 0.0
    keep = np.zeros(len(times), bool)
    keep[rows[last]] = True
    return keep, len(times) - len(rows), len(rows) - int(last.sum())


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
    """Return the row at or before each time (m,), the first one before all stamps; where it holds, a stamp may be late."""
    late = LATE if hold else 0.0
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
