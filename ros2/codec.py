"""Turns the numbers of a signal into the bytes of a ROS 2 message, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.language.errors import BlockError
from .message_types import STAMP, Leaf, MessageType

Values = Mapping[str, NDArray[Any]]
Texts = Mapping[str, str | Sequence[str]]
_OTHER = {"byte": "uint8", "octet": "uint8", "char": "uint8"}
CDR_HEADER = 4
"""Bytes before the message itself, which say how it is encoded."""


class WrongMessageError(ValueError):
    """A message does not fit the signal: a list of another length, a name that is missing."""


def numpy_type(base: str) -> np.dtype[Any]:
    """NumPy's type of one of ROS 2's numbers."""
    return np.dtype(_OTHER.get(base, base))


class Codec:
    """Writes and reads messages of one type. Messages are CDR, little endian.

    Args:
        message_type: the type, with the sizes of its lists.
        dimensions: sizes by name.
        texts: the texts of written messages by their path with dots, one for each message of a list.
            ``frame_id`` stands for every frame of a header.
        order: the names that lists are in the order of, where messages read have a list ``name``.

    Raises:
        BlockError: a text is of no such path, or their number is wrong.
    """

    def __init__(
        self, message_type: MessageType, dimensions: Mapping[str, int], texts: Texts,
        order: Sequence[str] = (),
    ) -> None:  # fmt: skip
        self.type = message_type
        self._store = message_type.store
        self._dimensions = dimensions
        self._texts = texts
        self._order = tuple(order)
        self._stamps: list[Any] = []
        unknown = [t for t in texts if t != "frame_id" and t not in message_type.texts]
        if unknown:
            known = ", ".join(message_type.texts) or "none"
            raise BlockError(
                f"{message_type.name} has no text {unknown[0]!r}; its texts are {known}"
            )
        self._message = self._build(message_type.name, ())
        has = [leaf.name for leaf in message_type.leaves]
        if message_type.name == "sensor_msgs/msg/Imu" and "orientation" not in has:
            self._message.orientation_covariance[0] = -1.0  # ROS 2's sign for no orientation
        self.shapes = {
            leaf.name: tuple(self._size(size) for size in leaf.shape)
            for leaf in message_type.leaves
        }

    def write(self, values: Values, time: int) -> bytes:
        """The bytes of a message with these numbers and the time [ns]."""
        for stamp in self._stamps:
            stamp.sec, stamp.nanosec = divmod(time, 1_000_000_000)
        for leaf in self.type.leaves:
            value = values[leaf.name]
            for index, owner in self._owners(self._message, leaf):
                _put(owner, leaf, value if index < 0 else value[index])
        data = self._store.serialize_cdr(self._message, self.type.name, little_endian=True)
        return bytes(data)

    def read(self, data: bytes) -> dict[str, NDArray[Any]]:
        """The numbers in the bytes of a message.

        Raises:
            WrongMessageError: it is no message of this type, or does not fit the signal.
        """
        if len(data) < CDR_HEADER:
            raise WrongMessageError(f"it has {len(data)} bytes")
        try:
            message = self._store.deserialize_cdr(data, self.type.name)
            rank = self._rank(message)
            found = {leaf.name: self._get(message, leaf, rank) for leaf in self.type.leaves}
        except WrongMessageError:
            raise
        except Exception as error:  # whatever the library raises of foreign bytes
            raise WrongMessageError(f"{type(error).__name__}: {error}") from error
        for name, value in found.items():
            if value.dtype.kind == "f" and not np.isfinite(value).all():
                raise WrongMessageError(f"{name} is not finite")
        return found

    def _rank(self, message: Any) -> NDArray[np.int64] | None:
        """Where in the message's lists what is first, second, ... in ``order`` is."""
        names = list(getattr(message, "name", ()))
        if not self._order or not names or tuple(names) == self._order:
            return None
        missing = [name for name in self._order if name not in names]
        if missing:
            raise WrongMessageError(f"it has no {missing[0]!r}")
        return np.array([names.index(name) for name in self._order], np.int64)

    def _get(self, message: Any, leaf: Leaf, rank: NDArray[np.int64] | None) -> NDArray[Any]:
        shape = self.shapes[leaf.name]
        found = []
        for _, owner in self._owners(message, leaf):
            value = getattr(owner, leaf.path[-1])
            if leaf.parts:
                value = [getattr(value, part) for part in leaf.parts]
            found.append(np.asarray(value, leaf.dtype))
        result = np.stack(found) if leaf.listed >= 0 and found else np.array(found)
        if leaf.listed < 0:
            result = result[0]
            if rank is not None and result.ndim == 1 and len(leaf.path) == 1:
                result = result[rank] if result.size > int(rank.max()) else result
        if result.shape != shape:
            raise WrongMessageError(
                f"{'.'.join(leaf.path)} has shape {result.shape}, expected {shape}"
            )
        return result

    def _owners(self, message: Any, leaf: Leaf) -> list[tuple[int, Any]]:
        """What has the leaf's last attribute; with the number in the list of messages, or -1."""
        if leaf.listed < 0:
            return [(-1, _follow(message, leaf.path[:-1]))]
        elements = _follow(message, leaf.path[: leaf.listed + 1])
        return [
            (k, _follow(element, leaf.path[leaf.listed + 1 : -1]))
            for k, element in enumerate(elements)
        ]

    def _size(self, size: int | str) -> int:
        if isinstance(size, int):
            return size
        if size not in self._dimensions:
            raise BlockError(
                f"there is no dimension {size!r} in this graph; give sizes of {self.type.name}"
            )
        return self._dimensions[size]

    def _build(self, type_name: str, path: tuple[str, ...], index: int = -1) -> Any:
        if type_name == STAMP:
            made = self._store.types[STAMP](sec=0, nanosec=0)
            self._stamps.append(made)
            return made
        values: dict[str, Any] = {}
        for field, (node, argument) in self._store.fielddefs[type_name][1]:
            here = (*path, field)
            if node.name == "BASE":
                base = argument[0]
                if base in ("string", "wstring"):
                    values[field] = self._text(here, index)
                else:
                    values[field] = numpy_type(base).type(0).item()
            elif node.name == "NAME":
                values[field] = self._build(argument, here, index)
            else:
                values[field] = self._build_list(argument, here, node.name == "ARRAY")
        return self._store.types[type_name](**values)

    def _build_list(self, argument: Any, path: tuple[str, ...], fixed: bool) -> Any:
        (inner, what), length = argument
        dotted = ".".join(path)
        size = length if fixed else self._size(self.type.lists.get(dotted, 0))
        if inner.name == "NAME":
            return [self._build(what, path, k) for k in range(size)]
        if what[0] in ("string", "wstring"):
            texts = self._texts.get(dotted, ())
            return [texts] if isinstance(texts, str) else list(texts)
        return np.zeros(size, numpy_type(what[0]))

    def _text(self, path: tuple[str, ...], index: int) -> str:
        dotted = ".".join(path)
        default = self._texts.get("frame_id", "") if path[-1] == "frame_id" else ""
        found = self._texts.get(dotted, default)
        if isinstance(found, str):
            return found
        if not 0 <= index < len(found):
            raise BlockError(
                f"the text {dotted!r} needs one text for each message of the list, and has "
                f"{len(found)}"
            )
        return found[index]


def _follow(message: Any, path: Sequence[str]) -> Any:
    for name in path:
        message = getattr(message, name)
    return message


def _put(owner: Any, leaf: Leaf, value: NDArray[Any]) -> None:
    name = leaf.path[-1]
    if leaf.parts:
        vector = getattr(owner, name)
        for part, number in zip(leaf.parts, value.tolist(), strict=True):
            setattr(vector, part, number)
        return
    if leaf.dtype == "int64":
        limits = np.iinfo(numpy_type(leaf.base))
        value = np.clip(value, max(limits.min, -(2**63)), min(limits.max, 2**63 - 1))
    if value.ndim:
        np.copyto(getattr(owner, name), value, casting="unsafe")
    else:
        setattr(owner, name, value.item())
