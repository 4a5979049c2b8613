"""CSV and Parquet files as logs: tables of columns by name, which Arrow reads."""

from __future__ import annotations

import csv
import re
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...mathematics.arrays import Array
from ...runtime.language.errors import UnitError
from ...runtime.language.units import parse_unit
from .columns import GRAVITIES
from .log_file import LogError, LogFile, bounded

_BRACKETS = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*")
_LABEL = re.compile(r"\s*(\d+|[xyzw]|roll|pitch|yaw|.*[,_].*)\s*", re.IGNORECASE)
"""Words in brackets that tell columns apart, and are no unit: a number, an axis, a name of parts."""
_SPELLINGS = {
    "°": "deg", "°/s": "deg/s", "degree": "deg", "degrees": "deg", "degrees/s": "deg/s", "deg/sec": "deg/s", "sec": "s",
    "seconds": "s", "second": "s", "msec": "ms", "usec": "us", "nsec": "ns", "radians": "rad", "radian": "rad",
    "radians/s": "rad/s", "rad/sec": "rad/s", "m/s2": "m/s^2", "m/s²": "m/s^2", "m/s/s": "m/s^2", "meters": "m", "meter": "m",
    "mNm": "mN m", "N.m": "N m", "-": "1",
}  # fmt: skip
"""Units as the headers of tables have them, and as they are written here."""
_HEAD = 65536
"""Bytes from which a table's header, separator and decimal sign are told."""


class _Head(NamedTuple):
    """The beginning of a CSV file: its columns' names and units, and how its rows are written."""

    names: list[str]
    units: list[str | None]
    lines: int
    separator: str
    decimal: str
    encoding: str


def read_csv(path: Path) -> LogFile:
    """Read a CSV file with the columns' names in its first line, before which there may be comments."""
    bounded(path, path.stat().st_size)
    head = _head_of(path)
    arrow = import_module("pyarrow.csv")
    table = arrow.read_csv(
        path,
        read_options=arrow.ReadOptions(
            use_threads=False,
            skip_rows=head.lines,
            autogenerate_column_names=True,
            encoding=head.encoding,
        ),
        parse_options=arrow.ParseOptions(
            delimiter=head.separator,
            invalid_row_handler=lambda row: "skip" if row.text.startswith(("#", "%")) else "error",
        ),
        convert_options=arrow.ConvertOptions(decimal_point=head.decimal),
    )
    if table.num_columns != len(head.names):
        raise LogError(
            f"{path.name}: rows have {table.num_columns} values, and the header {len(head.names)} names"
        )
    return _filled(LogFile(path), table, head.names, head.units)


def _head_of(path: Path) -> _Head:
    with path.open("rb") as file:
        start = file.read(_HEAD)
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise LogError(f"{path.name} is UTF-16: save it as UTF-8")
    if b"\0" in start:
        raise LogError(f"{path.name} is no text, as a table of this name is")
    text, encoding = start.decode("utf-8-sig", "replace"), "utf8"
    if "\ufffd" in text[:-4]:  # the last letter may be cut off
        text, encoding = start.decode("latin-1"), "latin-1"
    lines = re.split("\r\n|\n|\r", text)
    first = next((k for k, line in enumerate(lines) if _said(line)), None)
    remarks = [k for k in range(first or 0) if lines[k].strip()]
    if first is None:
        raise LogError(f"{path.name} has no rows")
    if remarks and _all_numbers(lines[first]):  # NumPy writes the names as a comment
        first = remarks[-1]
    text = lines[first].lstrip("#% ") if remarks and first == remarks[-1] else lines[first]
    separator = max(",;\t", key=text.count)
    if not text.count(separator) and " " in text.strip() and not _BRACKETS.fullmatch(text):
        raise LogError(f"{path.name}: columns are apart by spaces, expected commas, semicolons or tabs")  # fmt: skip
    titles = [name.strip() for name in next(csv.reader([text], delimiter=separator), [])]
    if not titles or all(_is_number(name) for name in titles):
        raise LogError(f"{path.name}: the first line must have the columns' names")
    named = [_named(title) for title in titles]
    below = first + 1
    while below < len(lines) and not _said(lines[below]):
        below += 1
    second = next(csv.reader(lines[below : below + 1], delimiter=separator), [])
    if len(second) == len(titles) and any(second) and all(map(_is_unit, second)):
        named = [(title, _spelt(unit)) for title, unit in zip(titles, second, strict=True)]
        below += 1
    if below >= len(lines):
        raise LogError(f"{path.name} has no rows")
    body = "\n".join(lines[below : below + 100])
    comma = separator != "," and re.search(r"\d,\d", body) and not re.search(r"\d\.\d", body)
    return _Head(
        [name for name, _ in named], [unit for _, unit in named], below, separator, "," if comma else ".", encoding
    )  # fmt: skip


def _said(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith(("#", "%"))


def _all_numbers(line: str) -> bool:
    return all(_is_number(each) for each in re.split(r"[,;\t]", line))


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _is_unit(text: str) -> bool:
    """Tell whether the text below a name is a unit, or a place left empty for one."""
    if _is_number(text):
        return False
    try:
        parse_unit(_spelt(text) or "")
    except UnitError:
        return _spelt(text) in GRAVITIES
    return True


def _spelt(unit: str) -> str | None:
    plain = unit.strip().strip("[]()").strip()
    return _SPELLINGS.get(plain, plain) or None


def _named(title: str) -> tuple[str, str | None]:
    """Return a column's name and unit by its title: ``q1 [deg]``; brackets that have no unit are of the name."""
    match = _BRACKETS.fullmatch(title)
    if match is None or not match["name"] or _LABEL.fullmatch(match["unit"]):
        return title, None
    unit = _spelt(match["unit"])
    return (match["name"], unit) if _is_unit(match["unit"]) else (title, unit)


def read_parquet(path: Path) -> LogFile:
    """Read a Parquet file; fields of structures are columns called ``structure.field``."""
    kinds = import_module("pyarrow.types")
    with import_module("pyarrow.parquet").ParquetFile(path) as file:
        bounded(path, 8 * file.metadata.num_rows * file.metadata.num_columns)
        table = file.read()
    while any(kinds.is_struct(each.type) for each in table.schema):
        table = table.flatten()
    units = [((each.metadata or {}).get(b"unit") or b"").decode() or None for each in table.schema]
    return _filled(LogFile(path), table, table.column_names, units)


def _filled(log: LogFile, table: Any, names: list[str], units: list[str | None]) -> LogFile:
    for k, name in enumerate(names):
        if names.count(name) > 1:
            log.refused[name] = f"is the name of {names.count(name)} columns"
            continue
        column = table.column(k)
        try:
            log.put(name, _values(column), table.num_rows, units[k])
        except _NoNumbersError as error:
            log.refused[name] = str(error)
    return log


class _NoNumbersError(Exception):
    """A column that is none of numbers; the text says what it is."""


def _values(column: Any) -> Array:
    """Return the numbers of a column of Arrow's, (n,) or (n, k); what is missing is no number."""
    pyarrow, kinds = import_module("pyarrow"), import_module("pyarrow.types")
    kind = column.type
    if kinds.is_dictionary(kind):
        column, kind = column.cast(kind.value_type), kind.value_type
    if kinds.is_null(kind):
        raise _NoNumbersError("is empty")
    if kinds.is_string(kind) or kinds.is_large_string(kind):
        return _numbers_of(column)
    if kinds.is_list(kind) or kinds.is_large_list(kind) or kinds.is_fixed_size_list(kind):
        rows = column.to_pylist()
        widths = {len(row) for row in rows if row is not None}
        if len(widths) != 1:
            raise _NoNumbersError(f"has lists of different lengths, {min(widths, default=0)} to {max(widths, default=0)}")  # fmt: skip
        nothing = [None] * widths.pop()
        return np.array([nothing if row is None else row for row in rows], np.float64)
    if kinds.is_decimal(kind):
        column = column.cast(pyarrow.float64())
    elif kinds.is_time(kind):
        column = column.cast(pyarrow.time64("ns")).cast(pyarrow.int64()).cast(pyarrow.duration("ns"))  # fmt: skip
    elif kinds.is_boolean(kind) and column.null_count:
        column = column.cast(pyarrow.int8()).cast(pyarrow.float64())
    values: Array = column.to_numpy()
    if values.dtype.kind not in "fiubMm":
        raise _NoNumbersError(f"has values of the type {kind}")
    return values


def _numbers_of(column: Any) -> Array:
    """Return the numbers in texts, such as those with blanks around them.

    Raises:
        _NoNumbersError: they are no numbers; the text names the first one.
    """
    texts = column.to_pylist()
    try:
        return np.array([np.nan if text is None else float(text) for text in texts])
    except ValueError:
        row = next(k for k, text in enumerate(texts) if text is not None and not _is_number(text))
        raise _NoNumbersError(f"is text: row {row} has {texts[row]!r}") from None
