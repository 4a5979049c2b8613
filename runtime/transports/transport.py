"""Interface of a transport of messages between machines; the runtime knows nothing else about a
network."""

from __future__ import annotations

import socket
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol, Self

from ..placement.placed import PlacedGraph

MessageCallback = Callable[[bytes], None]
"""Takes a message. It is called on a thread of the network, so it must copy and return."""


class Transport(Protocol):
    """Carries messages between the parts of one graph, by key."""

    def open(self, machine: str, lost: Callable[[str], None]) -> None:
        """Connect as ``machine``. ``lost`` is called with the name of a machine that was there and
        is gone, on a thread of the network.

        Raises:
            AloftError: the machine's endpoint cannot be used.
        """

    def publisher(self, key: str) -> MessageCallback:
        """Return a function that sends a message under ``key`` to all its subscribers."""

    @property
    def is_open(self) -> bool:
        """True if it is connected."""

    def background_publisher(self, key: str) -> MessageCallback:
        """Return a function that publishes under ``key`` to observers: at the lowest priority, and
        dropped where a queue is full."""

    def before_close(self, call: Callable[[], None]) -> None:
        """Have this called when it is about to disconnect, while everything can still be sent."""

    def subscribe(self, key: str, take: MessageCallback) -> None:
        """Have every message under ``key`` taken."""

    def close(self) -> None:
        """Disconnect; also after a failed ``open``."""


class NetworkTransport(Transport, Protocol):
    """A transport between processes; ``registry.TRANSPORTS`` lists it by the scheme of its endpoints."""

    @classmethod
    def of(cls, placed: PlacedGraph, name: str, keys: Path | None = None) -> Self:
        """Return the transport of the machine or the observer ``name``, not yet connected.

        ``keys`` is the folder of ``aloft keys``.

        Raises:
            AloftError: the endpoints and the keys do not fit together.
        """

    @classmethod
    def needs_keys(cls, placed: PlacedGraph) -> bool:
        """Return whether only holders of keys can connect to the machines of this graph."""
        return False

    @classmethod
    def local_endpoints(cls, count: int, keys: Path | None = None) -> list[str]:
        """Free endpoints on the loopback."""

    def observe(self) -> None:
        """Connect to all machines, wherever there are any yet, to subscribe and send nothing.

        Raises:
            AloftError: this is not possible.
        """


def free_ports(count: int) -> list[int]:
    """Free ports of the loopback."""
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for made in sockets:
            made.bind(("127.0.0.1", 0))
        return [made.getsockname()[1] for made in sockets]


def data_key(sender: str, receiver: str, source: str) -> str:
    """Return the key of the link that carries the outputs of the block ``source``."""
    return f"data/{sender}/{receiver}/{source}"


def beacon_key(sender: str, receiver: str) -> str:
    """Return the key under which a machine sends its phase."""
    return f"beacon/{sender}/{receiver}"


def status_key(machine: str) -> str:
    """Return the key under which a machine publishes its health to observers."""
    return f"watch/{machine}/status"


def rows_key(machine: str) -> str:
    """Return the key under which a machine shows its signals to observers."""
    return f"watch/{machine}/rows"


def window_key(machine: str) -> str:
    """Return the key under which a machine shows its signals and the times of its blocks to a
    page."""
    return f"watch/{machine}/window"


def tick_key(sender: str, receiver: str) -> str:
    """Return the key under which a machine sends the outcome of a tick."""
    return f"tick/{sender}/{receiver}"
