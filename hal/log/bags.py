"""MCAP files and ROS 2 bags as logs: the numbers of every topic, by ``topic.field``.

Stamps are those of the messages' headers, or of their arrival where a topic has none, or leaves them zero.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from ...mathematics.arrays import Indices1D
from .log_file import LogArray, LogError, LogFile, bounded

MOST_WIDE = 4096
"""Numbers in one field of a message; pictures and clouds of points have more, and are no columns."""


class _Topic:
    """One topic: its fields row by row, its stamps [ns], and what cannot be a column."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.stamps = array("q")
        self.arrivals = array("q")
        self.fields: dict[str, array[float]] = {}
        self.widths: dict[str, int] = {}
        self.texts: dict[str, list[str]] = {}
        self.refused: dict[str, str] = {}
        self.whole = ""
        """The reason why none of its fields is a column."""
        self.frames: set[str] = set()
        self.types: set[str] = set()
        self.sources: list[int] = []

    def came_from(self, connection: Any) -> None:
        """Note who sent a message: several senders at a time, or types, are no column."""
        self.types.add(connection.msgtype)
        if len(self.types) > 1:
            self.whole = f"has messages of several types, {', '.join(sorted(self.types))}"
        if self.sources[-1:] != [connection.id]:
            if connection.id in self.sources:
                self.whole = "has messages of several senders, whose rows are mixed"
            self.sources.append(connection.id)

    def add(self, message: Any, arrival: int) -> int:
        """Take a message; return how many numbers it has."""
        header = getattr(message, "header", None)
        stamp = getattr(header, "stamp", None)
        self.stamps.append(0 if stamp is None else stamp.sec * 1_000_000_000 + stamp.nanosec)
        self.arrivals.append(arrival)
        frame = getattr(header, "frame_id", "")
        if frame not in self.frames:
            self.frames.add(frame)
            if len(self.frames) > 1:
                self.whole = f"has messages of several frames, {', '.join(sorted(self.frames))}: two sensors, whose rows are mixed"
        count = 0
        for path, numbers in self._numbers(self.name, message):
            count += len(numbers)
            width = self.widths.setdefault(path, len(numbers))
            if width == len(numbers):
                self.fields.setdefault(path, array("d")).extend(numbers)
            else:
                self.refused[path] = (
                    f"has {width} numbers at first, and {len(numbers)} in row {len(self.stamps) - 1}"
                )
        return count

    def _numbers(self, name: str, message: Any) -> Iterator[tuple[str, list[float]]]:
        """Give the numbers in a message by their path; x, y, z and w of a vector or quaternion are one array."""
        found = {each: getattr(message, each) for each in _fields(message)}
        if found and all(
            len(each) == 1 and isinstance(value, (int, float)) for each, value in found.items()
        ):
            yield name, [float(value) for value in found.values()]
            return
        for each, value in found.items():
            if each == "header" or "covariance" in each:
                continue
            yield from self._of_field(f"{name}.{each}", name, value)

    def _of_field(self, path: str, parent: str, value: Any) -> Iterator[tuple[str, list[float]]]:
        if isinstance(value, (bool, int, float)):
            yield path, [float(value)]
        elif isinstance(value, str):
            self.refused[path] = "is text"
        elif isinstance(value, np.ndarray):
            if value.size > MOST_WIDE:
                self.refused[path] = (
                    f"has {value.size} numbers a message, expected at most {MOST_WIDE}"
                )
            elif not value.size:
                self.refused[path] = f"is empty in row {len(self.stamps) - 1}"
            elif value.dtype.kind in "fiub":
                yield path, value.ravel().astype(float).tolist()
        elif isinstance(value, list) and value and isinstance(value[0], str):
            self._named(path, parent, value)
        elif isinstance(value, list) and value and _fields(value[0]) and len(value) <= MOST_WIDE:
            for each in _fields(value[0]):
                if isinstance(getattr(value[0], each), str):
                    self._named(f"{path}.{each}", path, [getattr(part, each) for part in value])
            parts: dict[str, list[float]] = {}
            for part in value:
                for inner, numbers in self._numbers(path, part):
                    parts.setdefault(inner, []).extend(numbers)
            yield from parts.items()
        elif _fields(value):
            yield from self._numbers(path, value)

    def _named(self, path: str, parent: str, names: list[str]) -> None:
        """Keep the names of a field's parts, which must be the same in every message."""
        if self.texts.setdefault(path, names) != names and parent not in self.refused:
            self.refused[parent] = (
                f"is not of the same parts all along: {path} changes from message to message, in row {len(self.stamps) - 1} first"
            )

    def put_into(self, log: LogFile) -> Indices1D:
        """Keep its columns, or why they are none, in a log; return its stamps [ns]."""
        for path, names in self.texts.items():
            self.refused.setdefault(path, "is text")
            if path.rpartition(".")[0] not in self.refused:
                log.texts[path] = names
        log.refused.update(self.refused)
        if self.whole:
            log.refused[self.name] = self.whole
        rows = len(self.stamps)
        stamps = np.array(self.stamps if any(self.stamps) else self.arrivals, np.int64)
        for path, numbers in self.fields.items():
            parents = [p for p in log.refused if path == p or path.startswith((p + ".", p + "["))]
            if parents or len(numbers) != rows * self.widths[path] or rows < 2:
                why = log.refused[parents[0]] if parents else "is not in every message"
                log.refused[path] = "has one row" if rows < 2 else why
            else:
                values = np.array(numbers, np.float64).reshape(rows, -1)
                log.arrays[path] = LogArray(values, frame=next(iter(self.frames)))
        return stamps


def _fields(message: Any) -> tuple[str, ...]:
    kind: Any = type(message)
    return _fields_of(kind)


@cache
def _fields_of(kind: Any) -> tuple[str, ...]:
    return tuple(
        each for each in getattr(kind, "__dataclass_fields__", ()) if each != "__msgtype__"
    )


def read_bag(path: Path) -> LogFile:
    """Read the numbers of every topic.

    Raises:
        LogError: it has more numbers than are read, or nothing but messages of a kind that ROS 2 has not.
    """
    topics: dict[str, _Topic] = {}
    try:
        _gather(path, topics)
    except (ModuleNotFoundError, LogError):
        raise
    except Exception as error:  # noqa: BLE001  of the reader's many kinds
        raise LogError(
            f"cannot read {path.name} as a ROS 2 bag: {str(error).rstrip('.')}. Is it whole, and are all of its channels of ROS 2 (cdr)?"
        ) from None
    log = LogFile(path)
    stamps = {}
    for found in topics.values():
        before = len(log.arrays)
        own = found.put_into(log)
        stamps.update(dict.fromkeys(list(log.arrays)[before:], own))
    first = min((int(own.min()) for own in stamps.values()), default=0)
    since = {id(own): 1e-9 * (own - first).astype(np.float64) for own in stamps.values()}
    for name, own in stamps.items():
        log.arrays[name] = replace(log.arrays[name], stamps=since[id(own)])
    if not log.arrays and not log.refused:
        raise LogError(f"{path.name} has no messages")
    return log


def _gather(path: Path, topics: dict[str, _Topic]) -> None:
    """Read all messages into their topics."""
    highlevel = import_module("rosbags.highlevel")
    typesys = import_module("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    size = 0
    with highlevel.AnyReader([path], default_typestore=store) as reader:
        _read_unsigned(reader.typestore.fielddefs)
        kinds = {each.topic: each.msgtype for each in reader.connections}
        short = Counter(_short(topic) for topic in kinds)
        for topic in kinds:
            name = _short(topic)
            topics[topic] = _Topic(name if short[name] == 1 else topic.strip("/"))
        for connection, arrival, raw in reader.messages():
            found = topics[connection.topic]
            found.came_from(connection)
            if found.whole:
                continue
            if len(raw) > 8 * MOST_WIDE * 8:
                found.whole = f"has messages of {len(raw)} bytes, which are no row of a log"
            else:
                try:
                    message = reader.deserialize(raw, connection.msgtype)
                except Exception as error:  # noqa: BLE001  one topic's, of whatever kind: the others are read
                    found.whole = f"has messages that cannot be read as {connection.msgtype}: {str(error) or type(error).__name__}"
                    continue
                size += 8 * found.add(message, arrival)
                bounded(path, size)


def _read_unsigned(definitions: dict[str, Any]) -> None:
    """Let ``byte``, which rosbags takes for signed, be the octet that ROS 2 has (findings/ros2_byte_and_char_in_two_readers.sh)."""
    for name, (constants, fields) in list(definitions.items()):
        definitions[name] = constants, tuple((field, _unsigned(node)) for field, node in fields)


def _unsigned(node: Any) -> Any:
    if isinstance(node, tuple):
        return tuple(_unsigned(part) for part in node)
    return "uint8" if node == "byte" else node


def _short(topic: str) -> str:
    return topic.strip("/").replace("/", "_")
