"""What a graph sees of a ROS 2 message: a signal whose fields are the numbers of the message.

``geometry_msgs/Vector3`` and ``Point`` become three numbers, ``Quaternion`` four (x, y, z, w); other
messages within a message are taken apart, and names joined with ``_``. Stamps and texts are no
signals: stamps are filled in from the time of the run, texts are parameters. A list has a size that
the graph gives, or stays empty.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

from ..runtime.language.errors import BlockError
from ..runtime.language.signals import Field, Signal

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
        """Whether a signal has the field if nobody asks for it."""
        return not self.path[-1].endswith("covariance") and self.path[0] != "layout"

    @property
    def dtype(self) -> str:
        """The element type of the field."""
        if self.base == "bool":
            return "bool"
        return "float64" if self.base in _FLOATS else "int64"


@lru_cache(maxsize=4)
def type_store(distribution: str) -> Any:
    """The message types of a distribution of ROS 2.

    Raises:
        BlockError: the library is missing, or does not know the distribution.
    """
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise BlockError(
            "ROS 2's message types come with the library rosbags: pip install 'aloft[ros2]'"
        ) from error
    name = f"ROS2_{distribution.upper()}"
    if name not in Stores.__members__:
        known = [s.name.removeprefix("ROS2_").lower() for s in Stores if s.name.startswith("ROS2_")]
        raise BlockError(f"rosbags does not know ROS 2 {distribution}; it knows {', '.join(known)}")
    return get_typestore(Stores[name])


def full_type(name: str) -> str:
    """``sensor_msgs/Imu`` and ``sensor_msgs/msg/Imu`` -> the latter."""
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

    Raises:
        BlockError: the type is not known, a size is of no list, or no numbers are left.
    """

    def __init__(
        self, name: str, distribution: str, sizes: Mapping[str, Size], fields: Sequence[str] = ()
    ) -> None:
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
        self.leaves = tuple(
            leaf for leaf in found if (leaf.name in fields if fields else leaf.is_usual)
        )
        unknown = [path for path in sizes if path not in self.lists]
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
                text=f"{'.'.join(leaf.path)} of {self.name}",
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
