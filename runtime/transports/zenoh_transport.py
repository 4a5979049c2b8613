"""The transport over Zenoh. Sessions are peers that know each other's endpoints and nothing else.

Each machine listens at its own endpoint and connects to those before it in the graph. Congestion control,
``express``, priority and reliability are given for every publisher. A machine shows by a liveliness token
that it is there. Where its process ends, the others know within milliseconds; where it freezes or the
network is cut, after the lease.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

from ..language.errors import AloftError
from ..language.stages import MachineSpec
from ..placement.placed import PlacedGraph
from .tls import check_endpoints, secured
from .transport import MessageCallback, NetworkTransport, free_ports
from .zenoh_session import NO_LIMITS, Limits, as_chunk, prefix_of, session_config


class ZenohTransport(NetworkTransport):
    """Carries the messages of one part of a graph.

    Args:
        graph: the name of the graph, a part of every key.
        machines: all machines of the graph, in its order.
        wait: whether sending waits where the queue is full. Lockstep waits, since nothing may be
            lost; a free-running part drops, since nothing may wait.
        limits: lease, patience and the largest message.
        security: TLS and access control, as ``tls.secured`` gives them; none: neither.
    """

    def __init__(
        self,
        graph: str,
        machines: Sequence[MachineSpec],
        *,
        wait: bool = True,
        limits: Limits = NO_LIMITS,
        security: Mapping[str, Any] | None = None,
    ) -> None:
        self._prefix = prefix_of(graph)
        self._security = security
        self._machines = tuple(machines)
        self._wait = wait
        self._limits = limits
        self._session: Any = None
        self._declared: list[Any] = []
        self._farewells: list[Callable[[], None]] = []

    @classmethod
    def of(cls, placed: PlacedGraph, name: str, keys: Path | None = None) -> Self:
        """Return the transport of a machine or an observer; ``tls`` endpoints need keys."""
        if keys is not None:
            check_endpoints(placed)
        elif cls.needs_keys(placed):
            raise AloftError(
                "links over TLS need certificates: `aloft keys GRAPH` makes them, and "
                "--keys FOLDER takes them"
            )
        return cls(
            placed.graph.name,
            placed.machines,
            wait=placed.graph.links.mode == "lockstep",
            limits=Limits.of(placed),
            security=None if keys is None else secured(placed, keys, name),
        )

    @classmethod
    def needs_keys(cls, placed: PlacedGraph) -> bool:
        """Return whether an endpoint is ``tls``."""
        return any(spec.endpoint.startswith("tls/") for spec in placed.machines)

    @classmethod
    def local_endpoints(cls, count: int, keys: Path | None = None) -> list[str]:
        """TCP endpoints, with keys TLS."""
        scheme = "tcp" if keys is None else "tls"
        return [f"{scheme}/127.0.0.1:{port}" for port in free_ports(count)]

    def observe(self) -> None:
        """Open a session that connects to all machines and listens nowhere."""
        import zenoh

        endpoints = [spec.endpoint for spec in self._machines]
        try:
            self._session = zenoh.open(session_config([], endpoints, self._security, self._limits))
        except zenoh.ZError as error:
            raise AloftError(f"no session of Zenoh could be opened: {error}") from error

    def open(self, machine: str, lost: Callable[[str], None]) -> None:
        """Open the session and say that the machine is there."""
        import zenoh

        names = [spec.name for spec in self._machines]
        place = names.index(machine)
        own = self._machines[place].endpoint
        try:
            self._session = zenoh.open(
                session_config(
                    [own],
                    [spec.endpoint for spec in self._machines[:place]],
                    self._security,
                    self._limits,
                )
            )
        except zenoh.ZError as error:
            raise AloftError(
                f"machine {machine!r} cannot listen at {own}: {_first_line(error)}. Another run may "
                f"use it, or the address is not one of this machine; --set machines.{machine}=..."
            ) from error
        liveliness = self._session.liveliness()
        present: dict[str, set[str]] = {name: set() for name in names}

        def changed(sample: Any) -> None:
            name, session = str(sample.key_expr).rsplit("/", 2)[1:]
            if sample.kind != zenoh.SampleKind.DELETE:
                present[name].add(session)
                return
            present[name].discard(session)
            if not present[name]:  # a second one that was refused leaves the first where it is
                lost(name)

        for name in names:
            if name != machine:
                self._keep(
                    liveliness.declare_subscriber(
                        f"{self._prefix}/alive/{name}/*",
                        zenoh.handlers.Callback(changed, indirect=False),
                        history=True,
                    )
                )
        self._keep(
            liveliness.declare_token(f"{self._prefix}/alive/{machine}/{self._session.zid()}")
        )

    def _keep(self, declared: Any) -> None:
        self._declared.append(declared)

    @property
    def is_open(self) -> bool:
        """True if it is connected."""
        return self._session is not None

    def background_publisher(self, key: str) -> MessageCallback:
        """Return a publisher that never delays any other."""
        import zenoh

        publisher = self._session.declare_publisher(
            f"{self._prefix}/{as_chunk(key)}",
            congestion_control=zenoh.CongestionControl.DROP,
            express=False,
            priority=zenoh.Priority.BACKGROUND,
            reliability=zenoh.Reliability.BEST_EFFORT,
        )
        self._keep(publisher)
        put: MessageCallback = publisher.put
        return put

    def before_close(self, call: Callable[[], None]) -> None:
        """Have this called before the session is closed."""
        self._farewells.append(call)

    def publisher(self, key: str) -> MessageCallback:
        """Return a publisher whose messages go out at once."""
        import zenoh

        publisher = self._session.declare_publisher(
            f"{self._prefix}/{as_chunk(key)}",
            congestion_control=zenoh.CongestionControl.BLOCK
            if self._wait
            else zenoh.CongestionControl.DROP,
            # an express message that may be dropped takes one of two places, so bursts are lost
            express=self._wait,
            priority=zenoh.Priority.REAL_TIME,
            reliability=zenoh.Reliability.RELIABLE,
        )
        self._keep(publisher)
        put: MessageCallback = publisher.put
        return put

    def subscribe(self, key: str, take: MessageCallback) -> None:
        """Subscribe to a key; the call comes from a thread of Zenoh."""
        import zenoh

        def heard(sample: Any) -> None:
            take(sample.payload.to_bytes())

        self._keep(
            self._session.declare_subscriber(
                f"{self._prefix}/{as_chunk(key)}", zenoh.handlers.Callback(heard, indirect=False)
            )
        )

    def close(self) -> None:
        """Close the session; a session that stays open would keep the process from ending."""
        farewells, self._farewells = self._farewells, []
        for call in farewells if self._session is not None else ():
            with suppress(Exception):  # whatever somebody wants to say, a part ends
                call()
        session, self._session = self._session, None
        self._declared.clear()
        if session is not None:
            with suppress(Exception):  # whatever a network does, a part ends
                session.close()


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0].partition(" at ")[0]
