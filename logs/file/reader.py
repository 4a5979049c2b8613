"""Recordings, read back: every signal of every tick with its unit, keyframes, notes, the outcome.

::

    run = aloft.logs.read("recordings/jump.rrd")
    run["dynamics.terms.com"]           # (ticks, 3), exactly what the graph computed
    run.signals()["dynamics.terms.com"].unit
    run.snapshot(run.keyframes[-1])     # from which a bound graph can go on
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ...runtime.language.errors import AloftError
from ...runtime.language.parameter_change import ParameterChange
from ...runtime.running.memory import Snapshot
from ...runtime.running.notes import Note
from .changed_rows import filled
from .format import (
    BUS,
    EXACT,
    FORMAT,
    KEYFRAMES,
    NOTE,
    NOTES,
    RECORDED,
    SIGNALS,
    SPAN,
    STATE,
    Header,
    RecordedField,
    entity_of,
)
from .tail import read_tail


class RecordingError(AloftError):
    """Raised for a file that is no recording or that is damaged. The message says what to do."""


@dataclass(frozen=True)
class RecordedRun:
    """A recording that is open for reading. Large parts are read when they are first used.

    Attributes:
        path: the file.
        header: all that was known before the first tick: graph, overrides, seeds, versions,
            layouts, robot.
        outcome: what ``RunResult.to_json`` gave; ``None`` if the recording was cut off.
        notes: life cycle, overruns, faults, parameter changes and dropped ticks, in order.
    """

    path: Path
    header: Header
    outcome: Mapping[str, Any] | None
    notes: tuple[Note, ...]

    def signals(self) -> Mapping[str, RecordedField]:
        """Every recorded signal by ``block.port.field``, with unit, frame, shape and text."""
        return {field.name: field for field in self.header.bus.fields if not field.constant}

    def __getitem__(self, name: str) -> NDArray[Any]:
        """One signal at every recorded tick, (ticks, ...), in its own dtype.

        Raises:
            KeyError: there is no such signal; the message has the nearest names.
        """
        known = self.signals()
        if name not in known:
            self.nearest(name)
        if "rows" in self.__dict__:
            return self.header.bus.layout().view(self.rows, name)
        return self._whole(known[name], self._batches(known[name]))

    def nearest(self, name: str) -> NoReturn:
        """Raise the ``KeyError`` for an unknown signal; its message has the nearest names."""
        near = get_close_matches(name, self.signals(), 3, 0.0)
        raise KeyError(f"no signal {name!r}; the nearest are {', '.join(near)}")

    def to_pandas(self, *names: str) -> Any:
        """Some signals, by default all, as a pandas ``DataFrame``: one column a number, called
        ``block.port.field[i]``, by time [s]. Raises ``ImportError`` without pandas."""
        import pandas

        from .table import TIME, flat_columns

        return pandas.DataFrame(flat_columns(self, names)).set_index(TIME)

    def to_polars(self, *names: str) -> Any:
        """The same columns as a polars ``DataFrame``. Raises ``ImportError`` without polars."""
        import polars

        from .table import flat_columns

        return polars.DataFrame(flat_columns(self, names))

    @cached_property
    def ticks(self) -> NDArray[np.int64]:
        """The recorded ticks, (ticks,), in order; those that were dropped are not among them."""
        tail, _ = self._tail  # first, as what is taken out of it later is in the file by then
        return np.unique(np.concatenate([tail, self.written_ticks()]))

    def written_ticks(self) -> NDArray[np.int64]:
        """The ticks that are in the file itself; the other ticks are in its tail."""
        found = [np.zeros(0, np.int64)]
        for _, batch in _stream(self.path, f"/{RECORDED}"):
            for first, last in batch[f"aloft:{SPAN}"].to_pylist():
                found.append(np.arange(first, last + 1))
        return np.unique(np.concatenate(found))

    @cached_property
    def _tail(self) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Ticks and rows that were not in the file yet when the recording was cut off."""
        size = self.header.bus.size
        if self.outcome is not None:  # a tail that is there is another run's
            return np.zeros(0, np.int64), np.zeros((0, size), np.uint8)
        return read_tail(self.path, size)

    @property
    def time(self) -> NDArray[np.float64]:
        """The time of every recorded tick [s], (ticks,)."""
        return self.ticks / self.header.base_rate

    @cached_property
    def rows(self) -> NDArray[np.uint8]:
        """The bytes of the bus after every recorded tick, (ticks, bytes): exactly as they were."""
        by_entity: dict[str, list[Any]] = {}
        for entity, batch in _stream(self.path, f"/{SIGNALS}/**"):
            by_entity.setdefault(entity, []).append(batch)
        layout = self.header.bus.layout()
        start = np.frombuffer(self.header.bus_start, np.uint8)
        rows = np.tile(start, (len(self.ticks), 1))
        for field in self.signals().values():
            batches = by_entity.pop(f"/{entity_of(SIGNALS, field.name)}", [])
            first, last = layout.byte_range(field.name)
            flat = self._whole(field, batches).reshape(len(rows), math.prod(field.shape))
            rows[:, first:last] = np.ascontiguousarray(flat).view(np.uint8)
        return rows

    @cached_property
    def _snapshots(self) -> Mapping[int, Snapshot]:
        found = {}
        for _, batch in _stream(self.path, f"/{KEYFRAMES}"):
            for k, tick in enumerate(batch["tick"].to_pylist()):
                parts = {
                    name: batch[f"aloft:{name}"][k].values.to_numpy().tobytes()
                    for name in (BUS, STATE)
                    if f"aloft:{name}" in batch.schema.names
                }
                found[tick] = Snapshot(tick, parts.get(BUS, b""), parts.get(STATE, b""))
        return dict(sorted(found.items()))

    @property
    def keyframes(self) -> tuple[int, ...]:
        """The ticks before which a full snapshot was taken, in order."""
        return tuple(self._snapshots)

    def snapshot(self, tick: int) -> Snapshot:
        """The keyframe at ``tick``, for ``BoundGraph.restore``.

        Raises:
            KeyError: there is no keyframe at that tick.
        """
        return self._snapshots[tick]

    @property
    def parameter_changes(self) -> tuple[ParameterChange, ...]:
        """Every live change of a parameter, in order."""
        return tuple(ParameterChange(**n.data) for n in self.notes if n.kind == "parameter")

    @property
    def dropped_ticks(self) -> int:
        """The number of ticks of the run that are not in the recording."""
        return sum(int(note.data["count"]) for note in self.notes if note.kind == "dropped")

    def _batches(self, field: RecordedField) -> Iterator[Any]:
        entity = f"/{entity_of(SIGNALS, field.name)}"
        return (batch for name, batch in _stream(self.path, entity) if name == entity)

    def _whole(self, field: RecordedField, batches: Iterable[Any]) -> NDArray[Any]:
        """The value at each of ``ticks``, also at those where an unchanged value was left out."""
        if not len(self.ticks):
            return np.zeros((0, *field.shape), field.dtype)
        tail_ticks, tail = self._tail
        ticks = [tail_ticks]
        parts = [self.header.bus.layout().view(tail, field.name)]
        for batch in batches:
            name = f"aloft:{EXACT}" if field.dtype == "int64" else "Scalars:scalars"
            ticks.append(batch["tick"].to_numpy())
            values = batch[name].flatten().to_numpy().astype(field.dtype, copy=False)
            parts.append(values.reshape(len(ticks[-1]), *field.shape))
        return filled(self.ticks, np.concatenate(ticks), np.concatenate(parts))


def read(path: str | PathLike[str]) -> RecordedRun:
    """Open a recording.

    Raises:
        FileNotFoundError: there is no such file.
        RecordingError: it is not a recording of aloft's, is cut in the middle of a message, or was
            written by a later version.
        ImportError: Rerun is not installed.
    """
    path = Path(path)
    with path.open("rb"):
        pass
    texts = _properties(path)
    if "header" not in texts:
        raise RecordingError(f"{path} is a Rerun file, but not a recording of a run by aloft")
    number = json.loads(texts["header"]).get("format", 0)
    if number != FORMAT:
        newer = "update aloft" if number > FORMAT else "read it with an older one"
        raise RecordingError(
            f"{path} has format {number}, this version of aloft reads {FORMAT}; {newer}"
        )
    notes = [
        (row, Note(**json.loads(text)))
        for _, batch in _stream(path, f"/{NOTES}")
        for row, text in zip(
            batch["rerun.controls.RowId"].to_pylist(),  # these grow in the order of writing
            batch[f"aloft:{NOTE}"].flatten().to_pylist(),
            strict=True,
        )
    ]
    outcome = json.loads(texts["outcome"]) if "outcome" in texts else None
    ordered = tuple(note for _, note in sorted(notes, key=lambda entry: entry[0]))
    return RecordedRun(path, Header.from_json(texts["header"]), outcome, ordered)


def _properties(path: Path) -> dict[str, str]:
    """The texts under ``__properties``, by name."""
    found = {}
    for entity, batch in _stream(path, "/__properties/**", static=True):
        for name in batch.schema.names:
            key = name.rpartition(":")[2]
            values = batch[name].to_pylist()[0]
            if entity.startswith("/__properties/") and isinstance(values, list) and values:
                found[key] = str(values[0])
    return found


def _stream(path: Path, content: str, *, static: bool = False) -> Iterator[tuple[str, Any]]:
    """Entity and Arrow record batch of every matching chunk, in no particular order."""
    from rerun.chunk import RrdReader

    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "RRD file has no footer")  # it is being written
            reader = RrdReader(path)
        for chunk in reader.stream().filter(content=content):
            if chunk.is_static == static:
                # Rerun escapes what is no letter, as in the names of blocks that loading inserts
                yield str(chunk.entity_path).replace("\\", ""), chunk.to_record_batch()
    except (RuntimeError, ValueError, OSError) as error:
        raise RecordingError(
            f"{path} cannot be read ({error}); if a recording was cut off, mend it with "
            f"'aloft log repair {path}'"
        ) from error
