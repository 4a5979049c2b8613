"""One node of ROS 2's graph: a Zenoh session that the blocks of one process share.

It connects to a router as ROS 2's own processes do, in a thread of its own and again and again, so a
graph starts and runs without one. Nothing here is called by the control thread while a run goes on.

Names and attachments are those of ROS 2's middleware over Zenoh (rmw_zenoh, Jazzy and newer): data go
under ``DOMAIN/TOPIC/TYPE/HASH``; liveliness tokens under ``@ros2_lv/...`` are what ``ros2 topic list``
shows. Sources: the design document and ``liveliness_utils.cpp`` of rmw_zenoh.
"""

from __future__ import annotations

import atexit
import json
import re
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from hashlib import blake2b
from struct import Struct
from typing import Any

from ...runtime.language.errors import need_extra

_NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$")
_ATTACHMENT = Struct("<qqB16s")
ATTACHMENT = _ATTACHMENT.size
"""Bytes beside each message."""


def is_topic(name: str) -> bool:
    """Check whether ROS 2 accepts this as the name of a topic."""
    return _NAME.match(name) is not None


def full_name(name: str, namespace: str = "/") -> str:
    """Return a topic's name from the root: ``imu`` in ``/bruce`` is ``/bruce/imu``."""
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"


def dds_type(name: str) -> str:
    """Convert ``sensor_msgs/msg/Imu`` to ``sensor_msgs::msg::dds_::Imu_``."""
    package, kind, message = name.split("/")
    return f"{package}::{kind}::dds_::{message}_"


def data_key(domain: int, topic: str, type_name: str, type_hash: str) -> str:
    """Return the key expression of a topic's messages."""
    return f"{domain}/{topic.strip('/')}/{dds_type(type_name)}/{type_hash}"


@dataclass(frozen=True)
class Quality:
    """Quality of service of a publisher or subscription; the rest is the middleware's default."""

    reliable: bool = True
    depth: int = 10

    def chunk(self) -> str:
        """Return the last part of a token: values are left out where they are the default (depth 42)."""
        reliability = "" if self.reliable else "2"
        depth = "" if self.depth == 42 else str(self.depth)
        return f"{reliability}::,{depth}:,:,:,,"


def mangled(name: str) -> str:
    """Return a name within one chunk of a key expression."""
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
        """Return the node's own token."""
        return self._place(self.number, "NN")

    def endpoint(
        self, entity: int, kind: str, topic: str, type_name: str, type_hash: str, quality: Quality
    ) -> str:
        """Return the token of a publisher (``MP``) or a subscription (``MS``)."""
        place = f"{self._place(entity, kind)}/{mangled(topic)}"
        return f"{place}/{dds_type(type_name)}/{type_hash}/{quality.chunk()}"


def attachment(sequence: int, time: int, gid: bytes) -> bytes:
    """Return the attachment of a message: its number, its time [ns], and the sender (16 bytes)."""
    return _ATTACHMENT.pack(sequence, time, 16, gid)


def sender_in(data: bytes) -> tuple[bytes, int] | None:
    """Return who sent a message (16 bytes) and its number, from what came beside it; ``None`` if that is
    something else."""
    if len(data) != ATTACHMENT:
        return None
    sequence, _, length, gid = _ATTACHMENT.unpack(data)
    return (gid, int(sequence)) if length == 16 else None


RETRY = 0.5
"""Seconds between two attempts to reach the router."""


@dataclass(frozen=True)
class NodeAddress:
    """Address of a node: the router's endpoint, the domain, namespace and name."""

    router: str
    domain: int
    namespace: str
    name: str


@dataclass(frozen=True)
class Endpoint:
    """Publisher or subscription that a block announces.

    ``joined`` is called with the session, the key of the data and the 16 bytes that name the endpoint;
    what it returns is kept until the node is left.
    """

    kind: str
    topic: str
    type_name: str
    type_hash: str
    quality: Quality
    joined: Callable[[Any, str, bytes], Any]


class Node:
    """Joins ROS 2's graph as soon as there is a router, and announces what blocks have given it."""

    def __init__(self, address: NodeAddress) -> None:
        self.address = address
        self.users = 0
        self._endpoints: list[Endpoint] = []
        self._left = threading.Event()
        self._news = threading.Event()
        self._thread = threading.Thread(target=self._run, name="aloft ros2", daemon=True)

    def add(self, endpoint: Endpoint) -> None:
        """Announce one more."""
        self._endpoints.append(endpoint)
        if not self._thread.is_alive() and not self._left.is_set():
            self._thread.start()
        self._news.set()

    def leave(self) -> None:
        """Take everything back; waits for at most two seconds."""
        self._left.set()
        self._news.set()
        if self._thread.is_alive():
            self._thread.join(2.0)

    def _run(self) -> None:
        session = None
        while session is None and not self._left.is_set():
            session = _open(self.address.router)
            if session is None:
                self._left.wait(RETRY)
        if session is None:
            return
        try:
            self._announce(session)
        finally:
            with suppress(Exception):  # whatever a network does, a run ends
                session.close()

    def _announce(self, session: Any) -> None:
        address = self.address
        name = NodeName(address.domain, str(session.info.zid()), 0, address.namespace, address.name)
        kept = [session.liveliness().declare_token(name.token())]
        done = 0
        while not self._left.is_set():
            while done < len(self._endpoints):
                endpoint = self._endpoints[done]
                done += 1
                topic = full_name(endpoint.topic, address.namespace)
                token = name.endpoint(
                    done, endpoint.kind, topic, endpoint.type_name, endpoint.type_hash,
                    endpoint.quality,
                )  # fmt: skip
                key = data_key(address.domain, topic, endpoint.type_name, endpoint.type_hash)
                gid = blake2b(token.encode(), digest_size=16).digest()
                kept.append(endpoint.joined(session, key, gid))
                kept.append(session.liveliness().declare_token(token))
            self._news.wait()
            self._news.clear()


def _open(router: str) -> Any:
    import zenoh

    config = zenoh.Config()
    for key, value in {
        "mode": "client",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "connect/endpoints": [router],
        "connect/timeout_ms": 0,
        "connect/exit_on_failure": True,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(key, json.dumps(value))
    try:
        return zenoh.open(config)
    except zenoh.ZError:
        return None


_NODES: dict[NodeAddress, Node] = {}
_LOCK = threading.Lock()


def join(address: NodeAddress) -> Node:
    """Return the node of this address, for one more block. Raises ``MissingExtraError``."""
    need_extra("rosbags", "ros2", "a topic of ROS 2")
    with _LOCK:
        node = _NODES.setdefault(address, Node(address))
        node.users += 1
        return node


@atexit.register
def _leave_all() -> None:
    """Leave all nodes: a process must not end while a thread of its own is within Zenoh."""
    for node in list(_NODES.values()):
        node.leave()


def leave(node: Node) -> None:
    """Leave the node for one block; the last closes it."""
    with _LOCK:
        node.users -= 1
        last = node.users == 0
        if last and _NODES.get(node.address) is node:
            del _NODES[node.address]
    if last:
        node.leave()
