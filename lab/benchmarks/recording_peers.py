"""The same signals written by aloft, by MCAP's Python writer, and by Rerun's ``send_columns`` alone.

Each writes every element of every field of every tick into a file, half a second of ticks at a time, as it would during
a run; nothing is drawn. MCAP has a channel for each field and a message for each tick, the bytes of its elements, in
chunks of its default size with Zstandard.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from struct import pack as packed

import numpy as np
from numpy.typing import NDArray

from ...logs.file.format import Header, time_columns
from ...logs.recording.writer import RecordingWriter
from .rows import Row

BATCH = 256
"""Ticks written together: about half a second."""
ROUNDS = 3
Rows = NDArray[np.uint8]


def recording_peers(header: Header, rows: Rows, folder: Path) -> list[Row]:
    """Measure time and size of the files of ``rows`` (n, bytes of the bus)."""
    size, cost = _measured(_write_aloft, header, rows, folder / "aloft.rrd")
    found = []
    for peer, write, name in (
        ("MCAP's Python writer", _write_mcap, "peer.mcap"),
        ("Rerun's send_columns alone", _write_rerun, "peer.rrd"),
    ):
        its_size, its_cost = _measured(write, header, rows, folder / name)
        found += [
            Row("file of all signals, size", size, "MB", peer, size / its_size, goal=1.0),
            Row("file of all signals, time", cost, "us/tick", peer, cost / its_cost, goal=1.0),
        ]
    return found


def _measured(
    write: Callable[[Header, Rows, Path], None], header: Header, rows: Rows, path: Path
) -> tuple[float, float]:
    """Return the megabytes of the file, and the median of the microseconds of processor time a tick."""
    costs = []
    for _ in range(ROUNDS):
        began = time.process_time()
        write(header, rows, path)
        costs.append((time.process_time() - began) * 1e6 / len(rows))
    return path.stat().st_size / 1e6, float(np.median(costs))


def _write_aloft(header: Header, rows: Rows, path: Path) -> None:
    writer = RecordingWriter(path, header)
    writer.draw = lambda: None  # type: ignore[method-assign]  # the peers draw nothing either
    for first in range(0, len(rows), BATCH):
        batch = rows[first : first + BATCH]
        writer.write_rows(np.arange(first, first + len(batch)), batch)
    writer.close()


def _write_mcap(header: Header, rows: Rows, path: Path) -> None:
    from mcap.writer import CompressionType, Writer

    fields = [field for field in header.bus.fields if not field.constant]
    places = [header.bus.layout().byte_range(field.name) for field in fields]
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("elements", "", packed("<d", 0.0))
        channels = [writer.register_channel(field.name, "elements", schema) for field in fields]
        for tick, row in enumerate(rows):
            instant = round(tick * 1e9 / header.base_rate)
            data = row.tobytes()
            for channel, (begin, end) in zip(channels, places, strict=True):
                writer.add_message(channel, instant, data[begin:end], instant)
        writer.finish()


def _write_rerun(header: Header, rows: Rows, path: Path) -> None:
    import rerun as rr

    layout = header.bus.layout()
    fields = [field for field in header.bus.fields if not field.constant]
    stream = rr.RecordingStream("peer", recording_id="peer", send_properties=False)
    rr.set_log_time_enabled(False, recording=stream)
    stream.save(path)
    for first in range(0, len(rows), BATCH):
        batch = rows[first : first + BATCH]
        times = time_columns(header, np.arange(first, first + len(batch)))
        for field in fields:
            values = layout.view(batch, field.name).reshape(len(batch), -1).astype(np.float64)
            columns = rr.Scalars.columns(scalars=values)
            stream.send_columns(field.name.replace(".", "/"), times, columns)
        stream.flush()
    stream.disconnect()
