"""Writes a replay and the recorded run into one Rerun file.

In the file, on the timelines ``t`` and ``tick``: ``recorded/<block>/<port>/<field>`` and
``replayed/<block>/<port>/<field>``, for every field of the blocks that ran; and a layout in which
the fields that differ most are plotted, each with both.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..file.format import Header, RecordedField, entity_of, time_columns
from ..file.header import make_header
from ..viewing.drawing import opened_stream
from ..viewing.signal_names import element_names
from .replay import Replayable, Replayed, ReplayError

RECORDED, REPLAYED = "recorded", "replayed"
MOST_PLOTS = 6


def write_replay(path: str | PathLike[str], recorded: Replayable, replayed: Replayed) -> Path:
    """Write both runs, replacing an older file.

    Raises:
        ReplayError: the replay kept no rows.
        ImportError: Rerun is not installed.
        OSError: the file cannot be written.
    """
    import rerun as rr

    if not len(replayed.ticks):
        raise ReplayError("the replay kept no tick; replay with keep=True")
    path = Path(path)
    memory, graph = replayed.bound.memory, recorded.graph
    header = make_header(replayed.bound.graph, memory.bus.layout, bytes(memory.bus.layout.size))
    fields = _fields(header, replayed)
    with opened_stream(path, f"{graph.name}-replay", _blueprint(replayed, fields)) as stream:
        about = {"name": graph.name, "ran": ", ".join(replayed.ran), "first": str(replayed.first)}
        stream.send_property("aloft", rr.AnyValues(**about))
        first, last = int(replayed.ticks[0]), int(replayed.ticks[-1]) + 1
        ticks, rows = recorded.rows(first, last)
        bus, now = recorded.bus, memory.bus.layout
        for field in fields:
            there = field.name in bus.slots
            for kind, at, values in (
                (RECORDED, ticks, bus.view(rows, field.name) if there else None),
                (REPLAYED, replayed.ticks, now.view(replayed.rows, field.name)),
            ):
                if values is None:
                    continue
                entity = entity_of(kind, field.name)
                names = element_names(field, header.robot)
                if names:
                    legend = [f"{kind} {name}" for name in names]
                    stream.log(entity, rr.SeriesLines(names=legend), static=True)
                flat = np.ascontiguousarray(values.reshape(len(values), -1)).astype(np.float64)
                stream.send_columns(
                    entity, time_columns(header, at), rr.Scalars.columns(scalars=flat)
                )
    return path


def _fields(header: Header, replayed: Replayed) -> list[RecordedField]:
    """Return the fields of the blocks that ran, those that differ most first."""
    ran = dict.fromkeys(replayed.ran)
    fields = {
        field.name: field
        for field in header.bus.fields
        if not field.constant and field.name.rsplit(".", 2)[0] in ran
    }
    worst = [name for name, _ in replayed.signals.largest() if name in fields]
    return [fields[name] for name in dict.fromkeys([*worst, *fields])]


def _blueprint(replayed: Replayed, fields: list[RecordedField]) -> Any:
    """Lay out the fields that differ most, each with both runs in one plot."""
    import rerun.blueprint as rrb

    plots = [
        rrb.TimeSeriesView(
            name=field.name,
            origin="/",
            contents=[entity_of(RECORDED, field.name), entity_of(REPLAYED, field.name)],
        )
        for field in fields[:MOST_PLOTS]
    ]
    return rrb.Blueprint(
        rrb.Grid(*plots, grid_columns=2),
        rrb.TimePanel(state="collapsed", timeline="t"),
        rrb.SelectionPanel(state="collapsed"),
    )
