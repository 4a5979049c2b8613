"""The transport over Zenoh. Sessions are peers that know each other's endpoints and nothing else.

Each machine listens at its own endpoint and connects to those before it in the graph. Nothing is
left to Zenoh's defaults: multicast and gossip are off, and congestion control, ``express``,
priority and reliability are said for every publisher. A machine shows by a liveliness token that it
is there. Where its process ends, the others know within milliseconds; where it freezes or the
network is cut, after ``LEASE``.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import Any

from ..language.errors import AloftError
from ..language.stages import MachineSpec
from .transport import MessageCallback

LEASE = 500
"""Milliseconds after which a peer that says nothing is taken for lost."""
ROOT = "aloft"
"""The first part of every key expression."""


def session_settings(listen: Sequence[str], connect: Sequence[str]) -> dict[str, Any]:
    """The settings of a peer that listens and connects only at these endpoints, by their paths in
    Zenoh's configuration."""
    return {
        "mode": "peer",
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "listen/endpoints": list(listen),
        "listen/exit_on_failure": True,
        "connect/endpoints": list(connect),
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {
            "period_init_ms": 50,
            "period_max_ms": 200,
            "period_increase_factor": 1.5,
        },
        "transport/link/tx/lease": LEASE,
        "transport/shared_memory/enabled": False,
    }


def session_config(
    listen: Sequence[str], connect: Sequence[str], secured: Mapping[str, Any] | None = None
) -> Any:
    """Those settings as a Zenoh configuration; ``secured`` are more of them, for TLS and access."""
    import zenoh

    config = zenoh.Config()
    for key, value in {**session_settings(listen, connect), **(secured or {})}.items():
        config.insert_json5(key, json.dumps(value))
    return config


def as_chunk(name: str) -> str:
    """A name as one or more chunks of a key expression, without what is special there."""
    return re.sub(r"[^A-Za-z0-9_./~-]", "_", name)


def prefix_of(graph: str) -> str:
    """What all key expressions of a graph begin with."""
    return f"{ROOT}/{as_chunk(graph).replace('/', '_')}"


class ZenohTransport:
    """Carries the messages of one part of a graph.

    Args:
        graph: the name of the graph, a part of every key.
        machines: all machines of the graph, in its order.
        wait: whether sending waits where the queue is full. Lockstep waits, since nothing may be
            lost; a free-running part drops, since nothing may wait.
        secured: TLS and access control, as ``key_folder.secured`` gives them; none: neither.
    """

    def __init__(
        self,
        graph: str,
        machines: Sequence[MachineSpec],
        *,
        wait: bool = True,
        secured: Mapping[str, Any] | None = None,
    ) -> None:
        self._prefix = prefix_of(graph)
        self._secured = secured
        self._machines = tuple(machines)
        self._wait = wait
        self._session: Any = None
        self._kept: list[Any] = []
        self._farewells: list[Callable[[], None]] = []

    def open(self, machine: str, lost: Callable[[str], None]) -> None:
        """Open the session and say that the machine is there."""
        import zenoh

        names = [spec.name for spec in self._machines]
        place = names.index(machine)
        own = self._machines[place].endpoint
        try:
            self._session = zenoh.open(
                session_config(
                    [own], [spec.endpoint for spec in self._machines[:place]], self._secured
                )
            )
        except zenoh.ZError as error:
            raise AloftError(
                f"machine {machine!r} cannot listen at {own}: {_first_line(error)}. Another run may "
                f"use it, or the address is not one of this machine; --set machines.{machine}=..."
            ) from error
        liveliness = self._session.liveliness()

        def changed(sample: Any) -> None:
            if sample.kind == zenoh.SampleKind.DELETE:
                lost(str(sample.key_expr).rpartition("/")[2])

        for name in names:
            if name != machine:
                self._keep(
                    liveliness.declare_subscriber(
                        f"{self._prefix}/alive/{name}",
                        zenoh.handlers.Callback(changed, indirect=False),
                        history=True,
                    )
                )
        self._keep(liveliness.declare_token(f"{self._prefix}/alive/{machine}"))

    def _keep(self, declared: Any) -> None:
        self._kept.append(declared)

    @property
    def is_open(self) -> bool:
        """Whether it is connected."""
        return self._session is not None

    def background_publisher(self, key: str) -> MessageCallback:
        """A publisher that never delays any other."""
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
        """A publisher whose messages go out at once."""
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
        """A subscriber that is called on a thread of Zenoh."""
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
        self._kept.clear()
        if session is not None:
            with suppress(Exception):  # whatever a network does, a part ends
                session.close()


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0].partition(" at ")[0]
