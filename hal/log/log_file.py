"""Logs that others wrote, as arrays by name: the form that every reader gives to what is in a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ...files.pip_line import pip_line
from ...mathematics.arrays import Array, Array1D, Indices1D

MOST_BYTES = 8_000_000_000
"""Numbers of a log in memory; a larger one is refused before they are read."""
_EXACT = 2**53
"""Whole numbers above it are kept beside their floats: stamps of nanoseconds since 1970 are."""
_ENDINGS = {
    ".mat": "arrays:read_hdf5", ".h5": "arrays:read_hdf5", ".hdf5": "arrays:read_hdf5", ".npz": "arrays:read_npz",
    ".csv": "tables:read_csv", ".txt": "tables:read_csv", ".parquet": "tables:read_parquet", ".mcap": "bags:read_bag",
    ".rrd": "recordings:read_recording",
}  # fmt: skip
"""The module here that reads a file, and its function, by the ending of the name."""


class LogError(ValueError):
    """A file that is no log, or lacks what was asked of it; the text says what, and what is there, ``fix`` what was meant."""

    def __init__(self, text: str, fix: str = "") -> None:
        super().__init__(text)
        self.fix = fix


@dataclass(frozen=True)
class LogArray:
    """One array of a log: ``values`` (n, k), and when its n rows were taken: ``stamps`` (n,) [s] since the file's first, none if the
    file does not say. ``unit`` and ``frame``, in which a sensor measures, are what the file says, ``whole`` (n,) the same values where
    floats would round them."""

    values: Array
    stamps: Array1D | None = None
    unit: str | None = None
    whole: Indices1D | None = None
    frame: str = ""


@dataclass
class LogFile:
    """The arrays of a log by name, in the file's order."""

    path: Path
    arrays: dict[str, LogArray] = field(default_factory=dict)
    texts: dict[str, list[str]] = field(default_factory=dict)
    """Lists of texts, such as the joints' names."""
    refused: dict[str, str] = field(default_factory=dict)
    """All else in the file, with the reason why it is no column."""

    def array(self, name: str) -> LogArray:
        """Return an array, or with ``name[2]`` one column of it.

        Raises:
            LogError: there is no such array, or column, or it is none of numbers.
        """
        if name in self.arrays:
            return self.arrays[name]
        for parent, reason in self.refused.items():
            if name == parent or name.startswith((parent + ".", parent + "[")):
                raise LogError(f"{self.path.name}: {parent} {reason}")
        stem, _, index = name.removesuffix("]").rpartition("[")
        if not (stem and index.isdecimal() and name.endswith("]")):
            stem = name
        elif stem in self.arrays:
            whole, k = self.arrays[stem], int(index)
            if k >= whole.values.shape[1]:
                raise LogError(
                    f"{stem} has {whole.values.shape[1]} columns, so the last is {stem}[{whole.values.shape[1] - 1}]"
                )
            return replace(whole, values=whole.values[:, k : k + 1])
        known = [*self.arrays, *self.refused]
        near = get_close_matches(stem, known, 3, 0.5)
        raise LogError(
            f"{self.path.name} has no column {name!r}; "
            f"{'similar are' if near else 'it has'} {', '.join(near or known[:12])}",
            near[0] + name[len(stem) :] if near else "",
        )

    def put(self, name: str, found: Any, rows: int | None = None, unit: str | None = None) -> None:
        """Keep what was found under a name: numbers (n, k) or (n,), texts, or the reason why it is no column.

        Args:
            rows: how many rows most of the file's arrays have: which of two dimensions is time. The longer is by default.
            unit: what the file says.
        """
        numbers = np.asarray(found)
        if numbers.dtype.kind in "US" and numbers.ndim == 1:
            self.texts[name] = [str(text) for text in numbers.tolist()]
            self.refused[name] = "is text"
            return
        if numbers.dtype.names:
            for part in numbers.dtype.names:
                self.put(f"{name}.{part}", numbers[part], rows, unit)
            return
        if numbers.dtype.kind in "Mm":  # times, the moments that are none among them
            missing = np.isnat(numbers)
            count = numbers.astype(f"{numbers.dtype.kind}8[ns]").astype(np.int64)
            numbers, unit = (np.where(missing, np.nan, count) if missing.any() else count), "ns"
        if numbers.ndim > 2:  # MATLAB's loggers write columns x 1 x rows
            numbers = numbers.squeeze()
        reason = _no_column(numbers)
        if reason:
            self.refused[name] = reason
            return
        if numbers.ndim == 2:
            if rows in numbers.shape:
                numbers = numbers if numbers.shape[0] == rows else numbers.T
            elif numbers.shape[0] < numbers.shape[1]:
                numbers = numbers.T
        table = numbers.reshape(len(numbers), -1)
        exact = table.shape[1] == 1 and table.dtype.kind in "iu" and _EXACT < table.max() < 2**63
        whole = np.ascontiguousarray(table[:, 0], np.int64) if exact else None
        self.arrays[name] = LogArray(
            np.ascontiguousarray(table, np.float64), unit=unit, whole=whole
        )


def _no_column(numbers: Array) -> str:
    """Return why an array is no column of a log; empty where it is one."""
    kinds = {"c": "has complex numbers", "U": "is text", "S": "is text", "O": "has objects"}
    if numbers.dtype.kind not in "fiub":
        return kinds.get(numbers.dtype.kind, f"has values of the type {numbers.dtype}")
    if numbers.ndim > 2:
        shape = " x ".join(map(str, numbers.shape))
        return f"has {numbers.ndim} dimensions ({shape}), expected rows, or rows and columns"
    if numbers.size < 2:
        return "has one row" if numbers.size else "is empty"
    return ""


def usual_rows(found: Mapping[str, Any]) -> int | None:
    """Return the length that most arrays have."""
    lengths = [max(np.shape(each)) for each in found.values() if np.ndim(each)]
    return max(dict.fromkeys(lengths), key=lengths.count) if lengths else None


def bounded(path: Path, size: int) -> None:
    """Refuse more numbers than are read.

    Raises:
        LogError: they are.
    """
    if size > MOST_BYTES:
        raise LogError(f"{path.name} has more than {MOST_BYTES / 1e9:g} GB of numbers")


def read_log(path: Path) -> LogFile:
    """Read a log by the ending of its name; a folder is a ROS 2 bag.

    Raises:
        LogError: it cannot be read, or is larger than the memory allowed for it.
    """
    if not path.exists():
        raise LogError(f"cannot read {path.name}: there is no such file")
    module, _, function = _reader(path).partition(":")
    try:
        reader = getattr(import_module(f".{module}", __package__), function)
        log: LogFile = reader(path)
    except LogError:
        raise
    except ModuleNotFoundError as error:
        extra = {"h5py": "hdf5", "rosbags": "mcap"}.get(str(error.name), str(error.name))
        raise LogError(f"{path.name} needs {error.name}: {pip_line(extra)}") from None
    except OSError as error:
        raise LogError(f"cannot read {path.name}: {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001  whatever is wrong with a file is said of the file
        raise LogError(
            f"cannot read {path.name}: {str(error) or type(error).__name__}; is it whole?"
        ) from None
    if not log.arrays:
        why = "".join(f"; {name} {reason}" for name, reason in list(log.refused.items())[:6])
        raise LogError(f"{path.name} has no columns of numbers{why}")
    return log


def _reader(path: Path) -> str:
    if path.is_dir():
        if path.suffix == ".bag":
            raise LogError(
                f"{path.name} is a folder that is called like a file of ROS 1: rename it"
            )
        return "bags:read_bag"
    ending = path.suffix.lower()
    if ending == ".db3" or path.name.endswith((".db3.zstd", ".mcap.zstd")):
        raise LogError(
            f"{path.name} is a part of a ROS 2 bag: give its folder, which has a metadata.yaml"
        )
    if ending in (".gz", ".bz2", ".xz", ".zst", ".zstd", ".zip"):
        raise LogError(f"{path.name} is compressed: unpack it first")
    if ending not in _ENDINGS:
        raise LogError(
            f"{path.name}: a log is HDF5 (.h5, .hdf5, .mat of MATLAB 7.3), .npz, .csv, .parquet, .mcap, .rrd, or the "
            "folder of a ROS 2 bag"
        )
    return _ENDINGS[ending]
