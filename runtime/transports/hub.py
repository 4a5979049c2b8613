"""A transport within one process: parts in threads exchange messages through it, as tests do.

``Hub.interfere`` may be set to a function that gets every message and returns what arrives in its
place: the same, a changed one, none, or several. So faults of a network are made on purpose.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable

from .transport import MessageCallback


class Hub:
    """Meeting point of the transports of the parts."""

    def __init__(self) -> None:
        self.interfere: Callable[[str, bytes], Iterable[bytes]] | None = None
        self._takers: dict[str, list[MessageCallback]] = {}
        self._present: dict[str, Callable[[str], None]] = {}
        self._lock = threading.Lock()

    def transport(self) -> HubTransport:
        """Make a transport for one part."""
        return HubTransport(self)

    def enter(self, machine: str, lost: Callable[[str], None]) -> None:
        """Register a machine."""
        with self._lock:
            self._present[machine] = lost

    def leave(self, machine: str) -> None:
        """Remove a machine that has closed its transport, or is to look as if its process had
        ended."""
        with self._lock:
            self._present.pop(machine, None)
            peers = list(self._present.values())
        for lost in peers:
            lost(machine)

    def add(self, key: str, take: MessageCallback) -> None:
        """Another subscriber."""
        with self._lock:
            self._takers.setdefault(key, []).append(take)

    def send(self, key: str, data: bytes) -> None:
        """Give a message to all subscribers of its key."""
        arriving = (data,) if self.interfere is None else self.interfere(key, data)
        for message in arriving:
            for take in self._takers.get(key, ()):
                take(message)


class HubTransport:
    """One part's end of a hub."""

    def __init__(self, hub: Hub) -> None:
        self.hub = hub
        self.machine = ""
        self._farewells: list[Callable[[], None]] = []

    def open(self, machine: str, lost: Callable[[str], None]) -> None:
        """Enter the hub."""
        self.machine = machine
        self.hub.enter(machine, lost)

    def publisher(self, key: str) -> MessageCallback:
        """Return a function that sends under ``key``; a machine that has left sends nothing."""

        def send(data: bytes) -> None:
            if self.machine:
                self.hub.send(key, data)

        return send

    @property
    def is_open(self) -> bool:
        """True if it has entered the hub."""
        return bool(self.machine)

    def background_publisher(self, key: str) -> MessageCallback:
        """Return a function that publishes to observers: a hub has no priorities."""
        return self.publisher(key)

    def before_close(self, call: Callable[[], None]) -> None:
        """Have this called before it leaves the hub."""
        self._farewells.append(call)

    def subscribe(self, key: str, take: MessageCallback) -> None:
        """Have messages taken until this end is closed."""

        def take_while_here(data: bytes) -> None:
            if self.machine:
                take(data)

        self.hub.add(key, take_while_here)

    def close(self) -> None:
        """Leave the hub."""
        farewells, self._farewells = self._farewells, []
        for call in farewells:
            call()
        machine, self.machine = self.machine, ""
        if machine:
            self.hub.leave(machine)
