"""Reads logs that others wrote: HDF5 and MATLAB 7.3, NPZ, CSV, Parquet, MCAP, ROS 2 bags, recordings of aloft."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ...files.pip_line import pip_line
from ...mathematics.arrays import Array
from .matlab_texts import matlab_texts

MOST_BYTES = 8_000_000_000
"""Numbers of a log in memory; a larger one is refused before they are read."""
_HEADER = re.compile(r"(?P<name>.*?)\s*[\[(](?P<unit>[^\[\]()]*)[\])]\s*")


class LogError(ValueError):
    """A file that is no log, or lacks what was asked of it; the text says what, and what is there."""


@dataclass(frozen=True)
class LogArray:
    """One array of a log: ``values`` (n, k), and when its n rows were taken: ``stamps`` (n,) [s], none if the
    file does not say. ``unit`` is what the file says."""

    values: Array
    stamps: Array | None = None
    unit: str | None = None


@dataclass
class LogFile:
    """The arrays of a log by name, in the file's order."""

    path: Path
    arrays: dict[str, LogArray] = field(default_factory=dict)
    texts: dict[str, list[str]] = field(default_factory=dict)
    """Lists of texts, such as the joints' names."""

    def array(self, name: str) -> LogArray:
        """Return an array, or with ``name[2]`` one column of it.

        Raises:
            LogError: there is no such array, or column.
        """
        if name in self.arrays:
            return self.arrays[name]
        match = re.fullmatch(r"(.+)\[(\d+)\]", name)
        if match and match[1] in self.arrays:
            whole, k = self.arrays[match[1]], int(match[2])
            if k >= whole.values.shape[1]:
                raise LogError(
                    f"{match[1]} has {whole.values.shape[1]} columns, so the last is {match[1]}[{whole.values.shape[1] - 1}]"
                )
            return LogArray(whole.values[:, k : k + 1], whole.stamps, whole.unit)
        near = get_close_matches(match[1] if match else name, self.arrays, 3, 0.5)
        shown = near or list(self.arrays)[:12]
        raise LogError(
            f"{self.path.name} has no column {name!r}; "
            f"{'similar are' if near else 'it has'} {', '.join(shown)}"
        )


def read_log(path: Path) -> LogFile:
    """Read a log by the ending of its name; a folder is a ROS 2 bag.

    Raises:
        LogError: it cannot be read, or is larger than the memory allowed for it.
    """
    try:
        reader = _reader(path)
        log: LogFile = reader(path)
    except LogError:
        raise
    except ModuleNotFoundError as error:
        extra = {"h5py": "hdf5", "rosbags": "mcap"}.get(str(error.name), str(error.name))
        raise LogError(f"{path.name} needs {error.name}: {pip_line(extra)}") from None
    except OSError as error:
        raise LogError(f"cannot read {path.name}: {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001  whatever is wrong with a file is said of the file
        raise LogError(f"cannot read {path.name}: {error}") from None
    if not log.arrays:
        raise LogError(f"{path.name} has no columns of numbers")
    return log


def _reader(path: Path) -> Any:
    if path.is_dir():
        return _read_bag
    readers = {
        ".mat": _read_hdf5, ".h5": _read_hdf5, ".hdf5": _read_hdf5, ".npz": _read_npz, ".csv": _read_csv,
        ".txt": _read_csv, ".parquet": _read_parquet, ".mcap": _read_bag, ".rrd": _read_recording,
    }  # fmt: skip
    if path.suffix not in readers:
        raise LogError(
            f"{path.name}: a log is HDF5 (.h5, .hdf5, .mat of MATLAB 7.3), .npz, .csv, .parquet, .mcap, .rrd, or the "
            "folder of a ROS 2 bag"
        )
    return readers[path.suffix]


def _rows(values: Any, rows: int | None = None) -> Array | None:
    """Return numbers as rows over time, (n, k): the longer of two dimensions is time."""
    numbers = np.asarray(values)
    if numbers.dtype.kind not in "fiub" or numbers.ndim > 2 or numbers.size < 2:
        return None
    table = np.atleast_2d(numbers)
    if rows in table.shape:
        table = table if table.shape[0] == rows else table.T
    elif table.shape[0] < table.shape[1]:
        table = table.T
    return np.ascontiguousarray(table, np.float64)


def _fill(log: LogFile, named: Mapping[str, Any]) -> LogFile:
    lengths = [max(np.shape(each)) for each in named.values() if np.ndim(each)]
    common = max(set(lengths), key=lengths.count) if lengths else None
    for name, values in named.items():
        numbers = np.asarray(values)
        if numbers.dtype.kind in "US" and numbers.ndim == 1:
            log.texts[name] = [str(text) for text in numbers.tolist()]
        elif (rows := _rows(numbers, common)) is not None:
            log.arrays[name] = LogArray(rows)
    return log


def _read_hdf5(path: Path) -> LogFile:
    h5py = import_module("h5py")
    with path.open("rb") as raw:
        if b"HDF" not in raw.read(1024):
            raise LogError(
                f"{path.name} is no HDF5 file; MATLAB writes one with save(..., '-v7.3')"
            )
    found: dict[str, Any] = {}
    texts: dict[str, list[str]] = {}
    size = 0
    with h5py.File(path, "r") as file:

        def visit(name: str, item: Any) -> None:
            nonlocal size
            # A file may name others by external links and storage: only what is inside is read.
            if not isinstance(item, h5py.Dataset) or name.startswith("#") or item.external:
                return
            size += item.nbytes
            if size > MOST_BYTES:
                raise LogError(f"{path.name} has more than {MOST_BYTES / 1e9:g} GB of numbers")
            if (named := matlab_texts(file, item)) is not None:
                texts[name] = named
            elif item.dtype.kind in "fiub" and item.ndim in (1, 2) and item.size > 1:
                found[name] = item[()]
            elif h5py.check_string_dtype(item.dtype) is not None and item.ndim == 1:
                found[name] = np.array([text.decode() for text in item[()]])

        file.visititems(visit)
    return _fill(LogFile(path, texts=texts), found)


def _read_npz(path: Path) -> LogFile:
    with np.load(path, allow_pickle=False) as archive:
        size = 0
        for info in archive.zip.infolist():
            size += info.file_size
        if size > MOST_BYTES:
            raise LogError(f"{path.name} has more than {MOST_BYTES / 1e9:g} GB of numbers")
        return _fill(LogFile(path), {name: archive[name] for name in archive.files})


def _read_csv(path: Path) -> LogFile:
    if path.stat().st_size > MOST_BYTES:
        raise LogError(f"{path.name} has more than {MOST_BYTES / 1e9:g} GB")
    with path.open(encoding="utf-8-sig", newline="") as file:
        first = next((line for line in file if line.strip()), "")
        separator = max(",;\t", key=first.count)
        names = [name.strip() for name in next(csv.reader([first], delimiter=separator), [])]
        if not names or all(_is_number(name) for name in names):
            raise LogError(f"{path.name}: the first line must have the columns' names")
        body = np.genfromtxt(file, delimiter=separator, ndmin=2, invalid_raise=True)
    if body.shape[1] != len(names):
        raise LogError(
            f"{path.name}: rows have {body.shape[1]} values, and the first line {len(names)} names"
        )
    log = LogFile(path)
    for k, name in enumerate(names):
        match = _HEADER.fullmatch(name)
        plain, unit = (match["name"], match["unit"]) if match else (name, None)
        log.arrays[plain or name] = LogArray(np.ascontiguousarray(body[:, k : k + 1]), unit=unit)
    return log


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _read_parquet(path: Path) -> LogFile:
    table = import_module("pyarrow.parquet").read_table(path)
    log = LogFile(path)
    for name in table.column_names:
        values = table.column(name).to_pylist()
        numbers = np.array([np.nan if each is None else each for each in values])
        if (rows := _rows(numbers, len(values))) is not None:
            log.arrays[name] = LogArray(rows)
    return log


def _read_recording(path: Path) -> LogFile:
    from ...logs.file.reader import read

    run = read(path)
    log = LogFile(path)
    for name, signal in run.signals().items():
        values = run[name]
        if values.dtype.kind in "fiub" and len(values) > 1:
            rows = np.ascontiguousarray(values.reshape(len(values), -1), np.float64)
            stamps = run.time if len(run.time) == len(rows) else None
            log.arrays[name] = LogArray(rows, stamps, signal.unit or None)
    return log


def _read_bag(path: Path) -> LogFile:
    """Read the numbers of every topic, by ``topic.field``, with the stamps of their headers, or of their arrival."""
    highlevel = import_module("rosbags.highlevel")
    typesys = import_module("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    rows: dict[str, list[list[float]]] = {}
    stamps: dict[str, list[float]] = {}
    log = LogFile(path)
    with highlevel.AnyReader([path], default_typestore=store) as reader:
        for connection, arrival, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            time = arrival * 1e-9 if stamp is None else stamp.sec + stamp.nanosec * 1e-9
            topic = connection.topic.strip("/").replace("/", "_")
            for name, numbers in _numbers(topic, message, log):
                if len(rows.get(name, [numbers])[0]) == len(numbers):
                    rows.setdefault(name, []).append(numbers)
                    stamps.setdefault(name, []).append(time)
    for name, values in rows.items():
        if len(values) > 1:
            log.arrays[name] = LogArray(
                np.array(values, np.float64), np.array(stamps[name], np.float64)
            )
    return log


def _numbers(name: str, message: Any, log: LogFile) -> Iterator[tuple[str, list[float]]]:
    """Give the numbers in a message by their path; x, y, z and w of a vector or quaternion are one array."""
    names = [each for each in getattr(message, "__dataclass_fields__", ()) if each != "__msgtype__"]
    if names and all(len(each) == 1 for each in names):
        yield name, [float(getattr(message, each)) for each in names]
        return
    for each in names:
        value = getattr(message, each)
        if each == "header" or "covariance" in each:
            continue
        path = f"{name}.{each}"
        if isinstance(value, (bool, int, float)):
            yield path, [float(value)]
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub" and value.size:
            yield path, value.ravel().astype(float).tolist()
        elif isinstance(value, list) and value and isinstance(value[0], str):
            if log.texts.setdefault(path, value) != value:
                raise LogError(
                    f"{log.path.name}: {path} changes from message to message, so its columns are not the same joints all along"
                )
        elif hasattr(value, "__dataclass_fields__"):
            yield from _numbers(path, value, log)
