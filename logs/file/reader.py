"""Recordings, read back: every signal of every tick with its unit, keyframes, notes, the outcome.

::

    run = aloft.logs.read("recordings/jump.rrd")
    run["dynamics.terms.com"]           # (ticks, 3), exactly what the graph computed
    run.signals()["dynamics.terms.com"].unit
    run.snapshot(run.keyframes[-1])     # from which a bound graph can go on
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from ...robots.robot_description import RobotDescription
from ...runtime.language.layout import only_field
from ...runtime.running.sink import Note
from ...runtime.running.snapshot import Snapshot
from .format import FORMAT, Header, RecordedField, RecordedRows
from .packed_rows import MOST_KEPT, PackedRows, TickRows
from .records import (
    Content,
    Damage,
    Record,
    RecordingError,
    Scan,
    expect_intact,
    find_records,
)
from .row_codec import unpack_keyframe

if TYPE_CHECKING:
    from ...runtime.language.parameter_change import ParameterChange


__all__ = ["RecordedRun", "RecordingError", "read"]

LAST_WITHOUT_NAME = "0.2.0 as it was before 28 November 2026"
"""The version of aloft that reads the formats up to 5, whose files do not name the version that wrote them."""
READ_ALONE = 3
"""Signals that are each taken from the file for themselves. Who asks for more wants many, and one
reading of everything is faster then."""


@dataclass(frozen=True)
class RecordedRun:
    """A recording that is open for reading. Large parts are read when they are first used.

    Attributes:
        path: the file.
        header: all that was known before the first tick: graph, overrides, seeds, versions,
            layouts, robot.
        outcome: what ``RunResult.to_json`` gave; ``None`` if the recording was cut off.
        notes: life cycle, overruns, faults, parameter changes and dropped ticks, in order.
        scan: the intact records of the file.
    """

    path: Path
    header: Header
    outcome: Mapping[str, Any] | None
    notes: tuple[Note, ...]
    scan: Scan

    @property
    def damage(self) -> tuple[Damage, ...]:
        """The parts of the file that are not what was written; ``read`` refuses such a file unless
        it is told otherwise."""
        return self.scan.damage

    @property
    def whole(self) -> bool:
        """True if the run's outcome is there, the file was closed, and every checksum is right."""
        return self.outcome is not None and self.scan.closed and not self.scan.damage

    @cached_property
    def _source(self) -> PackedRows:
        return PackedRows(self.scan, self.header)

    def signals(self) -> Mapping[str, RecordedField]:
        """Return every recorded signal by ``block.port.field``, with unit, frame, shape and text."""
        return {field.name: field for field in self.header.bus.fields if not field.constant}

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return one signal at every recorded tick, (ticks, ...), in its own dtype. A port of one
        field may stand for its field, as in wires.

        Raises:
            KeyError: there is no such signal; the message has the nearest names.
        """
        field = self._field(name)
        self._asked.add(field.name)
        whole = len(self.ticks) * self.header.bus.size
        if "rows" in self.__dict__ or (len(self._asked) > READ_ALONE and whole <= MOST_KEPT):
            return self.header.bus.layout().view(self.rows, field.name)
        return self._source.signal(field)

    def _field(self, name: str) -> RecordedField:
        known = self.signals()
        return known[name if name in known else only_field(name, known) or self.nearest(name)]

    def samples(self, name: str) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """Return the ticks at which a signal is kept, (n,), and its values there, (n, ...): a large field of a
        slow block where the block ran, any other in every tick.

        Raises:
            KeyError: there is no such signal; the message has the nearest names.
        """
        return self._source.samples(self._field(name))

    @cached_property
    def _asked(self) -> set[str]:
        """The requested signals; nothing depends on their order."""
        return set()

    def nearest(self, name: str) -> NoReturn:
        """Raise the ``KeyError`` for an unknown signal; its message has the nearest names."""
        near = get_close_matches(name, self.signals(), 3, 0.0)
        raise KeyError(f"no signal {name!r}; the nearest are {', '.join(near)}")

    def to_pandas(self, *names: str) -> Any:
        """Return some signals, by default all, as a pandas ``DataFrame``: one column a number,
        called ``block.port.field[i]``, by time [s]. Raises ``ImportError`` without pandas."""
        import pandas

        from .table import TIME, flat_columns

        return pandas.DataFrame(flat_columns(self, names)).set_index(TIME)

    def to_polars(self, *names: str) -> Any:
        """Return the same columns as a polars ``DataFrame``. Raises ``ImportError`` without polars."""
        import polars

        from .table import flat_columns

        return polars.DataFrame(flat_columns(self, names))

    @property
    def ticks(self) -> NDArray[np.int64]:
        """The recorded ticks, (ticks,), in order; those that were dropped are not among them."""
        return self._source.ticks

    @property
    def time(self) -> NDArray[np.float64]:
        """The time of every recorded tick [s], (ticks,)."""
        return self.ticks / self.header.base_rate

    @cached_property
    def rows(self) -> NDArray[np.uint8]:
        """The bytes of the bus after every recorded tick, (ticks, bytes): exactly as they were.

        All of them are in memory then; ``pieces`` and ``window`` need less.
        """
        return self._source.rows()

    def pieces(self, first: int | None = None, last: int | None = None) -> Iterator[TickRows]:
        """Yield ticks (n,) and rows (n, bytes) from tick ``first`` up to, without, ``last``, some
        hundred at a time and each read from the file when it is asked for."""
        ticks = self.ticks
        if not len(ticks):
            return iter(())
        low = int(ticks[0]) if first is None else first
        return self._source.pieces(low, int(ticks[-1]) + 1 if last is None else last)

    def batches(self, least: int = 1) -> Iterator[RecordedRows]:
        """Yield all ticks in order, at least ``least`` at a time but for the last batch; none is
        kept."""
        waiting: list[TickRows] = []
        for piece in self.pieces():
            waiting.append(piece)
            if sum(len(ticks) for ticks, _ in waiting) >= least:
                yield self._batch(waiting)
                waiting = []
        if waiting:
            yield self._batch(waiting)

    def no_rows(self) -> RecordedRows:
        """Return a batch without ticks."""
        return self._batch([(np.zeros(0, np.int64), np.zeros((0, self.header.bus.size), np.uint8))])

    def _batch(self, pieces: list[TickRows]) -> RecordedRows:
        ticks, rows = zip(*pieces, strict=True)
        layout = self.header.bus.layout()
        return RecordedRows(self.header, np.concatenate(ticks), np.concatenate(rows), layout)

    def window(self, first: int, last: int) -> TickRows:
        """Return the ticks from ``first`` up to, without, ``last``, (n,), and their rows, (n,
        bytes)."""
        found = list(self.pieces(first, last))
        if not found:
            return np.zeros(0, np.int64), np.zeros((0, self.header.bus.size), np.uint8)
        ticks, rows = zip(*found, strict=True)
        return np.concatenate(ticks), np.concatenate(rows)

    @cached_property
    def _keyframes(self) -> Mapping[int, Record]:
        return {record.first: record for record in self.scan.of(Content.KEYFRAME)}

    @property
    def keyframes(self) -> tuple[int, ...]:
        """The ticks before which a full snapshot was taken, in order."""
        return tuple(self._keyframes)

    def snapshot(self, tick: int) -> Snapshot:
        """Return the keyframe at ``tick``, for ``BoundGraph.restore``.

        Raises:
            KeyError: there is no keyframe at that tick.
        """
        record = self._keyframes[tick]
        data = self.scan.payload(record)
        try:
            return Snapshot(tick, *unpack_keyframe(data, record.whole))
        except ValueError as error:
            raise self.scan.unreadable(record, error) from error

    @property
    def parameter_changes(self) -> tuple[ParameterChange, ...]:
        """Every live change of a parameter, in order."""
        from ...runtime.language.parameter_change import ParameterChange

        return tuple(ParameterChange(**n.data) for n in self.notes if n.kind == "parameter")

    @property
    def dropped_ticks(self) -> int:
        """The number of ticks that found no room in the recorder, as its notes say."""
        return sum(int(note.data["count"]) for note in self.notes if note.kind == "dropped")

    @property
    def missing_ticks(self) -> int:
        """The number of ticks that were run but are not in the recording, as far as it shows: those
        between recorded ticks and, if the outcome is there, those at the beginning and the end."""
        ticks = self.ticks
        if self.outcome is not None and "ticks" in self.outcome:
            whole = int(self.outcome["ticks"]) - self.header.earlier_ticks
            return max(0, whole - len(ticks))
        return int(ticks[-1] - self.header.first_tick + 1 - len(ticks)) if len(ticks) else 0


def scan(path: Path) -> Scan:
    """Look through a whole file, and verify every checksum; see ``find_records``.

    Raises:
        OSError: it cannot be read.
        RecordingError: neither aloft nor Rerun can read it.
    """
    found, foreign = find_records(path)
    if not foreign:
        return found
    from .rewritten import read_again  # imports what only such files need

    try:
        return read_again(found)
    except RecordingError:
        if found.damage:
            return found  # bytes are missing, or there are too many
        raise


def read(path: str | PathLike[str], *, damaged: bool = False) -> RecordedRun:
    """Open a recording, also one that is being written just now. Every checksum is verified.

    Args:
        path: the file.
        damaged: open also a file with damage; the ticks that it has taken are then missing.

    Raises:
        FileNotFoundError: there is no such file.
        DamagedError: bytes have changed since they were written; the message names the lost ticks.
        NoRunError: it is a file of Rerun's, but no run was recorded into it.
        RecordingError: it is no such file, or was written by a later version.
    """
    path = Path(path)
    found = scan(path)
    if not damaged:
        expect_intact(found)
    texts = {
        record.content: found.text(record)
        for record in found.of(Content.START, Content.FILES, Content.OUTCOME)
    }
    if Content.START not in texts:
        expect_intact(found)
        _expect_format(path, *(found.maker or (FORMAT, "")))
        if found.rewritten is not None and found.records:
            raise RecordingError(
                f"{_left_out(path)} the header; use the recording as aloft wrote it"
            )
        raise RecordingError(f"{path} was cut off before its beginning was written")
    _expect_format(path, *_made_by(texts[Content.START]))
    try:
        header = Header.from_json(texts[Content.START])
        header = replace(header, contents=json.loads(texts.get(Content.FILES, "{}")))
        header.expect_possible()
        notes = tuple(
            Note(**note)
            for record in found.of(Content.NOTES)
            for note in json.loads(found.text(record))
        )
        outcome = json.loads(texts[Content.OUTCOME]) if Content.OUTCOME in texts else None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        reason = _reason(error)
        raise RecordingError(f"{path} has a header that aloft does not write: {reason}") from error
    run = RecordedRun(path, header, outcome, notes, found)
    if found.rewritten is not None and not damaged:
        _expect_nothing_left_out(run)
    return run


def _reason(error: Exception) -> str:
    """Return in one line what is wrong with a header."""
    from pydantic import ValidationError

    if isinstance(error, ValidationError):
        from ...files.validation import describe

        return describe(error.errors(include_url=False)[0], RobotDescription)
    return " ".join(str(error).split())


def _expect_format(path: Path, number: Any, maker: str) -> None:
    """Raise ``RecordingError`` for a file of another format."""
    if number == FORMAT:
        return
    newer = isinstance(number, int) and number > FORMAT
    fix = (
        f"update aloft to {maker or 'a newer one'}" if newer
        else f"read it with aloft {maker or LAST_WITHOUT_NAME}"
    )  # fmt: skip
    raise RecordingError(f"{path} has format {number}, this version of aloft reads {FORMAT}; {fix}")


def _left_out(path: Path) -> str:
    return f"{path} was written again by another program, which left out"


def _expect_nothing_left_out(run: RecordedRun) -> None:
    """Raise ``RecordingError`` where another program that wrote the file again has left something out."""
    by = _left_out(run.path)
    lost = run.missing_ticks - run.dropped_ticks
    if run.outcome is not None and lost > 0:
        raise RecordingError(
            f"{by} {lost} ticks, as `rerun rrd split` and `filter` do; it has {len(run.ticks)}. Use the recording "
            "as aloft wrote it; aloft.logs.read(FILE, damaged=True) reads the rest"
        )
    records = run.scan.records
    lost = records[-1].number + 1 - len(records)
    if lost or not run.scan.closed:
        raise RecordingError(
            f"{by} {lost or 'the last'} records, such as keyframes or notes. Use the recording as aloft wrote it; "
            "aloft.logs.read(FILE, damaged=True) reads the rest"
        )


def _made_by(header: str) -> tuple[Any, str]:
    """Return the number of the format and the version of aloft that wrote it, as far as a header says."""
    try:
        data = json.loads(header)
        return data.get("format", 0), str(data.get("versions", {}).get("aloft", ""))
    except (ValueError, AttributeError):
        return 0, ""
