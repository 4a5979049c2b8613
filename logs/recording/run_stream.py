"""Writes a run to a Rerun stream, which is a file or a live viewer; see ``format``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...runtime.running.notes import Note
from ..file.changed_rows import ChangedRows
from ..file.format import (
    EVENTS,
    GRAPH,
    LIMITS,
    NOTE,
    NOTES,
    SIGNALS,
    TIMES,
    Header,
    RecordedField,
    RecordedRows,
    entity_of,
)
from ..file.time_columns import time_columns, timed
from ..viewing.block_times import times_table
from ..viewing.limits import limits_of
from ..viewing.plot_views import EVERY_VALUE
from ..viewing.scene import Scene
from ..viewing.scene_part import Colors
from ..viewing.scene_ports import scene_ports
from ..viewing.signal_names import axis_colors, element_names
from ..viewing.state_lanes import LaneReader, all_lanes

LIMIT_COLOR = 0x9E9E9EB0


class RunStream:
    """One run in a stream.

    Args:
        stream: the Rerun stream. The caller opens and closes it.
        header: what is known before the first tick.
        root: a prefix of all entities, such as ``first/``, where a stream holds several runs.
        rate: how often signals are written [1/s]; by default in every tick.
        most: fields with more elements than this are left out; by default none is.
        colors: the colours in which this run is drawn.
        changes_only: leave signals out where they do not change; see ``changed_rows``. Then
            ``write_rest`` comes last.
        label: what the run is called in events, where a stream holds several.
    """

    def __init__(
        self,
        stream: Any,
        header: Header,
        *,
        root: str = "",
        rate: float | None = None,
        most: int | None = None,
        colors: Colors | None = None,
        changes_only: bool = False,
        label: str = "",
    ) -> None:
        self._label = f"{label}: " if label else ""
        self.stream, self.header, self._root = stream, header, root
        self._layout = header.bus.layout()
        self._every = 1 if rate is None else max(1, round(header.base_rate / rate))
        self._fields = [
            field
            for field in header.bus.fields
            if not field.constant and (most is None or np.prod(field.shape) <= most)
        ]
        self._changed = {field.name: ChangedRows() for field in self._fields if changes_only}
        names = {field.name for field in self._fields}
        lanes = [lane for lane in all_lanes(header) if lane.field.name in names]
        self._lanes, self._reader = lanes, LaneReader(lanes)
        self._limits = [
            (field, limits) for field in self._fields if (limits := limits_of(field, header))
        ]
        ports = scene_ports(header)
        self._scene = None
        if ports is not None:
            self._scene = Scene(stream, header, ports, root, colors or Colors())

    def write_start(self) -> None:
        """Write what does not change: the graph, legends, colours and shapes."""
        import rerun as rr

        stream, robot = self.stream, self.header.robot
        text = rr.TextDocument(self.header.graph, media_type="text/plain")
        stream.log(f"{self._root}{GRAPH}", text, static=True)
        for field in self._fields:
            names = element_names(field, robot)
            lines = rr.SeriesLines(
                names=names or None,
                colors=axis_colors(field) if names else None,
                aggregation_policy=EVERY_VALUE,
            )
            stream.log(self._entity(SIGNALS, field), lines, static=True)
        for field, limits in self._limits:
            grey = np.full(len(limits), LIMIT_COLOR, np.uint32)
            lines = rr.SeriesLines(
                names=[name for name, _ in limits],
                colors=grey,
                widths=[1.0] * len(limits),
                aggregation_policy=EVERY_VALUE,
            )
            stream.log(self._entity(LIMITS, field), lines, static=True)
        for lane in self._lanes:
            colors = np.array(lane.colors, np.uint32)
            looks = rr.StateConfiguration(values=list(lane.labels.values()), colors=colors)
            stream.log(f"{self._root}{lane.entity}", looks, static=True)
        if self._scene is not None:
            self._scene.write_static()

    def write_rows(self, ticks: NDArray[np.int64], rows: NDArray[np.uint8]) -> None:
        """Write the bus (n, bytes) after each of ``ticks`` (n,), which come in order."""
        if not len(ticks):
            return
        batch = RecordedRows(self.header, ticks, rows, self._layout)
        self._write_signals(batch)
        self._write_limits(batch)
        self._write_states(batch)
        if self._scene is not None:
            self._scene.write(batch)

    def write_note(self, note: Note) -> None:
        """Write a note twice: as data, and as text for the viewer."""
        self.write_notes([note])

    def write_notes(self, notes: Sequence[Note]) -> None:
        """Write notes, in order, at once."""
        import rerun as rr

        if not notes:
            return
        ticks = np.array([note.tick for note in notes])
        times = self._times(ticks)
        texts = [json.dumps(asdict(note)) for note in notes]
        columns = rr.DynamicArchetype.columns("aloft", components={NOTE: texts})
        self.stream.send_columns(f"{self._root}{NOTES}", times, columns)
        self._write_events(ticks, [note.text for note in notes], [note.level for note in notes])

    def write_rest(self) -> None:
        """Write the last value of the signals that were constant in the end, for the viewer."""
        for field in self._fields:
            if field.name in self._changed:
                rest = self._changed[field.name].rest()
                if rest is not None:
                    self._write_signal(field, *rest)

    def write_times(self, outcome: dict[str, Any]) -> None:
        """Write the time that each block took."""
        import rerun as rr

        text = rr.TextDocument(times_table(outcome), media_type="text/markdown")
        self.stream.log(f"{self._root}{TIMES}", text, static=True)

    def _entity(self, kind: str, field: RecordedField) -> str:
        return self._root + entity_of(kind, field.name)

    def _times(self, ticks: NDArray[np.int64]) -> list[Any]:
        return time_columns(self.header, ticks)

    def _write_signals(self, batch: RecordedRows) -> None:
        due = slice(None) if self._every == 1 else np.flatnonzero(batch.ticks % self._every == 0)
        ticks = batch.ticks[due]
        if not len(ticks):
            return
        for field in self._fields:
            values = batch.signal(field.name)[due]
            flat = np.ascontiguousarray(values.reshape(len(values), -1))
            if field.name in self._changed:
                some, flat = self._changed[field.name].pick(ticks, flat)
            else:
                some = ticks
            if len(some):
                self._write_signal(field, some, flat)

    def _write_signal(
        self, field: RecordedField, ticks: NDArray[np.int64], flat: NDArray[Any]
    ) -> None:
        import rerun as rr

        columns = rr.Scalars.columns(scalars=flat.astype(np.float64, copy=False))
        self.stream.send_columns(self._entity(SIGNALS, field), self._times(ticks), columns)

    def _write_limits(self, batch: RecordedRows) -> None:
        """Draw every limit on to the end of the batch."""
        import rerun as rr

        ticks = batch.ticks[[0, -1]] if len(batch.ticks) > 1 else batch.ticks
        times = self._times(ticks)
        for field, limits in self._limits:
            values = np.tile([value for _, value in limits], (len(ticks), 1))
            columns = rr.Scalars.columns(scalars=values)
            self.stream.send_columns(self._entity(LIMITS, field), times, columns)

    def _write_states(self, batch: RecordedRows) -> None:
        """Write each change of a lane, and those worth telling as text, too."""
        import rerun as rr

        for change in self._reader.changes(batch):
            lane, times = change.lane, self._times(change.ticks)
            states = rr.StateChange.columns(state=change.labels)
            self.stream.send_columns(f"{self._root}{lane.entity}", times, states)
            if lane.told:
                texts = [f"{lane.field.name}: {label}" for label in change.labels]
                self._write_events(change.ticks, texts, ["INFO"] * len(texts))

    def _write_events(self, ticks: NDArray[np.int64], texts: list[str], levels: list[str]) -> None:
        import rerun as rr

        times = self._times(ticks)
        texts = timed(self.header, ticks, [self._label + text for text in texts])
        columns = rr.TextLog.columns(text=texts, level=levels)
        self.stream.send_columns(f"{self._root}{EVENTS}", times, columns)
