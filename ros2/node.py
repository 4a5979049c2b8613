"""One node of ROS 2's graph: a Zenoh session that the blocks of one process share.

It connects to a router as ROS 2's own processes do, in a thread of its own and again and again, so a
graph starts and runs without one. Nothing here is called by the control thread while a run goes on.
"""

from __future__ import annotations

import atexit
import json
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from hashlib import blake2b
from typing import Any

from .names import NodeName, Quality, data_key, full_name

RETRY = 0.5
"""Seconds between two attempts to reach the router."""


@dataclass(frozen=True)
class Place:
    """Where a node is: the router's endpoint, the domain, namespace and name."""

    router: str
    domain: int
    namespace: str
    name: str


@dataclass(frozen=True)
class Endpoint:
    """What a block announces: a publisher or a subscription.

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

    def __init__(self, place: Place) -> None:
        self.place = place
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
            session = _open(self.place.router)
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
        place = self.place
        name = NodeName(place.domain, str(session.info.zid()), 0, place.namespace, place.name)
        kept = [session.liveliness().declare_token(name.token())]
        done = 0
        while not self._left.is_set():
            while done < len(self._endpoints):
                endpoint = self._endpoints[done]
                done += 1
                topic = full_name(endpoint.topic, place.namespace)
                token = name.endpoint(
                    done, endpoint.kind, topic, endpoint.type_name, endpoint.type_hash,
                    endpoint.quality,
                )  # fmt: skip
                key = data_key(place.domain, topic, endpoint.type_name, endpoint.type_hash)
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


_NODES: dict[Place, Node] = {}
_LOCK = threading.Lock()


def join(place: Place) -> Node:
    """The node at a place, for one more block."""
    with _LOCK:
        node = _NODES.setdefault(place, Node(place))
        node.users += 1
        return node


@atexit.register
def _leave_all() -> None:
    """A process must not end while a thread of its own is within Zenoh."""
    for node in list(_NODES.values()):
        node.leave()


def leave(node: Node) -> None:
    """One block needs the node no more; the last closes it."""
    with _LOCK:
        node.users -= 1
        last = node.users == 0
        if last and _NODES.get(node.place) is node:
            del _NODES[node.place]
    if last:
        node.leave()
