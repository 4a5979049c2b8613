"""A recorded or computed table, played back."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.interpolation import interpolate
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, Misfit, Output
from ...runtime.language.parameters import Parameters, parameter
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class TablePlayback(Says, Block):
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
        between: Literal["linear", "hold"] = parameter(
            "linear", text="what holds between two times"
        )
        repeat: bool = parameter(False, text="whether it begins again at the end")

    params: Params
    y = Output(Vector, text="the columns at the present time")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` columns."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.columns)}

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """The table must be there and be one."""
        assert isinstance(params, cls.Params)
        try:
            read_table(params.file, params.rows, params.time, params.columns, context.folder)
        except ValueError as error:
            yield Misfit(str(error), "file" if params.file is not None else "rows")

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two columns of three rows."""
        rows = [[0.0, 1.0, 2.0], [0.006, 2.0, 0.0], [0.012, -1.0, 0.5]]
        return {"columns": ["x", "y"], "rows": rows}

    def setup(self) -> None:
        """Read the table."""
        p = self.params
        self._times, self._columns = read_table(
            p.file, p.rows, p.time, p.columns, self.context.folder
        )

    def step(self) -> None:
        """Write the values of the present time."""
        times, y = self._times, self.y.value
        start, end = float(times[0]), float(times[-1])
        now = self.time
        if self.params.repeat:
            now = start + (now - start) % (end - start)
        if self.params.between == "linear":
            for k in range(len(y)):
                y[k] = interpolate(times, self._columns[k], now, True)
        else:
            last = int(np.searchsorted(times, now + 1e-9, side="right")) - 1
            np.copyto(y, self._columns[:, max(last, 0)])


def read_table(
    file: str | None,
    rows: list[list[float]] | None,
    time: str,
    columns: list[str],
    folder: Path,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The times (k) and the columns (n, k) of a table.

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
