"""Recorded signals as a table with one column for each number, called ``block.port.field[i, j]``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

from .format import RecordedField

TICK, TIME = "tick", "t"
"""The first two columns; the second is in seconds."""


class SignalSource(Protocol):
    """The part of a read recording that tables need."""

    @property
    def ticks(self) -> NDArray[np.int64]:
        """The recorded ticks, (ticks,)."""

    @property
    def time(self) -> NDArray[np.float64]:
        """Their times [s], (ticks,)."""

    @property
    def rows(self) -> NDArray[np.uint8]:
        """All signals' bytes at every tick, (ticks, bytes)."""

    def signals(self) -> Mapping[str, RecordedField]:
        """Return the recorded signals by name."""

    def nearest(self, name: str) -> NoReturn:
        """Raise the ``KeyError`` that names the signals nearest to a wrong name."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return one signal at every tick, (ticks, ...)."""


def flat_columns(run: SignalSource, names: Sequence[str] = ()) -> dict[str, NDArray[Any]]:
    """Return ``tick``, ``t`` and every number of some signals, by default of all, each (ticks,).

    Args:
        run: the recording.
        names: of signals, or the beginnings of such, ``dynamics`` or ``dynamics.terms``.

    Raises:
        KeyError: no signal has such a name or beginning.
    """
    columns: dict[str, NDArray[Any]] = {TICK: run.ticks, TIME: run.time}
    fields = chosen(run, names)
    if len(fields) > 1:
        _ = run.rows  # read all at once, not the file anew for each
    for field in fields:
        values = run[field.name]
        for place in np.ndindex(field.shape):
            columns[column_name(field, place)] = values[(slice(None), *place)]
    return columns


def chosen(run: SignalSource, names: Sequence[str]) -> list[RecordedField]:
    """Return the signals that ``names`` mean, in the order of the file; all of them without names.

    Raises:
        KeyError: no signal has such a name or beginning.
    """
    known = run.signals()
    if not names:
        return list(known.values())
    for name in names:
        if not any(_means(name, signal) for signal in known):
            run.nearest(name)
    return [known[s] for s in known if any(_means(name, s) for name in names)]


def _means(name: str, signal: str) -> bool:
    return signal == name or signal.startswith((f"{name}.", f"{name}/"))


def column_name(field: RecordedField, place: Sequence[int]) -> str:
    """Return the name of the column of one number of a field."""
    return f"{field.name}[{', '.join(map(str, place))}]" if len(place) else field.name


def units(run: SignalSource, names: Sequence[str] = ()) -> Mapping[str, str]:
    """Return the unit of every column that has one, as text."""
    found = {TIME: "s"}
    for field in chosen(run, names):
        if field.unit is not None:
            found |= {column_name(field, place): field.unit for place in np.ndindex(field.shape)}
    return found
