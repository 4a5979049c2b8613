"""Functions and signals that are given as tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from math import prod
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array1D, Array2D, Indices1D
from ...mathematics.interpolation import interpolate, interpolate_grid, interval
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Clock, Context, Input, Output, UnmetRequirement
from ...runtime.language.parameters import Numbers, Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .vectors import SourceParameters, UnitFromParameters, Vector, VectorParameters


def unsorted_points(name: str, points: Sequence[float]) -> Iterable[UnmetRequirement]:
    """Report points that do not rise from each to the next."""
    for one, two in pairwise(points):
        if two <= one:
            yield UnmetRequirement(
                f"{name} does not rise",
                parameter=name.partition("[")[0],
                expected=f"more than {one:g} behind {one:g}",
                found=f"{two:g}",
            )
            return


class LookupTable(UnitFromParameters, Block):
    """The line through the points (points[k], values[k]), evaluated at every element of the input.

    Beyond the first and last point the outer values hold (``clamp``) or the outer lines go on
    (``extrapolate``).
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = ("values",)

        points: Numbers = parameter(text="inputs, rising", min_length=2)
        values: Numbers = parameter(text="the output at each of them", min_length=2)
        beyond: Literal["clamp", "extrapolate"] = parameter(
            "clamp", text="rule beyond the first and last point"
        )

    params: Params
    u = Input(Vector, text="place at which the table is read")
    y = Output(Vector, text="the table's values there")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report points that do not rise, or have no value each."""
        assert isinstance(params, cls.Params)
        yield from unsorted_points("points", params.points)
        if len(params.values) != len(params.points):
            yield UnmetRequirement(
                "there must be as many values as points",
                parameter="values",
                expected=str(len(params.points)),
                found=str(len(params.values)),
            )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Three points."""
        return {"n": 2, "points": [-1.0, 0.0, 2.0], "values": [1.0, 0.0, 4.0]}

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, params: Params) -> None:
        for i in range(y.value.shape[0]):
            y.value[i] = interpolate(
                params.points, params.values, u.value[i], params.beyond == "clamp"
            )


class TableValue(Signal):
    """Value of a table of several variables: a vector of one number."""

    value = Field(1, inferred=True, text="the number")


class LookupGrid(UnitFromParameters, Block):
    """One number from a table on a grid, multilinear between its points: y = table(u[0], u[1], ...).

    ``axes`` holds the rising points of every variable; ``values`` the table in row-major order: the
    last variable's points follow each other. Beyond the ends the outer values hold (``clamp``) or
    the outer cells go on (``extrapolate``). It takes time in proportion to 2^n for n variables.
    """

    class Params(SourceParameters):
        in_unit = ("values",)

        axes: list[list[float]] = parameter(
            text="for every variable its points, rising", min_length=1, max_length=8
        )
        values: Numbers = parameter(text="the table, the last variable fastest")
        beyond: Literal["clamp", "extrapolate"] = parameter(
            "clamp", text="rule beyond the first and last points"
        )

    class Scratch(Signal):
        """Scratch memory of one step."""

        places = Field("n", dtype="int64", text="the cell that the input is in, by axis")
        shares = Field("n", text="share of the cell at which the input is, by axis")

    params: Params
    u = Input(Vector, text="place at which the table is read, one element a variable")
    y = Output(TableValue, text="the table's value there")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` variables."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.axes)}

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Every axis must rise, and the grid have as many values as points."""
        assert isinstance(params, cls.Params)
        for k, axis in enumerate(params.axes):
            yield from unsorted_points(f"axes[{k}]", axis)
            if len(axis) < 2:
                yield UnmetRequirement(
                    f"axes[{k}] has too few points",
                    "axes",
                    expected="2 or more",
                    found=str(len(axis)),
                )
        expected = prod(len(axis) for axis in params.axes)
        if len(params.values) != expected:
            yield UnmetRequirement(
                "values does not fill the grid",
                parameter="values",
                expected=" x ".join(str(len(axis)) for axis in params.axes) + f" = {expected}",
                found=str(len(params.values)),
            )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two variables."""
        return {"axes": [[-1.0, 0.5], [-1.0, 0.0, 1.0]], "values": [0.0, 1.0, 2.0, 3.0, 5.0, 8.0]}

    def setup(self) -> None:
        axes = self.params.axes
        self.points = np.array([point for axis in axes for point in axis])
        self.counts = np.array([len(axis) for axis in axes])

    @kernel
    @staticmethod
    def step(
        u: Vector,
        y: TableValue,
        params: Params,
        points: Array1D,
        counts: Indices1D,
        scratch: Scratch,
    ) -> None:
        clamp = params.beyond == "clamp"
        y.value[0] = interpolate_grid(
            points, counts, params.values, u.value, clamp, scratch.places, scratch.shares
        )


class TablePlayback(UnitFromParameters, Block):
    """Columns of a table over time, from a CSV or NPZ file beside the graph or from ``rows``.

    A CSV file has the columns' names in its first line, an NPZ file one array for each. Times [s]
    must rise. Between them it interpolates ``linear``, or holds the last value (``hold``); before
    the first time the first row holds, behind the last one the last row, or with ``repeat`` it
    begins again.
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

    params: Params
    y = Output(Vector, text="the columns at the present time")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` columns."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.columns)}

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a table that is missing or is none."""
        assert isinstance(params, cls.Params)
        try:
            read_table(params.file, params.rows, params.time, params.columns, context.folder)
        except ValueError as error:
            yield UnmetRequirement(str(error), "file" if params.file is not None else "rows")

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two columns of three rows."""
        rows = [[0.0, 1.0, 2.0], [0.006, 2.0, 0.0], [0.012, -1.0, 0.5]]
        return {"columns": ["x", "y"], "rows": rows}

    def setup(self) -> None:
        p = self.params
        self.times, self.columns = read_table(
            p.file, p.rows, p.time, p.columns, self.context.folder
        )

    @kernel
    @staticmethod
    def step(y: Vector, params: Params, times: Array1D, columns: Array2D, clock: Clock) -> None:
        rows = times.shape[0]
        start, end = times[0], times[rows - 1]
        now = clock.base_period * clock.tick
        if params.repeat:
            now = start + (now - start) % (end - start)
        if params.between == "linear":
            for k in range(y.value.shape[0]):
                y.value[k] = interpolate(times, columns[k], now, True)
        else:
            last = interval(times, 0, rows, now + 1e-9)
            if now + 1e-9 >= times[last + 1]:
                last += 1
            y.value[:] = columns[:, last]


def read_table(
    file: str | None,
    rows: list[list[float]] | None,
    time: str,
    columns: list[str],
    folder: Path,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the times (k) and the columns (n, k) of a table.

    Raises:
        ValueError: there is no such table, it lacks a column, or its times do not rise.
    """
    if (file is None) == (rows is None):
        raise ValueError("give either a file or rows")
    found: Mapping[str, Any]
    if rows is not None:
        if any(len(row) != len(columns) + 1 for row in rows):
            raise ValueError(f"every row must have the time and {len(columns)} values")
        found = dict(zip([time, *columns], np.array(rows).T, strict=True)) if rows else {}
    else:
        assert file is not None
        found = _read_file(folder / file, file)
    for name in (time, *columns):
        if name not in found:
            raise ValueError(f"the table has no column {name!r}; it has {', '.join(found)}")
    try:
        times = np.array(found[time], np.float64)
        values = np.array([np.asarray(found[name], np.float64) for name in columns])
    except (TypeError, ValueError):
        raise ValueError("the columns must be numbers, as many in each") from None
    if times.ndim != 1 or values.shape != (len(columns), len(times)) or len(times) < 2:
        raise ValueError("the columns must be vectors of one length, of two rows or more")
    if not np.isfinite(times).all() or not np.isfinite(values).all():
        raise ValueError("the table has values that are not finite numbers")
    if not (np.diff(times) > 0.0).all():
        raise ValueError(f"the times in column {time!r} do not rise")
    return times, values


def _read_file(path: Path, shown: str) -> Mapping[str, Any]:
    try:
        if path.suffix == ".npz":
            with np.load(path, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}
        lines = path.read_text("utf-8").strip().splitlines()
        names = [name.strip() for name in lines[0].split(",")]
        body = [[float(cell) for cell in line.split(",")] for line in lines[1:] if line.strip()]
        return dict(zip(names, map(list, zip(*body, strict=True)), strict=True))
    except OSError as error:
        raise ValueError(f"cannot read {shown}: {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001  whatever is wrong with a file is said of the file
        raise ValueError(f"cannot read {shown} as a table: {error}") from None
