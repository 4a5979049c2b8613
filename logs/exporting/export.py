"""Recordings for other programs: CSV, Parquet and MCAP, with every number exact."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.language.errors import AloftError
from ..file.format import RecordedField, nanoseconds
from ..file.reader import RecordedRun
from ..file.table import chosen
from .known_channels import known_channels
from .named_columns import NamedColumn, named_columns


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
    columns = named_columns(run, names)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([column.name for column in columns])
        lists = [column.values.tolist() for column in columns]
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

    columns = named_columns(run, names)
    arrays = [pa.array(np.ascontiguousarray(column.values)) for column in columns]
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
            pa.field(column.name, array.type, metadata=_metadata(column))
            for column, array in zip(columns, arrays, strict=True)
        ],
        metadata=about,
    )
    parquet.write_table(pa.Table.from_arrays(arrays, schema=schema), path)


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
    instants = nanoseconds(run.header.base_rate, run.ticks).tolist()
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(library="aloft")
        writer.add_metadata("aloft", {"graph": run.header.graph, "name": run.header.name})
        for known in () if names else known_channels(run):
            schema_id = writer.register_schema(
                known.type, known.schema_encoding, known.schema.encode()
            )
            channel = writer.register_channel(known.topic, known.encoding, schema_id)
            for instant, data in known.messages:
                writer.add_message(channel, instant, data, instant)
        for port, fields in ports.items():
            schema = json.dumps(_json_schema(port, fields)).encode()
            schema_id = writer.register_schema(port, "jsonschema", schema)
            channel = writer.register_channel(port.replace(".", "/"), "json", schema_id)
            lists = {field.field_name: run[field.name].tolist() for field in fields}
            for k, instant in enumerate(instants):
                message = json.dumps({name: values[k] for name, values in lists.items()})
                writer.add_message(channel, instant, message.encode(), instant)
        writer.finish()


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
