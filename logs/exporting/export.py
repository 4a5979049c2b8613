"""Recordings for other programs: CSV, Parquet, MCAP and bags of ROS 2, with every number exact.

A stretch of the recording is in memory at a time. An MCAP file has, beside every signal, channels
that Foxglove, PlotJuggler and ROS 2's tools know by their type. These show the robot in 3D (``/tf``,
``/scene``), its joints by name (``/joint_states``), the sensor (``/imu``), the sensors that its
description mounts (``/NAME``), the force on each foot (``/wrench/FOOT``) and what happened (``/log``),
without a click.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from errno import EEXIST
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ...files.pip_line import pip_line
from ...robots.description import Hull, RobotDescription
from ...robots.shapes import surface
from ...robots.surfaces import quaternion_from_z, robot_surfaces
from ...runtime.language.errors import AloftError
from ...runtime.language.extensions import is_provided, missing_extension, provided
from ...runtime.language.importing import without_imports
from ..file.format import RecordedField, RecordedRows, nanoseconds
from ..file.reader import RecordedRun
from ..file.table import chosen
from ..viewing.robot_shapes import shapes_of
from ..viewing.scene_ports import scene_ports
from .named_columns import NamedColumn, NamedColumns

WORLD = "world"
GREY, GROUND = (0.56, 0.64, 0.68, 1.0), (0.55, 0.57, 0.6, 1.0)
LEVELS = {"INFO": 2, "WARN": 3, "ERROR": 4}
"""The levels of ``foxglove.Log``."""


Timed = tuple[int, bytes]
Messages = Callable[[RecordedRows], Iterator[Timed]]


@dataclass(frozen=True)
class Channel:
    """A channel; a message is its time [ns] and its bytes.

    Attributes:
        once: messages of the whole run.
        messages: gives those of a batch of ticks, in order of time.
    """

    topic: str
    type: str
    encoding: str
    schema_encoding: str
    schema: str
    once: tuple[Timed, ...]
    messages: Messages


def known_channels(run: RecordedRun) -> list[Channel]:
    """Return the channels for which the recording has signals. Without a robot there is only ``/log``; those
    with ROS 2's types come from the extension ``ros2``."""
    channels = [_json("/log", "foxglove.Log", tuple(_notes(run)))]
    robot = run.header.robot
    if robot is None:
        return channels
    if scene_ports(run.header) is not None:
        start = int(nanoseconds(run.header.base_rate, run.ticks[:1]).sum())
        update = (start, json.dumps(scene_update(run, robot, start)).encode())
        channels.append(_json("/scene", "foxglove.SceneUpdate", (update,)))
    if is_provided("mcap_channels"):
        channels += provided("mcap_channels")(run, robot)
    return channels


def _json(topic: str, name: str, once: tuple[Timed, ...]) -> Channel:
    # these readers know the content by the schema's name
    schema = json.dumps({"title": name, "type": "object"})
    return Channel(topic, name, "json", "jsonschema", schema, once, lambda batch: iter(()))


def scene_update(run: RecordedRun, robot: RobotDescription, instant: int) -> dict[str, Any]:
    """Make a ``foxglove.SceneUpdate``: the links' surfaces or else their shapes, each fixed to its
    link's frame, and the ground."""
    entities, surfaces = [], robot_surfaces(robot).links
    for link in robot.links:
        if link.name in surfaces:
            seen = [
                _triangles(
                    part.corners, part.triangles, GREY if part.color is None else _rgba(part.color)
                )
                for part in surfaces[link.name]
            ]
            entities.append(_entity(link.name, link.name, instant, {"triangles": seen}))
            continue
        cylinders, spheres, hulls = [], [], []
        for shape in shapes_of(robot, link):
            if isinstance(shape, Hull):
                hulls.append(_triangles(*surface(shape), GREY))
                continue
            start, end = np.array(shape.start), np.array(shape.end)
            length = float(np.linalg.norm(end - start))
            thickness = 2.0 * shape.radius
            if length > 0.0:
                size = (thickness, thickness, length)
                look = {"bottom_scale": 1.0, "top_scale": 1.0}
                turn = quaternion_from_z(end - start)
                cylinders.append(_solid(0.5 * (start + end), turn, size, GREY) | look)
            for point in (start, end):
                size = (thickness, thickness, thickness)
                spheres.append(_solid(point, (0.0, 0.0, 0.0, 1.0), size, GREY))
        shown = {"cylinders": cylinders, "spheres": spheres, "triangles": hulls}
        entities.append(_entity(link.name, link.name, instant, shown))
    terrain = run.header.terrain
    if terrain is not None and (terrain.blocks or terrain.fields):
        cubes = [
            _solid(
                block.middle, block.quaternion, [2.0 * half for half in block.half_sizes], GROUND
            )
            for block in terrain.blocks
        ]
        fields = [_triangles(*field.triangles(), GROUND) for field in terrain.fields]
        shown = {"cubes": cubes, "triangles": fields}
        entities.append(_entity("ground", WORLD, instant, shown))
    return {"deletions": [], "entities": entities}


_KINDS = (
    "arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models", "metadata",
)  # fmt: skip


def _entity(name: str, frame: str, instant: int, shown: Mapping[str, Any]) -> dict[str, Any]:
    seconds, rest = divmod(instant, 1_000_000_000)
    return {
        "timestamp": {"sec": seconds, "nsec": rest},
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        **{kind: shown.get(kind, []) for kind in _KINDS},
    }


def _solid(place: Any, turn: Any, size: Any, color: Any) -> dict[str, Any]:
    return {
        "pose": {
            "position": dict(zip("xyz", map(float, place), strict=True)),
            "orientation": dict(zip("xyzw", map(float, turn), strict=True)),
        },
        "size": dict(zip("xyz", map(float, size), strict=True)),
        "color": dict(zip("rgba", color, strict=True)),
    }


def _rgba(color: int) -> tuple[float, float, float, float]:
    """Return red, green, blue and alpha of 0xRRGGBB."""
    red, green, blue = (byte / 255.0 for byte in color.to_bytes(3, "big"))
    return red, green, blue, 1.0


def _triangles(corners: Any, triangles: Any, color: Any) -> dict[str, Any]:
    """Make a surface as a ``foxglove.TriangleListPrimitive``."""
    solid = _solid((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), color)
    return {
        "pose": solid["pose"],
        "points": [dict(zip("xyz", map(float, corner), strict=True)) for corner in corners],
        "color": solid["color"],
        "colors": [],
        "indices": [int(corner) for triangle in triangles for corner in triangle],
    }


def _notes(run: RecordedRun) -> Iterator[Timed]:
    for note in sorted(run.notes, key=lambda note: note.tick):
        instant = int(nanoseconds(run.header.base_rate, np.array([note.tick]))[0])
        seconds, rest = divmod(instant, 1_000_000_000)
        message = {
            "timestamp": {"sec": seconds, "nsec": rest},
            "level": LEVELS.get(note.level, 0),
            "message": note.text,
            "name": note.kind,
            "file": "",
            "line": 0,
        }
        yield instant, json.dumps(message).encode()


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
    with parquet.ParquetWriter(path, schema, write_statistics=with_statistics(schema)) as writer:
        for batch in run.batches(ROW_GROUP):
            arrays = [pa.array(np.ascontiguousarray(values)) for values in table.values(batch)]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))


def with_statistics(schema: Any) -> list[str]:
    """Return the columns of a Parquet file that have statistics: all but floats.

    The least of a column of zeros is written as -0.0, and pyarrow's filter ``in [0.0]`` then takes it that
    the column has no zero.
    """
    import pyarrow as pa

    return [field.name for field in schema if not pa.types.is_floating(field.type)]


def _metadata(column: NamedColumn) -> dict[str, str] | None:
    return {key: value for key, value in column.about.items() if value} or None


def export_mcap(run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write what Foxglove, PlotJuggler and ROS 2's tools know, and every signal as JSON.

    The first are the channels of ``known_channels``, left out if only some signals are asked for.
    Each port has a channel of its own, with one JSON message for each tick.

    Raises:
        ExportError: the library ``mcap`` or ``rosbags`` is not installed.
        KeyError: no signal has such a name.
        OSError: the file cannot be written.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise ExportError(f"MCAP needs the library mcap; {pip_line('mcap')}") from None
    if find_spec("rosbags") is None:
        raise ExportError(f"MCAP needs the library rosbags; {pip_line('mcap')}")
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


def export_bag(run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write a bag of ROS 2, a folder with an MCAP file: the topics of ``known_channels`` that have ROS 2's types.

    Raises:
        ExportError: the library ``rosbags`` is not installed; the recording has no such topic, or some signals
            are asked for, which have no type of ROS 2.
        OSError: the folder cannot be written.
    """
    if find_spec("rosbags") is None:
        raise ExportError(f"a bag needs the library rosbags; {pip_line('mcap')}")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    if names:
        raise ExportError("a bag has only what has a type of ROS 2; --mcap writes any signal")
    channels = [each for each in known_channels(run) if each.encoding == "cdr"]
    if not is_provided("mcap_channels"):
        raise ExportError(missing_extension("ros2", "the ROS 2 types of a bag"))
    if not channels:
        raise ExportError("nothing in this recording has a type of ROS 2; --mcap writes any signal")
    types = get_typestore(Stores.ROS2_JAZZY)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = [bag.add_connection(each.topic, each.type, typestore=types) for each in channels]
        for topic, channel in zip(topics, channels, strict=True):
            for instant, data in channel.once:
                bag.write(topic, instant, data)
        for batch in run.batches():
            for topic, channel in zip(topics, channels, strict=True):
                for instant, data in channel.messages(batch):
                    bag.write(topic, instant, data)


def _json_messages(fields: Sequence[RecordedField], batch: RecordedRows) -> Iterator[Timed]:
    """Yield one message a tick with all fields of a port."""
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
    "bag": export_bag,
}
"""Exporters by the ending of the file's name."""


def export(kind: str, run: RecordedRun, path: Path, names: Sequence[str] = ()) -> None:
    """Write ``path`` with the export of that ``kind``, a key of ``EXPORTS``, whole or not at all.

    Until it is whole it has another name, so that a file that was there before stays where it
    cannot be written to its end.

    Raises:
        ExportError, KeyError: see the exports.
        OSError: the file cannot be written.
    """
    if path.is_char_device() or path.is_fifo():  # such as /dev/stdout
        _write(kind, run, path, names)
        return
    folder = path.with_name(f"{path.name}.part")
    shutil.rmtree(folder, ignore_errors=True)  # of an export that was killed
    folder.mkdir()
    try:
        _write(kind, run, folder / path.name, names)
        if path.is_dir():
            raise FileExistsError(EEXIST, "the folder is there already", str(path))
        os.replace(folder / path.name, path)
    finally:
        shutil.rmtree(folder)


def _write(kind: str, run: RecordedRun, path: Path, names: Sequence[str]) -> None:
    with without_imports():  # a robot may carry sensors of a module of the recording's
        EXPORTS[kind](run, path, names)
