"""ROS 2 messages: their types as signals, and the numbers of a signal as the bytes of a message.

``geometry_msgs/Vector3`` and ``Point`` become three numbers, ``Quaternion`` four (x, y, z, w); other
messages within a message are taken apart, and names joined with ``_``. Stamps and texts are no
signals: stamps are filled in from the time of the run, texts are parameters. A list has a size that
the graph gives, or stays empty.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...files.pip_line import pip_line
from ...runtime.language.errors import BlockError
from ...runtime.language.signals import Field, Signal
from .headers import (
    FrameNames,
    OtherMessageError,
    Texts,
    WrongMessageError,
    governing_text,
    is_absent,
    sent_quaternion,
    unit_quaternions,
)

STAMP = "builtin_interfaces/msg/Time"
_FLOATS = ("float32", "float64")
_INTEGERS = (
    "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "byte", "char", "octet",
)  # fmt: skip
_VECTORS = {
    "geometry_msgs/msg/Vector3": "xyz",
    "geometry_msgs/msg/Point": "xyz",
    "geometry_msgs/msg/Quaternion": "xyzw",
}
QUANTITIES: Mapping[tuple[str, str], tuple[str, str | None]] = {
    ("sensor_msgs/msg/JointState", "position"): ("rad", None),
    ("sensor_msgs/msg/JointState", "velocity"): ("rad/s", None),
    ("sensor_msgs/msg/JointState", "effort"): ("N m", None),
    ("sensor_msgs/msg/Imu", "orientation"): ("", None),
    ("sensor_msgs/msg/Imu", "angular_velocity"): ("rad/s", "body"),
    ("sensor_msgs/msg/Imu", "linear_acceleration"): ("m/s^2", "body"),
    ("geometry_msgs/msg/Transform", "translation"): ("m", "world"),
    ("geometry_msgs/msg/Transform", "rotation"): ("", None),
    ("geometry_msgs/msg/Pose", "position"): ("m", "world"),
    ("geometry_msgs/msg/Pose", "orientation"): ("", None),
    ("geometry_msgs/msg/Twist", "linear"): ("m/s", "body"),
    ("geometry_msgs/msg/Twist", "angular"): ("rad/s", "body"),
    ("geometry_msgs/msg/Wrench", "force"): ("N", "world"),
    ("geometry_msgs/msg/Wrench", "torque"): ("N m", "world"),
}
"""Unit and frame by the message that has the field; those of other fields are not checked."""
SIZES: Mapping[str, Mapping[str, str]] = {
    "sensor_msgs/msg/JointState": dict.fromkeys(("position", "velocity", "effort"), "n_joints"),
}
"""Sizes that lists have where the graph gives none."""
Size = int | str


@dataclass(frozen=True)
class Leaf:
    """One field of the signal.

    Attributes:
        name: in the signal.
        path: the attributes that lead to it in the message.
        parts: the attributes of a vector's components; empty for numbers and lists of numbers.
        base: ROS 2's name of the type of its numbers.
        shape: of the field; its first dimension counts messages where ``listed`` is not -1.
        listed: the place in ``path`` at which there is a list of messages, or -1.
        unit, frame: of the field.
    """

    name: str
    path: tuple[str, ...]
    parts: str
    base: str
    shape: tuple[Size, ...]
    listed: int = -1
    unit: str | None = None
    frame: str | None = None

    @property
    def is_usual(self) -> bool:
        """True if a signal has the field by default."""
        return not self.path[-1].endswith("covariance") and self.path[0] != "layout"

    @property
    def dtype(self) -> str:
        """The element type of the field."""
        if self.base == "bool":
            return "bool"
        return "float64" if self.base in _FLOATS else "int64"


@lru_cache(maxsize=4)
def type_store(distribution: str) -> Any:
    """Return the message types of a distribution of ROS 2.

    Raises:
        BlockError: the library is missing, or does not know the distribution.
    """
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise BlockError(
            f"ROS 2's message types come with the library rosbags: {pip_line('ros2')}"
        ) from error
    name = f"ROS2_{distribution.upper()}"
    if name not in Stores.__members__:
        known = [s.name.removeprefix("ROS2_").lower() for s in Stores if s.name.startswith("ROS2_")]
        raise BlockError(f"rosbags does not know ROS 2 {distribution}; it knows {', '.join(known)}")
    return get_typestore(Stores[name])


def full_type(name: str) -> str:
    """Complete ``sensor_msgs/Imu`` to ``sensor_msgs/msg/Imu``."""
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[1]}" if len(parts) == 2 else name


class MessageType:
    """A message type as a graph sees it.

    Args:
        name: of the type, as ``sensor_msgs/msg/Imu``.
        distribution: of ROS 2.
        sizes: of lists by their path in the message, with dots; a number or a dimension's name.
        fields: the names of the fields that the signal has; by default all but covariances and
            the layout of arrays, which stay zero, as ROS 2 says that they are not known.
        frame: of the numbers, where it is another than the type's first, such as a sensor's.

    Raises:
        BlockError: the type is not known, a size is of no list, or no numbers are left.
    """

    def __init__(
        self, name: str, distribution: str, sizes: Mapping[str, Size], fields: Sequence[str] = (),
        frame: str | None = None,
    ) -> None:  # fmt: skip
        self.store = type_store(distribution)
        self.name = full_type(name)
        if self.name not in self.store.fielddefs:
            near = difflib.get_close_matches(self.name, self.store.fielddefs, 3)
            hint = f"; the nearest are {', '.join(near)}" if near else ""
            raise BlockError(f"ROS 2 {distribution} has no message type {name!r}{hint}")
        self.sizes = {**SIZES.get(self.name, {}), **sizes}
        self.lists: dict[str, Size] = {}
        """The lists with a size."""
        self.texts: list[str] = []
        """The paths of all texts."""
        self._empty: list[str] = []
        found = tuple(self._leaves(self.name, (), (), -1))
        names = [leaf.name for leaf in found]
        wrong = [name for name in fields if name not in names]
        if wrong:
            raise BlockError(
                f"{self.name} has no field {wrong[0]!r}; its fields are {', '.join(names)}"
            )
        own = next((leaf.frame for leaf in found if leaf.frame is not None), None)
        self.leaves = tuple(
            replace(leaf, frame=frame) if frame and own is not None and leaf.frame == own else leaf
            for leaf in found
            if (leaf.name in fields if fields else leaf.is_usual)
        )
        self.claims = dict.fromkeys(
            (path, leaf.frame, leaf.listed)
            for leaf in self.leaves
            if leaf.frame is not None
            and (path := governing_text(leaf.path, leaf.frame, self.texts)) is not None
        )
        """The texts that name frames, each with the frame of the numbers beside it and the place of a
        list in its path, or -1."""
        left_out = [path for path in self._empty if sizes.get(path) == 0]
        unknown = [path for path in sizes if path not in (*self.lists, *left_out)]
        if unknown:
            known = ", ".join([*self.lists, *self._empty]) or "none"
            raise BlockError(f"{self.name} has no list {unknown[0]!r}; its lists are {known}")
        if not self.leaves and self.name != "rosgraph_msgs/msg/Clock":
            raise BlockError(
                f"{self.name} has no numbers without sizes: {{{', '.join(self._empty)}: ...}}"
                if self._empty
                else f"{self.name} has no numbers, so it is no signal"
            )

    @property
    def hash(self) -> str:
        """The type's hash, ``RIHS01_...``."""
        return str(self.store.hash_rihs01(self.name))

    @cached_property
    def signal(self) -> type[Signal]:
        """The signal with a field for each leaf."""
        body: dict[str, Any] = {
            leaf.name: Field(
                leaf.shape, unit=leaf.unit, frame=leaf.frame, dtype=leaf.dtype,
                text=f"{'.'.join(leaf.path)} of {self.name}", quaternion=leaf.parts == "xyzw",
            )
            for leaf in self.leaves
        }  # fmt: skip
        if not body:  # a clock is nothing but a stamp
            body["unused"] = Field(text="nothing: the message is the time of the run")
        name = self.name.rpartition("/")[2]
        return type(name, (Signal,), {"__doc__": f"The numbers of a {self.name}.", **body})

    def _leaves(
        self, type_name: str, path: tuple[str, ...], dims: tuple[Size, ...], listed: int
    ) -> Iterator[Leaf]:
        for field, (node, argument) in self.store.fielddefs[type_name][1]:
            if field == "structure_needs_at_least_one_member":
                continue
            here = (*path, field)
            dotted = ".".join(here)
            kind = node.name
            if kind == "BASE":
                yield from self._numbers(type_name, here, argument[0], dims, listed)
            elif kind == "NAME":
                yield from self._message(type_name, argument, here, dims, listed)
            else:
                (inner, what), length = argument
                size: Size | None = length if kind == "ARRAY" else self.sizes.get(dotted)
                is_text = inner.name == "BASE" and what[0] in ("string", "wstring")
                if is_text:
                    self.texts.append(dotted)
                    continue
                if size is None or size == 0:
                    self._empty.append(dotted)
                    continue
                if kind != "ARRAY":
                    self.lists[dotted] = size
                if inner.name == "BASE":
                    yield from self._numbers(type_name, here, what[0], (*dims, size), listed)
                elif listed >= 0:
                    raise BlockError(f"{dotted} of {self.name} is a list within a list")
                else:
                    place = len(here) - 1
                    yield from self._message(type_name, what, here, (size,), place)

    def _message(
        self, owner: str, type_name: str, path: tuple[str, ...], dims: tuple[Size, ...], listed: int
    ) -> Iterator[Leaf]:
        if type_name == STAMP:
            return
        if type_name in _VECTORS:
            parts = _VECTORS[type_name]
            yield self._leaf(owner, path, parts, "float64", (*dims, len(parts)), listed)
        else:
            yield from self._leaves(type_name, path, dims, listed)

    def _numbers(
        self, owner: str, path: tuple[str, ...], base: str, dims: tuple[Size, ...], listed: int
    ) -> Iterator[Leaf]:
        if base in ("string", "wstring"):
            self.texts.append(".".join(path))
        elif base == "bool" or base in _FLOATS or base in _INTEGERS:
            yield self._leaf(owner, path, "", base, dims, listed)
        else:
            raise BlockError(f"{'.'.join(path)} of {self.name} is of type {base}")

    def _leaf(
        self, owner: str, path: tuple[str, ...], parts: str, base: str, shape: tuple[Size, ...],
        listed: int,
    ) -> Leaf:  # fmt: skip
        unit, frame = QUANTITIES.get((owner, path[-1]), (None, None))
        name = path[-1] if len(path) == 1 else "_".join(p for p in path if p != "header")
        return Leaf(name, path, parts, base, shape, listed, unit, frame)


Values = Mapping[str, NDArray[Any]]
_OTHER = {"byte": "uint8", "octet": "uint8", "char": "uint8"}
_OCTETS = ("byte", "octet")
"""Numbers from 0 to 255 that rosbags takes for signed ones (findings/ros2_byte_and_char_in_two_readers.sh)."""
CDR_HEADER = 4
"""Bytes before the message itself, which say how it is encoded."""


def numpy_type(base: str) -> np.dtype[Any]:
    """Return NumPy's type of one of ROS 2's numbers."""
    return np.dtype(_OTHER.get(base, base))


class Codec:
    """Writes and reads messages of one type. Messages are CDR, little endian.

    Args:
        message_type: the type, with the sizes of its lists.
        dimensions: sizes by name.
        texts: the texts of written messages by their path with dots, one for each message of a list.
            ``frame_id`` stands for every frame of a header.
        order: the names that lists are in the order of, where messages read have a list ``name``.
        frames: the names that frames may have in messages read; by default none is checked.

    Raises:
        BlockError: a text is of no such path, or their number is wrong.
    """

    def __init__(
        self, message_type: MessageType, dimensions: Mapping[str, int], texts: Texts,
        order: Sequence[str] = (), frames: FrameNames | None = None,
    ) -> None:  # fmt: skip
        self.type = message_type
        self._store = message_type.store
        self._dimensions = dimensions
        self._texts = texts
        self._order = tuple(order)
        self._frames = frames
        self.absent: dict[str, int] = {}
        """Numbers of messages read that say that they have no value of a field."""
        self.assumed: dict[str, str] = {}
        """Frames by the names that messages read have for them, where nothing else says that they are these."""
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
        """Return the bytes of a message with these numbers and the time [ns]."""
        for stamp in self._stamps:
            stamp.sec, stamp.nanosec = divmod(time, 1_000_000_000)
        for leaf in self.type.leaves:
            value = values[leaf.name]
            for index, owner in self._owners(self._message, leaf):
                _put(owner, leaf, value if index < 0 else value[index])
        data = self._store.serialize_cdr(self._message, self.type.name, little_endian=True)
        return bytes(data)

    def blank(self) -> dict[str, NDArray[Any]]:
        """Return the numbers before the first message: zeros, and quaternions that turn nothing."""
        fields = self.type.signal.fields
        return {name: fields[name].blank(shape) for name, shape in self.shapes.items()}

    def read(self, data: bytes, before: Values | None = None) -> dict[str, NDArray[Any]]:
        """Return the numbers in the bytes of a message.

        Args:
            data: the bytes.
            before: the numbers of the transforms that a message does not have; by default ``blank``.

        Raises:
            WrongMessageError: it is no message of this type, or does not fit the signal.
            OtherMessageError: it has none of the transforms that the texts name.
        """
        if len(data) < CDR_HEADER:
            raise WrongMessageError(f"it has {len(data)} bytes")
        try:
            message = self._store.deserialize_cdr(data, self.type.name)
            rank = self._rank(message)
            before = before or self.blank()
            picked = self._pick(message)
            self._check_frames(message, picked)
            found = {
                leaf.name: self._picked(picked, leaf, before[leaf.name])
                if picked is not None and leaf.listed >= 0
                else self._get(message, leaf, rank)
                for leaf in self.type.leaves
            }
        except (WrongMessageError, OtherMessageError):
            raise
        except Exception as error:  # whatever the library raises of foreign bytes
            raise WrongMessageError(f"{type(error).__name__}: {error}") from error
        for name, value in found.items():
            if value.dtype.kind == "f" and not np.isfinite(value).all():
                raise WrongMessageError(f"{name} is not finite")
        return found

    def _pick(self, message: Any) -> dict[int, Any] | None:
        """Return the elements of the message's list that the texts name, by their place in the signal;
        ``None`` where no names are given, or there is no such list.

        Raises:
            OtherMessageError: it has none of them, or the one message is another's.
        """
        for path, names in self._texts.items():
            steps = path.split(".")
            if steps[-1] != "child_frame_id" or self._frames is None:
                continue
            if isinstance(names, str):
                name = _follow(message, steps).lstrip("/") if len(self.type.lists) == 0 else names
                if name and name != names.lstrip("/"):
                    raise OtherMessageError(name)
                continue
            places = {name.lstrip("/"): k for k, name in enumerate(names)}
            elements = _follow(message, steps[:-1])
            found = {
                places[name]: element
                for element in elements
                if (name := element.child_frame_id.lstrip("/")) in places
            }
            if not found:
                raise OtherMessageError(", ".join(each.child_frame_id for each in elements))
            return found
        return None

    def _check_frames(self, message: Any, picked: Mapping[int, Any] | None) -> None:
        """Compare the frames that the message names with those of the signal.

        Raises:
            WrongMessageError: one is another frame.
        """
        if self._frames is None:
            return
        for path, frame, listed in self.type.claims:
            steps = path.split(".")
            owners: Sequence[Any] = [message]
            if listed >= 0:
                elements = _follow(message, steps[: listed + 1])
                owners = list(picked.values()) if picked is not None else elements
                steps = steps[listed + 1 :]
            for owner in owners:
                name = _follow(owner, steps)
                if not self._frames.is_frame(name, frame, path):
                    raise WrongMessageError(f"{path} is {name!r}, and the signal is in {frame}")
                if not self._frames.is_known(name, frame, path):
                    self.assumed[name] = frame

    def _picked(self, picked: Mapping[int, Any], leaf: Leaf, before: NDArray[Any]) -> NDArray[Any]:
        result = np.array(before)
        for k, element in picked.items():
            result[k] = self._value(_follow(element, leaf.path[leaf.listed + 1 : -1]), leaf)
        return result

    def _value(self, owner: Any, leaf: Leaf) -> NDArray[Any]:
        """Return the numbers of a leaf in the object that owns it; as before the first message where it
        says that there are none."""
        name = leaf.path[-1]
        if is_absent(owner, name):
            self.absent[leaf.name] = self.absent.get(leaf.name, 0) + 1
            value = np.zeros(len(leaf.parts)) if leaf.parts else np.zeros_like(getattr(owner, name))
            if leaf.parts == "xyzw":
                value[3] = 1.0
            return value
        told = getattr(owner, name)
        if leaf.parts:
            told = [getattr(told, part) for part in leaf.parts]
        found: NDArray[Any] = np.asarray(told, leaf.dtype)
        if leaf.base in _OCTETS:
            found &= 0xFF
        return unit_quaternions(found, ".".join(leaf.path)) if leaf.parts == "xyzw" else found

    def _rank(self, message: Any) -> NDArray[np.int64] | None:
        """Return the places in the message's lists of the names in ``order``."""
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
            found.append(self._value(owner, leaf))
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
        """Return the objects that own the leaf's last attribute, each with its place in the list of messages, or -1."""
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
        if _VECTORS.get(type_name) == "xyzw":
            values["w"] = 1.0  # no turn, where nobody gives one
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
        if leaf.parts == "xyzw":
            value = sent_quaternion(value)
        for part, number in zip(leaf.parts, value.tolist(), strict=True):
            setattr(vector, part, number)
        return
    if leaf.dtype == "int64":
        limits = np.iinfo(numpy_type(leaf.base))
        value = np.clip(value, max(limits.min, -(2**63)), min(limits.max, 2**63 - 1))
    if value.ndim:
        np.copyto(getattr(owner, name), value, casting="unsafe")
    elif leaf.base in _OCTETS:
        setattr(owner, name, value.astype(np.int8).item())
    else:
        setattr(owner, name, value.item())
