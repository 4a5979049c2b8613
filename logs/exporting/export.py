"""Recordings for other programs: CSV, Parquet and MCAP, with every number exact.

A stretch of the recording is in memory at a time.
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.language.errors import AloftError
from ..file.format import RecordedField, RecordedRows, nanoseconds
from ..file.reader import RecordedRun
from ..file.table import chosen
from .known_channels import Timed, known_channels
from .named_columns import NamedColumn, NamedColumns

ROW_GROUP = 8192
"""Ticks in a row group of a Parquet file, which is in memory as a whole."""


class ExportError(AloftError):
    """A recording cannot be exported; the message says what is missing."""


def export_csv(run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write one line for each tick and one column for each number.

    Columns are called after joints, contact points and axes, as ``robot.joints.position[hip]``.
    Floats have as many digits as are needed to read back the same number.

    Raises:
        KeyError: no signal has such a name.
        OSError: the file cannot be written.
    """
    table = NamedColumns(run, names)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([column.name for column in table.columns])
        for batch in run.batches():
            lists = [values.tolist() for values in table.values(batch)]
            writer.writerows(zip(*lists, strict=True))


def export_parquet(run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write one row for each tick and one column for each number.

    The columns are called as in ``export_csv``. The metadata of each column has its ``unit``,
    ``frame``, the ``signal``, the ``element`` (such as the joint) and ``text``, as far as there are
    any; that of the table has the graph's name and text, its rate, and the robot's joints.

    Raises:
        KeyError: no signal has such a name.
        OSError: the file cannot be written.
    """
    import pyarrow as pa  # comes with Rerun
    from pyarrow import parquet

    table = NamedColumns(run, names)
    types = [pa.from_numpy_dtype(values.dtype) for values in table.values(run.no_rows())]
    robot = run.header.robot
    about = {
        "aloft.graph": run.header.graph,
        "aloft.name": run.header.name,
        "aloft.rate_hz": repr(run.header.base_rate),
        "aloft.robot": robot.name if robot else "",
        "aloft.joints": json.dumps([joint.name for joint in robot.joints] if robot else []),
    }
    schema = pa.schema(
        [
            pa.field(column.name, kind, metadata=_metadata(column))
            for column, kind in zip(table.columns, types, strict=True)
        ],
        metadata=about,
    )
    with parquet.ParquetWriter(path, schema) as writer:
        for batch in run.batches(ROW_GROUP):
            arrays = [pa.array(np.ascontiguousarray(values)) for values in table.values(batch)]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


def _metadata(column: NamedColumn) -> dict[str, str] | None:
    return {key: value for key, value in column.about.items() if value} or None


def export_mcap(run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write what Foxglove, PlotJuggler and ROS 2's tools know, and every signal as JSON.

    The first are the channels of ``known_channels``, left out if only some signals are asked for.
    Each port has a channel of its own, with one JSON message for each tick.

    Raises:
        ExportError: the library ``mcap`` is not installed.
        KeyError: no signal has such a name.
        OSError: the file cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise ExportError("MCAP needs the library mcap; pip install 'aloft[mcap]'") from None
    ports: dict[str, list[RecordedField]] = {}
    for field in chosen(run, names):
        ports.setdefault(field.name.rpartition(".")[0], []).append(field)
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(library="aloft")
        writer.add_metadata("aloft", {"graph": run.header.graph, "name": run.header.name})
        channels: list[tuple[int, Callable[[RecordedRows], Iterator[Timed]]]] = []
        for known in () if names else known_channels(run):
            schema_id = writer.register_schema(
                known.type, known.schema_encoding, known.schema.encode()
            )
            channel = writer.register_channel(known.topic, known.encoding, schema_id)
            for instant, data in known.once:
                writer.add_message(channel, instant, data, instant)
            channels.append((channel, known.messages))
        for port, fields in ports.items():
            schema = json.dumps(_json_schema(port, fields)).encode()
            schema_id = writer.register_schema(port, "jsonschema", schema)
            channel = writer.register_channel(port.replace(".", "/"), "json", schema_id)
            channels.append((channel, partial(_json_messages, fields)))
        for batch in run.batches():
            for channel, messages in channels:
                for instant, data in messages(batch):
                    writer.add_message(channel, instant, data, instant)
        writer.finish()


def _json_messages(fields: Sequence[RecordedField], batch: RecordedRows) -> Iterator[Timed]:
    """One message a tick with all fields of a port."""
    instants = nanoseconds(batch.header.base_rate, batch.ticks).tolist()
    lists = {field.field_name: batch.signal(field.name).tolist() for field in fields}
    for k, instant in enumerate(instants):
        yield instant, json.dumps({name: values[k] for name, values in lists.items()}).encode()


def _json_schema(port: str, fields: Sequence[RecordedField]) -> dict[str, Any]:
    kinds = {"float64": "number", "int64": "integer", "bool": "boolean"}
    properties = {}
    for field in fields:
        schema: dict[str, Any] = {"type": kinds[field.dtype]}
        for _ in field.shape:
            schema = {"type": "array", "items": schema}
        about = " ".join(filter(None, [field.text, f"[{field.unit}]" if field.unit else ""]))
        properties[field.field_name] = {**schema, "description": about}
    return {"title": port, "type": "object", "properties": properties}


EXPORTS: Mapping[str, Callable[[RecordedRun, Path, Sequence[str]], None]] = {
    "csv": export_csv,
    "parquet": export_parquet,
    "mcap": export_mcap,
}
"""By the file name's ending."""


def export(kind: str, run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write ``path`` with the export of that ``kind``, a key of ``EXPORTS``, whole or not at all.

    Until it is whole it has another name, so that a file that was there before stays where it
    cannot be written to its end.

    Raises:
        ExportError, KeyError: see the exports.
        OSError: the file cannot be written.
    """
    if path.exists() and not path.is_file():  # such as /dev/stdout
        EXPORTS[kind](run, path, names)
        return
    part = path.with_name(f"{path.stem}.part{path.suffix}")
    try:
        EXPORTS[kind](run, part, names)
        os.replace(part, path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
