"""CSV and Parquet files as logs: tables of columns by name, which Arrow reads."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

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
_PART = 2_000_000
"""Bytes of text that are read at once."""


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
    return _filled(LogFile(path), _csv_parts(path, head), head.names, head.units)


def _csv_parts(path: Path, head: _Head) -> Iterator[Any]:
    """Give the rows part by part: Arrow would keep the text of all rows until it knows the types of the last."""
    arrow = import_module("pyarrow.csv")
    wrong: list[Any] = []

    def odd(row: Any) -> str:
        if row.text.startswith(("#", "%")):
            return "skip"
        wrong.append(row)
        return "error"

    lines = 0
    with path.open("rb") as file:
        while text := _whole_lines(file):
            try:
                yield arrow.read_csv(
                    io.BytesIO(text),
                    read_options=arrow.ReadOptions(
                        use_threads=False,
                        skip_rows=0 if lines else head.lines,
                        column_names=[str(k) for k in range(len(head.names))],
                        encoding=head.encoding,
                    ),
                    parse_options=arrow.ParseOptions(
                        delimiter=head.separator, invalid_row_handler=odd
                    ),
                    convert_options=arrow.ConvertOptions(decimal_point=head.decimal),
                )
            except ValueError:
                if not wrong:
                    raise
                raise LogError(
                    f"{path.name}: line {lines + wrong[0].number} has {wrong[0].actual_columns} values, and the header "
                    f"{len(head.names)} names"
                ) from None
            lines += max(text.count(b"\n"), text.count(b"\r"))


def _whole_lines(file: BinaryIO) -> bytes:
    """Return the next lines, about ``_PART`` bytes of them; empty at the end."""
    text = file.read(_PART)
    while text and (rest := file.readline(_PART)):
        text += rest
        if rest.endswith(b"\n"):
            break
    return text


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
    with import_module("pyarrow.parquet").ParquetFile(path, pre_buffer=False) as file:
        bounded(path, 8 * file.metadata.num_rows * file.metadata.num_columns)
        flat = _flat(file.schema_arrow.empty_table())
        units = [
            ((each.metadata or {}).get(b"unit") or b"").decode() or None for each in flat.schema
        ]
        return _filled(LogFile(path), map(_flat, file.iter_batches()), flat.column_names, units)


def _flat(rows: Any) -> Any:
    """Return a table, or a batch of one, with fields of structures as columns."""
    pyarrow, kinds = import_module("pyarrow"), import_module("pyarrow.types")
    table = rows if isinstance(rows, pyarrow.Table) else pyarrow.Table.from_batches([rows])
    while any(kinds.is_struct(each.type) for each in table.schema):
        table = table.flatten()
    return table


def _filled(
    log: LogFile, parts: Iterable[Any], names: list[str], units: list[str | None]
) -> LogFile:
    """Keep the columns of a table that comes part by part."""
    columns = [_Column() for _ in names]
    for name in names:
        if names.count(name) > 1:
            log.refused[name] = f"is the name of {names.count(name)} columns"
    for part in parts:
        for k, name in enumerate(names):
            try:
                if name not in log.refused:
                    columns[k].add(part.column(k))
            except _NoNumbersError as error:
                log.refused[name] = str(error)
                columns[k] = _Column()
    for name, column, unit in zip(names, columns, units, strict=True):
        if name not in log.refused:
            log.put(name, column.values, column.rows, unit)
    return log


class _NoNumbersError(Exception):
    """A column that is none of numbers; the text says what it is."""


class _Column:
    """The numbers of a column, in one array ``values`` (rows,) or (rows, k) that grows part by part."""

    def __init__(self) -> None:
        self.values: Array = np.zeros(0)
        self.rows, self.kind = 0, ""

    def add(self, part: Any) -> None:
        """Take a part of Arrow's; types may become wider from part to part.

        Raises:
            _NoNumbersError: it has no numbers, or they are of another kind than before.
        """
        before, self.rows = self.rows, self.rows + len(part)
        kinds = import_module("pyarrow.types")
        found = _values(part, before)
        if found is None:  # nothing is known of it, but that it is missing
            if self.kind:
                self._grow(self._missing(self.values, len(part)))
            return
        truths, moments = kinds.is_boolean(part.type), kinds.is_temporal(part.type)
        kind = "truths" if truths else "moments" if moments else "numbers"
        if self.kind and (kind, found.shape[1:]) != (self.kind, self.values.shape[1:]):
            if kind == self.kind:
                widths = sorted((self.values.shape[1], found.shape[1]))
                raise _NoNumbersError(f"has lists of different lengths, {widths[0]} to {widths[1]}")
            raise _NoNumbersError(f"has {self.kind} first, and {kind} from row {before} on")
        if not self.kind:
            self.kind = kind
            self.values = self._missing(found, before) if before else found[:0].copy()
        self._grow(found)

    def _grow(self, found: Array) -> None:
        rows, kind = len(self.values), np.result_type(self.values, found)
        if kind != self.values.dtype:
            self.values = self.values.astype(kind)
        # in place: what was read is not copied, and no old array stands beside the new one
        self.values.resize((rows + len(found), *found.shape[1:]), refcheck=False)
        self.values[rows:] = found

    @staticmethod
    def _missing(like: Array, rows: int) -> Array:
        """Return rows that are missing in a column."""
        shape = (rows, *like.shape[1:])
        if like.dtype.kind in "Mm":
            return np.full(shape, "NaT", like.dtype)
        return np.full(shape, np.nan)


def _values(column: Any, before: int) -> Array | None:
    """Return the numbers of a part of a column, (n,) or (n, k), behind rows ``before`` it; what is missing is no number, and none
    is returned where all are."""
    pyarrow, kinds = import_module("pyarrow"), import_module("pyarrow.types")
    kind = column.type
    if kinds.is_dictionary(kind):
        column, kind = column.cast(kind.value_type), kind.value_type
    if kinds.is_null(kind):
        return None
    if kinds.is_string(kind) or kinds.is_large_string(kind):
        return _numbers_of(column, before)
    if kinds.is_list(kind) or kinds.is_large_list(kind) or kinds.is_fixed_size_list(kind):
        rows = column.to_pylist()
        widths = {len(row) for row in rows if row is not None}
        if not widths:
            return None
        if len(widths) > 1:
            raise _NoNumbersError(f"has lists of different lengths, {min(widths)} to {max(widths)}")
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


def _numbers_of(column: Any, before: int) -> Array:
    """Return the numbers in texts, such as those with blanks around them, behind rows ``before`` them.

    Raises:
        _NoNumbersError: they are no numbers; the text names the first one.
    """
    texts = column.to_pylist()
    try:
        return np.array([np.nan if text is None else float(text) for text in texts])
    except ValueError:
        row = next(k for k, text in enumerate(texts) if text is not None and not _is_number(text))
        raise _NoNumbersError(f"is text: row {before + row} has {texts[row]!r}") from None
