"""Writes a run to a Rerun stream, which is a file or a live viewer; see ``format``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...runtime.running.sink import Note
from ..file.format import (
    EVENTS,
    GRAPH,
    LIMITS,
    SIGNALS,
    TIMES,
    Header,
    RecordedField,
    RecordedRows,
    entity_of,
    time_columns,
    timed,
)
from ..viewing.blueprint import is_main
from ..viewing.drawing import WHOLE, Colors, Detail
from ..viewing.plot_views import EVERY_VALUE, limits_of, main_fields
from ..viewing.scene import SceneWriter
from ..viewing.scene_ports import scene_ports
from ..viewing.signal_names import axis_colors, element_names
from ..viewing.state_lanes import LaneReader, all_lanes, times_table

LIMIT_COLOR = 0x9E9E9EB0


class RunStream:
    """One run in a stream.

    Args:
        stream: the Rerun stream. The caller opens and closes it.
        header: what is known before the first tick.
        root: a prefix of all entities, such as ``first/``, where a stream holds several runs.
        detail: how much of the run is drawn. ``write_rest`` comes last, unless it has a row rate.
        colors: the colours in which this run is drawn.
        label: what the run is called in events, where a stream holds several.
    """

    def __init__(
        self,
        stream: Any,
        header: Header,
        *,
        root: str = "",
        detail: Detail = WHOLE,
        colors: Colors | None = None,
        label: str = "",
    ) -> None:
        self._label = f"{label}: " if label else ""
        self.stream, self.header, self._root = stream, header, root
        self._layout = header.bus.layout()
        rate, ports = detail.row_rate, scene_ports(header)
        self._every = 1 if rate is None else max(1, round(header.base_rate / rate))
        main = {field.name for field in main_fields(header, ports)}
        self._fields = [
            field
            for field in header.bus.fields
            if not field.constant
            and np.prod(field.shape) <= detail.most
            and (not detail.main_only or ports is None or field.name in main)
        ]
        pickers = {field.name: detail.picker() for field in self._fields}
        self._pickers = {name: picker for name, picker in pickers.items() if picker is not None}
        self._lanes = [lane for lane in all_lanes(header) if not detail.main_only or is_main(lane)]
        told = [lane for lane in all_lanes(header) if lane.told and lane not in self._lanes]
        self._reader = LaneReader([*self._lanes, *told])
        self._limits = [
            (field, limits) for field in self._fields if (limits := limits_of(field, header))
        ]
        self._scene = None
        if ports is not None:
            self._scene = SceneWriter(stream, header, ports, root, colors or Colors(), detail)

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

    def write_notes(self, notes: Sequence[Note]) -> None:
        """Write notes, in order, as text."""
        if not notes:
            return
        ticks = np.array([note.tick for note in notes])
        self._write_events(ticks, [note.text for note in notes], [note.level for note in notes])

    def write_rest(self) -> None:
        """Write the last value of the signals that were constant in the end, for the viewer."""
        for field in self._fields:
            rest = self._pickers[field.name].rest() if field.name in self._pickers else None
            if rest is not None:
                self._write_signal(field, *rest)
        if self._scene is not None:
            self._scene.write_rest()

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
            if field.name in self._pickers:
                some, flat = self._pickers[field.name].pick(ticks, flat)
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
            if lane in self._lanes:
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
