"""What ROS 2's middleware over Zenoh (rmw_zenoh, Jazzy and newer) calls things, and what goes beside a
message.

Sources: the design document and ``liveliness_utils.cpp`` of rmw_zenoh. Data go under
``DOMAIN/TOPIC/TYPE/HASH``; liveliness tokens under ``@ros2_lv/...`` are what ``ros2 topic list`` shows.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from struct import Struct

_NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$")
_ATTACHMENT = Struct("<qqB16s")
ATTACHMENT = _ATTACHMENT.size
"""Bytes beside each message."""


def is_topic(name: str) -> bool:
    """Whether ROS 2 takes this for the name of a topic."""
    return _NAME.match(name) is not None


def full_name(name: str, namespace: str = "/") -> str:
    """A topic's name from the root: ``imu`` in ``/bruce`` is ``/bruce/imu``."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def dds_type(name: str) -> str:
    """``sensor_msgs/msg/Imu`` -> ``sensor_msgs::msg::dds_::Imu_``."""
    package, kind, message = name.split("/")
    return f"{package}::{kind}::dds_::{message}_"


def data_key(domain: int, topic: str, type_name: str, type_hash: str) -> str:
    """The key expression of a topic's messages."""
    return f"{domain}/{topic.strip('/')}/{dds_type(type_name)}/{type_hash}"


@dataclass(frozen=True)
class Quality:
    """What a publisher offers or a subscription asks for; the rest is the middleware's default."""

    reliable: bool = True
    depth: int = 10

    def chunk(self) -> str:
        """The last part of a token: values are left out where they are the default (depth 42)."""
        reliability = "" if self.reliable else "2"
        depth = "" if self.depth == 42 else str(self.depth)
        return f"{reliability}::,{depth}:,:,:,,"


def mangled(name: str) -> str:
    """A name within one chunk of a key expression."""
    return name.replace("/", "%") or "%"


@dataclass(frozen=True)
class NodeName:
    """A node: the domain, the identity of its Zenoh session, its number in it, and its name."""

    domain: int
    session: str
    number: int
    namespace: str
    name: str

    def _place(self, entity: int, kind: str) -> str:
        namespace = mangled(self.namespace if self.namespace != "" else "/")
        return (
            f"@ros2_lv/{self.domain}/{self.session}/{self.number}/{entity}/{kind}/%/{namespace}/"
            f"{self.name}"
        )

    def token(self) -> str:
        """The node's own token."""
        return self._place(self.number, "NN")

    def endpoint(
        self, entity: int, kind: str, topic: str, type_name: str, type_hash: str, quality: Quality
    ) -> str:
        """The token of a publisher (``MP``) or a subscription (``MS``)."""
        place = f"{self._place(entity, kind)}/{mangled(topic)}"
        return f"{place}/{dds_type(type_name)}/{type_hash}/{quality.chunk()}"


def attachment(sequence: int, time: int, gid: bytes) -> bytes:
    """What goes beside a message: its number, its time [ns], and who sends (16 bytes)."""
    return _ATTACHMENT.pack(sequence, time, 16, gid)


def sequence_in(data: bytes) -> int | None:
    """The number of a message, from what came beside it; ``None`` if that is something else."""
    if len(data) != ATTACHMENT:
        return None
    sequence, _, length, _ = _ATTACHMENT.unpack(data)
    return int(sequence) if length == 16 else None
