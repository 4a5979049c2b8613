"""The transport over UDP between processes of one machine: datagrams on the loopback, and nothing else.

Every machine binds a socket at its endpoint and *announces* itself to the others ten times a second,
with the keys that it subscribes to. A machine that has announced nothing for ``LEASE`` is lost. Observers
announce themselves as well, and may subscribe to what parts publish about themselves (``watch/``) only.

A message longer than ``PIECE`` is split and joined. In lockstep every datagram is acknowledged, and sent
again until it is, at most ``RETRIES`` times; then the receiver is lost. What arrives twice is dropped.
Between parts that run free, and to observers, each datagram is sent once: the receiving end of the link
counts what is lost, late or doubled, and does what its policy says. Messages may arrive in another order.

UDP neither encrypts nor knows who sends, so no endpoint beyond the loopback is taken. Links between
machines are ``tcp/`` or, with certificates, ``tls/``.
"""

from __future__ import annotations

import os
import select
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from enum import IntEnum
from hashlib import blake2b
from pathlib import Path
from struct import Struct
from typing import Self
from zlib import crc32

from ..language.errors import AloftError
from ..placement.placed import PlacedGraph
from .transport import MessageCallback, NetworkTransport, free_ports

LOOPBACK = "127.0.0.1"
PIECE = 8192
"""The most bytes of a message in one datagram."""
WINDOW = 8
"""Datagrams to one receiver that may wait for an acknowledgement: fewer than its socket can hold."""
ANNOUNCE_PERIOD = 0.1
"""Seconds between two announcements."""
LEASE = 3.0
"""Seconds after which a machine that announces nothing is lost. A library that keeps Python's interpreter to
itself keeps this transport from announcing."""
RESEND_AFTER, LONGEST_WAIT = 0.02, 0.32
"""Seconds until a datagram is sent for the second time, doubled each time up to the longest."""
RETRIES = 20
LOOK_PERIOD = 0.01
"""Seconds between two looks at what is due."""
FLUSH_TIME = 0.5
"""Seconds that ``close`` waits for acknowledgements."""
MOST_OBSERVERS = 16
MOST_PARTIAL = 16
"""Messages of one sender of which some pieces have arrived, at most."""
MOST_DONE = 4096
"""Numbers of messages that are remembered to recognise what arrives twice."""
_HEAD = Struct("<IB8s8sQHH")
_FIELDS = Struct("<B8s8sQHH")
_CHECKSUM = Struct("<I")
_NO_KEY = bytes(8)
_OPEN_TO_ALL = "watch/"


class Kind(IntEnum):
    """Kind of a datagram."""

    ANNOUNCE = 0
    LEAVE = 1
    ONCE = 2
    RELIABLE = 3
    ACKNOWLEDGE = 4


Address = tuple[str, int]
Place = tuple[int, int]
"""The number of a message, and that of one of its pieces."""


@dataclass
class _Unconfirmed:
    """A datagram that waits for its acknowledgement."""

    datagram: bytes
    due: float
    wait: float = RESEND_AFTER
    retries: int = 0


@dataclass
class _Peer:
    """Another machine, or an observer, which has no name."""

    name: str
    address: Address
    session: bytes
    keys: frozenset[bytes] = frozenset()
    announced_at: float = 0.0
    is_present: bool = True
    # what is sent to it
    next_number: dict[Kind, int] = field(default_factory=dict)
    queue: deque[tuple[Place, bytes]] = field(default_factory=deque)
    unconfirmed: dict[Place, _Unconfirmed] = field(default_factory=dict)
    # what has been received from it
    partial: dict[tuple[Kind, int], dict[int, bytes]] = field(default_factory=dict)
    done: dict[int, None] = field(default_factory=dict)
    all_done_below: int = 0

    def is_done(self, number: int) -> bool:
        """Return whether a reliable message has been received whole before."""
        return number < self.all_done_below or number in self.done

    def set_done(self, number: int) -> None:
        """Remember that a reliable message has been received whole."""
        self.done[number] = None
        while self.all_done_below in self.done:
            del self.done[self.all_done_below]
            self.all_done_below += 1
        if len(self.done) > MOST_DONE:  # a gap that is never filled: its sender gave up
            self.all_done_below = min(self.done)

    def join(self, kind: Kind, place: Place, count: int, piece: bytes) -> bytes | None:
        """Add a piece; gives the message once it is whole."""
        number, index = place
        if count == 1:
            return piece
        pieces = self.partial.setdefault((kind, number), {})
        pieces[index] = piece
        if len(pieces) == count:
            del self.partial[kind, number]
            return b"".join(pieces[i] for i in range(count))
        once = [known for known in self.partial if known[0] is Kind.ONCE]
        if len(once) > MOST_PARTIAL:  # a piece of the oldest was lost
            del self.partial[min(once)]
        return None


class UdpTransport(NetworkTransport):
    """Carries the messages of one part of a graph, or of an observer, as datagrams on the loopback.

    Args:
        graph: the name of the graph; messages of other graphs are ignored.
        endpoints: of all machines of the graph, by name.
        reliable: whether messages are sent again until they are acknowledged.

    Raises:
        AloftError: an endpoint is not on the loopback.
    """

    def __init__(self, graph: str, endpoints: dict[str, str], *, reliable: bool = True) -> None:
        self._graph = graph
        self._machines = {name: _address_of(endpoint) for name, endpoint in endpoints.items()}
        self._reliable = reliable
        self._session = os.urandom(8)
        self._machine = ""
        self._lost: Callable[[str], None] = lambda name: None
        self._socket: socket.socket | None = None
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self._lock = threading.Lock()
        self._peers: dict[Address, _Peer] = {}
        self._callbacks: dict[bytes, list[MessageCallback]] = {}
        self._closing_calls: list[Callable[[], None]] = []
        self._announce_at = self._look_at = 0.0

    @classmethod
    def of(cls, placed: PlacedGraph, name: str, keys: Path | None = None) -> Self:
        """Return the transport of a machine or an observer; there are no keys."""
        if keys is not None:
            raise AloftError(
                f"links over UDP stay on one machine and take no keys: leave out --keys {keys}, or "
                f"write endpoints tls/ADDRESS:PORT"
            )
        endpoints = {spec.name: spec.endpoint for spec in placed.machines}
        reliable = placed.graph.links.mode == "lockstep"
        return cls(placed.graph.name, endpoints, reliable=reliable)

    @classmethod
    def host_fault(cls, host: str) -> str:
        """UDP neither encrypts nor knows who sends, so only the loopback is allowed."""
        if host == LOOPBACK:
            return ""
        return (
            f"links over UDP are neither encrypted nor authenticated, so they stay on {LOOPBACK}; "
            "between machines use tcp/ or tls/"
        )

    @classmethod
    def local_endpoints(cls, count: int, keys: Path | None = None) -> list[str]:
        """Ports that no socket of UDP is bound to."""
        return [f"udp/{LOOPBACK}:{port}" for port in free_ports(count, socket.SOCK_DGRAM)]

    # -- connecting --------------------------------------------------------------------------------

    def open(self, machine: str, lost: Callable[[str], None]) -> None:
        """Bind the machine's endpoint and announce it."""
        self._machine, self._lost = machine, lost
        host, port = self._machines[machine]
        try:
            self._start((host, port))
        except OSError as error:
            raise AloftError(
                f"machine {machine!r} cannot listen at udp/{host}:{port}: {error.strerror}. Another "
                f"run may use it; --set machines.{machine}=..."
            ) from error

    def observe(self) -> None:
        """Bind any port, and announce an observer."""
        try:
            self._start((LOOPBACK, 0))
        except OSError as error:
            raise AloftError(f"no UDP socket could be opened: {error.strerror}") from error

    def _start(self, address: Address) -> None:
        made = socket.socket(type=socket.SOCK_DGRAM)
        try:
            made.bind(address)
        except OSError:
            made.close()
            raise
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22)
        made.setblocking(False)
        self._socket = made
        self._thread = threading.Thread(target=self._run, name="aloft udp", daemon=True)
        self._thread.start()

    @property
    def is_open(self) -> bool:
        """True if the socket is open."""
        return self._socket is not None

    def before_close(self, call: Callable[[], None]) -> None:
        """Register a call that is made before the others learn that this machine leaves."""
        self._closing_calls.append(call)

    def close(self) -> None:
        """Wait for acknowledgements, say goodbye, and close the socket."""
        calls, self._closing_calls = self._closing_calls, []
        for call in calls if self._socket is not None else ():
            with suppress(Exception):  # whatever somebody wants to say, a part ends
                call()
        if self._thread is not None:
            end = time.monotonic() + FLUSH_TIME
            while time.monotonic() < end and any(p.unconfirmed for p in list(self._peers.values())):
                time.sleep(LOOK_PERIOD)
            self._ended.set()
            self._thread.join(1.0)
        if self._socket is not None:
            goodbye = self._datagram(Kind.LEAVE)
            for address in self._everybody():
                self._send(goodbye, address)
            self._socket.close()
        self._socket = self._thread = None

    # -- publishing and subscribing ----------------------------------------------------------------

    def publisher(self, key: str) -> MessageCallback:
        """Return a function that sends a message to all that subscribe to ``key``, reliably in
        lockstep."""
        return self._publisher(key, Kind.RELIABLE if self._reliable else Kind.ONCE)

    def background_publisher(self, key: str) -> MessageCallback:
        """Return a function that sends a message once to all that subscribe to ``key``."""
        return self._publisher(key, Kind.ONCE)

    def _publisher(self, key: str, kind: Kind) -> MessageCallback:
        hashed, for_observers = self._hash(key), key.startswith(_OPEN_TO_ALL)

        def publish(data: bytes) -> None:
            with self._lock:
                for peer in self._peers.values():
                    if peer.is_present and hashed in peer.keys and (peer.name or for_observers):
                        self._send_message(peer, kind, hashed, data)

        return publish

    def _send_message(self, peer: _Peer, kind: Kind, key: bytes, data: bytes) -> None:
        number = peer.next_number.get(kind, 0)
        peer.next_number[kind] = number + 1
        count = max(1, -(-len(data) // PIECE))
        for index in range(count):
            piece = data[index * PIECE : (index + 1) * PIECE]
            datagram = self._datagram(kind, key, (number, index), count, piece)
            if kind is Kind.ONCE:
                self._send(datagram, peer.address)
            else:
                peer.queue.append(((number, index), datagram))
        self._send_queued(peer)

    def _send_queued(self, peer: _Peer) -> None:
        """Send as many datagrams as may wait for an acknowledgement."""
        while peer.queue and len(peer.unconfirmed) < WINDOW:
            place, datagram = peer.queue.popleft()
            peer.unconfirmed[place] = _Unconfirmed(datagram, time.monotonic() + RESEND_AFTER)
            self._send(datagram, peer.address)

    def subscribe(self, key: str, take: MessageCallback) -> None:
        """Have messages taken by the thread of this transport."""
        callbacks = {**self._callbacks}
        callbacks[self._hash(key)] = [*callbacks.get(self._hash(key), ()), take]
        self._callbacks = callbacks
        self._announce(self._everybody())

    def _hash(self, key: str) -> bytes:
        return blake2b(f"{self._graph}/{key}".encode(), digest_size=8).digest()

    # -- datagrams ---------------------------------------------------------------------------------

    def _datagram(
        self,
        kind: Kind,
        key: bytes = _NO_KEY,
        place: Place = (0, 0),
        count: int = 1,
        body: bytes = b"",
    ) -> bytes:
        rest = _FIELDS.pack(kind, self._session, key, *place, count) + body
        return _CHECKSUM.pack(crc32(rest)) + rest

    def _send(self, datagram: bytes, address: Address) -> None:
        made = self._socket
        if made is not None:
            with suppress(OSError):  # full buffers lose datagrams, as any network may
                made.sendto(datagram, address)

    def _everybody(self) -> list[Address]:
        """All other machines, and the observers that are there."""
        machines = [a for name, a in self._machines.items() if name != self._machine]
        with self._lock:
            return [*machines, *(p.address for p in self._peers.values() if not p.name)]

    def _announce(self, addresses: Iterable[Address]) -> None:
        name = self._machine.encode()
        body = bytes([len(name)]) + name + b"".join(self._callbacks)
        datagram = self._datagram(Kind.ANNOUNCE, self._hash(""), body=body)
        for address in addresses:
            self._send(datagram, address)

    # -- the thread --------------------------------------------------------------------------------

    def _run(self) -> None:
        made = self._socket
        assert made is not None
        waiting = select.poll()
        waiting.register(made, select.POLLIN)
        while not self._ended.is_set():
            ready = waiting.poll(LOOK_PERIOD * 1e3)
            for _ in range(WINDOW if ready else 0):
                try:
                    data, address = made.recvfrom(1 << 16)
                except OSError:
                    break
                with suppress(Exception):  # whatever bytes do, this thread goes on
                    self._take(data, address)
            now = time.monotonic()
            if now >= self._look_at:
                self._look_at = now + LOOK_PERIOD
                self._look(now)

    def _look(self, now: float) -> None:
        """Announce, send again, and find who is lost."""
        if now >= self._announce_at:
            self._announce_at = now + ANNOUNCE_PERIOD
            self._announce(self._everybody())
        gone = []
        with self._lock:
            for peer in [peer for peer in self._peers.values() if peer.is_present]:
                late = [each for each in peer.unconfirmed.values() if now >= each.due]
                if now - peer.announced_at > LEASE or any(e.retries >= RETRIES for e in late):
                    gone.append(peer)
                    continue
                for each in late:
                    each.retries += 1
                    each.wait = min(2.0 * each.wait, LONGEST_WAIT)
                    each.due = now + each.wait
                    self._send(each.datagram, peer.address)
        for peer in gone:
            self._lose(peer)

    def _lose(self, peer: _Peer) -> None:
        with self._lock:
            was_present, peer.is_present = peer.is_present, False
            peer.queue.clear()
            peer.unconfirmed.clear()
            if not peer.name:
                self._peers.pop(peer.address, None)
        if was_present and peer.name:
            self._lost(peer.name)

    def _take(self, data: bytes, address: Address) -> None:
        checksum, number, session, key, message, index, count = _HEAD.unpack_from(data)
        if crc32(memoryview(data)[_CHECKSUM.size :]) != checksum:
            return
        kind, body = Kind(number), data[_HEAD.size :]
        if kind is Kind.ANNOUNCE:
            if key == self._hash(""):
                self._take_announcement(body, session, address)
            return
        peer = self._peers.get(address)
        if peer is None or peer.session != session:
            return
        if kind is Kind.LEAVE:
            self._lose(peer)
        elif kind is Kind.ACKNOWLEDGE:
            with self._lock:
                peer.unconfirmed.pop((message, index), None)
                self._send_queued(peer)
        elif peer.name and index < count:
            self._take_piece(peer, kind, key, (message, index), count, body)

    def _take_piece(
        self, peer: _Peer, kind: Kind, key: bytes, place: Place, count: int, piece: bytes
    ) -> None:
        if kind is Kind.RELIABLE:
            self._send(self._datagram(Kind.ACKNOWLEDGE, key, place, count), peer.address)
            if peer.is_done(place[0]):
                return
        message = peer.join(kind, place, count, piece)
        if message is None:
            return
        if kind is Kind.RELIABLE:
            peer.set_done(place[0])
        for take in self._callbacks.get(key, ()):
            with suppress(Exception):  # the next one gets it, too
                take(message)

    def _take_announcement(self, body: bytes, session: bytes, address: Address) -> None:
        name = body[1 : 1 + body[0]].decode()
        hashes = body[1 + body[0] :]
        keys = frozenset(hashes[i : i + 8] for i in range(0, len(hashes), 8))
        owner = next((n for n, known in self._machines.items() if known == address), "")
        if address[0] != LOOPBACK or name != owner:
            return  # a machine has its endpoint, and an observer has none
        peer = self._peers.get(address)
        is_new = peer is None or peer.session != session
        if peer is None and not name and self._count_observers() >= MOST_OBSERVERS:
            return
        if peer is not None and is_new:  # it was started again
            self._lose(peer)
        with self._lock:
            if peer is None or is_new:
                peer = self._peers[address] = _Peer(name, address, session)
            peer.keys, peer.announced_at, peer.is_present = keys, time.monotonic(), True
        if is_new:
            self._announce([address])

    def _count_observers(self) -> int:
        return sum(not peer.name for peer in self._peers.values())


def _address_of(endpoint: str) -> Address:
    host, _, port = endpoint.partition("/")[2].rpartition(":")
    fault = UdpTransport.host_fault(host)
    if fault:
        raise AloftError(f"{endpoint}: {fault}")
    return host, int(port)
