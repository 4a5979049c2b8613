"""HDF5 files, those of MATLAB 7.3 among them, and NPZ archives as logs: arrays by their path."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ...mathematics.arrays import Array1D
from .columns import MOST_APART, usual_step
from .log_file import LogError, LogFile, bounded, usual_rows
from .matlab_texts import matlab_texts

_STAMPS = ("timestamps", "stamps", "time")
"""Names of a group's stamps, the likeliest first."""


def read_npz(path: Path) -> LogFile:
    """Read the arrays of an NPZ archive."""
    log, found = LogFile(path), {}
    with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
        bounded(path, sum(info.file_size for info in archive.zip.infolist()))
        for name in archive.files:
            try:
                found[name] = archive[name]
            except (
                ValueError
            ) as error:  # objects, which are not unpickled, or an array that is cut off
                log.refused[name] = f"cannot be read: {error}"
    return _filled(log, found, {})


def read_hdf5(path: Path) -> LogFile:
    """Read the datasets of an HDF5 file; a structure of MATLAB is a group, and a cell array of texts a list of them."""
    h5py = import_module("h5py")
    if not h5py.is_hdf5(path):
        with path.open("rb") as raw:
            old = raw.read(6) == b"MATLAB"
        raise LogError(
            f"{path.name} is {'a file of MATLAB before 7.3' if old else 'no HDF5 file'}; MATLAB writes one with "
            "save(..., '-v7.3')"
        )
    log, found, units, size = LogFile(path), {}, {}, 0
    with h5py.File(path, "r") as file:

        def visit(name: str, item: Any) -> None:
            nonlocal size
            if not isinstance(item, h5py.Dataset) or name.startswith("#"):
                return
            if item.external or item.is_virtual:  # only what is inside of the file is read
                log.refused[name] = "is kept in another file"
                return
            size += item.nbytes
            bounded(path, size)
            try:
                value = _value_of(h5py, file, item)
            except _NoColumnError as error:
                log.refused[name] = str(error)
                return
            found[name] = value
            unit = item.attrs.get("unit", item.attrs.get("units"))
            units[name] = unit.decode() if isinstance(unit, bytes) else unit

        file.visititems(visit)
    return _with_own_stamps(_filled(log, found, units))


def _with_own_stamps(log: LogFile) -> LogFile:
    """Give arrays of a group, a structure of MATLAB, the stamps of that group as their own; those of an unknown unit are left alone."""
    stamps: dict[str, Array1D] = {}
    for name in _STAMPS:
        for path, each in log.arrays.items():
            group, _, own = path.rpartition("/")
            if group and own == name and each.values.shape[1] == 1 and group not in stamps:
                factor = {None: 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}.get(each.unit)
                times = each.values[:, 0] * (factor or np.nan)
                if usual_step(times) <= MOST_APART:
                    stamps[group] = times
    first = min((float(times[0]) for times in stamps.values()), default=0.0)
    for path, each in log.arrays.items():
        own_stamps = stamps.get(path.rpartition("/")[0])
        if own_stamps is not None and len(own_stamps) == len(each.values):
            log.arrays[path] = replace(each, stamps=own_stamps - first)
    return log


class _NoColumnError(Exception):
    """A dataset that is no column; the text says what it is."""


def _value_of(h5py: Any, file: Any, item: Any) -> Any:
    """Return a dataset's numbers or texts."""
    kind = item.attrs.get("MATLAB_class", b"")
    if "MATLAB_empty" in item.attrs or item.shape is None:
        raise _NoColumnError("is empty")
    if (texts := matlab_texts(file, item)) is not None:
        return np.array(texts)
    if kind in (b"char", b"string"):
        raise _NoColumnError("is text")
    if h5py.check_string_dtype(item.dtype) is not None:
        if item.ndim != 1:
            raise _NoColumnError("is text")
        return np.array([str(text) for text in item.asstr()[()]])
    if h5py.check_ref_dtype(item.dtype) is not None:
        raise _NoColumnError("is a cell array, of which only one of texts is read")
    if item.dtype.names == ("real", "imag"):
        raise _NoColumnError("has complex numbers")
    if item.dtype.kind not in "fiubcV":
        raise _NoColumnError(f"has values of the type {item.dtype}")
    return item[()]


def _filled(log: LogFile, found: dict[str, Any], units: dict[str, Any]) -> LogFile:
    rows = usual_rows({name: each for name, each in found.items() if each.dtype.kind in "fiub"})
    for name, values in found.items():
        unit = units.get(name)
        log.put(name, values, rows, unit if isinstance(unit, str) else None)
    return log
