"""Recordings for other programs: CSV, Parquet and MCAP, with every number exact."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...runtime.language.errors import AloftError
from .format import RecordedField, nanoseconds
from .reader import RecordedRun
from .table import chosen, flat_columns, units


class ExportError(AloftError):
    """A recording cannot be exported; the message says what is missing."""


def export_csv(run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write one line for each tick and one column for each number.

    Floats have as many digits as are needed to read back the same number.

    Raises:
        KeyError: no signal has such a name.
        OSError: the file cannot be written.
    """
    columns = flat_columns(run, names)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        lists = [values.tolist() for values in columns.values()]
        writer.writerows(zip(*lists, strict=True))


def export_parquet(run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write one row for each tick and one column for each number.

    Each column has its unit as metadata, and the table has the graph's name and text.

    Raises:
        KeyError: no signal has such a name.
        OSError: the file cannot be written.
    """
    import pyarrow as pa  # comes with Rerun
    from pyarrow import parquet

    found = units(run, names)
    columns = flat_columns(run, names)
    arrays = [pa.array(np.ascontiguousarray(values)) for values in columns.values()]
    schema = pa.schema(
        [
            pa.field(name, array.type, metadata={"unit": found[name]} if name in found else None)
            for name, array in zip(columns, arrays, strict=True)
        ],
        metadata={"aloft.graph": run.header.graph, "aloft.name": run.header.name},
    )
    parquet.write_table(pa.Table.from_arrays(arrays, schema=schema), path)


def export_mcap(run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write one channel for each port, with one JSON message for each tick, for Foxglove and others.

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
