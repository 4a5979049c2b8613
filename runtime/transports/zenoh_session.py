"""The configuration of a Zenoh session: where it listens and connects, and what it may send and receive.

Nothing is left to Zenoh's defaults: multicast and gossip are off. Of access, each part of a graph has the
least that it needs, from the wires. Every session enforces it by itself, on what comes in and on what goes
out, for peers that it knows by the names in their certificates (mutual TLS). Whatever no rule allows is
denied. A machine may send the messages of its own links and its own beacons, and nothing else. An observer
may subscribe to what parts publish about themselves (``watch/``), and send nothing at all.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..language.stages import LEASE, PATIENCE
from ..placement.placed import PlacedGraph
from .transport import beacon_key, data_key, tick_key

BATCH = 65_000
"""Bytes of a message that go into one batch of Zenoh's; larger messages are fragments."""
LEAST_BATCHES, MOST_BATCHES = 2, 16
"""Zenoh's default number of batches in a queue, and the largest it takes."""
DROP_AFTER = 1000
"""Microseconds that a free-running publisher waits for room for a large message; Zenoh's default is 50 ms."""
ROOT = "aloft"
"""The first part of every key expression."""


@dataclass(frozen=True)
class Limits:
    """The requests of a graph to its sessions.

    Attributes:
        lease: the silence [s] after which others take a part for lost.
        patience: how long a reliable message may wait for room [s]; Zenoh then closes the connection.
        largest: the bytes of the largest message.
    """

    lease: float = LEASE
    patience: float = PATIENCE
    largest: int = 0

    @classmethod
    def of(cls, placed: PlacedGraph) -> Limits:
        """Return those of a placed graph."""
        links = placed.graph.links
        return cls(links.lease, links.patience, max((x.payload for x in placed.links), default=0))

    @property
    def batches(self) -> int:
        """The batches that wait for each publisher's priority: room for the largest message, and at least two."""
        return min(MOST_BATCHES, max(LEAST_BATCHES, self.largest // BATCH + LEAST_BATCHES))


NO_LIMITS = Limits()


def session_settings(
    listen: Sequence[str], connect: Sequence[str], limits: Limits = NO_LIMITS
) -> dict[str, Any]:
    """Return the settings of a peer that listens and connects only at these endpoints, by their
    paths in Zenoh's configuration."""
    control = "transport/link/tx/queue/congestion_control"
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
        "transport/link/tx/lease": round(1e3 * limits.lease),
        f"{control}/block/wait_before_close": round(1e6 * limits.patience),
        f"{control}/drop/max_wait_before_drop_fragments": DROP_AFTER,
        "transport/link/tx/queue/size/real_time": limits.batches,
        "transport/shared_memory/enabled": False,
    }


def session_config(
    listen: Sequence[str],
    connect: Sequence[str],
    secured: Mapping[str, Any] | None = None,
    limits: Limits = NO_LIMITS,
) -> Any:
    """Return the session's settings as a Zenoh configuration; ``secured`` adds those of TLS and access."""
    import zenoh

    config = zenoh.Config()
    for key, value in {**session_settings(listen, connect, limits), **(secured or {})}.items():
        config.insert_json5(key, json.dumps(value))
    return config


def as_chunk(name: str) -> str:
    """Return a name as one or more chunks of a key expression, without what is special there."""
    return re.sub(r"[^A-Za-z0-9_./~-]", "_", name)


def prefix_of(graph: str) -> str:
    """Return the common prefix of all key expressions of a graph."""
    return f"{ROOT}/{as_chunk(graph).replace('/', '_')}"


WATCH = "watch"
"""Prefix of the keys under which parts publish their state to observers: ``watch/MACHINE/...``; see
``links.observer``."""


def keys_from(placed: PlacedGraph, sender: str, receiver: str) -> list[str]:
    """Return the keys under which one machine sends to another."""
    keys = [beacon_key(sender, receiver), tick_key(sender, receiver)]
    keys += [
        data_key(sender, receiver, link.source)
        for link in placed.sent_by(sender)
        if link.receiver == receiver
    ]
    return [f"{prefix_of(placed.graph.name)}/{as_chunk(key)}" for key in keys]


def access_control(
    placed: PlacedGraph, machine: str, observers: Sequence[str] = ()
) -> dict[str, Any]:
    """Zenoh's ``access_control`` for the session of one machine.

    Raises:
        PlacementError: there is no such machine.
    """
    placed.machine(machine)
    prefix = prefix_of(placed.graph.name)
    rules: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    subjects: list[dict[str, Any]] = []

    def allow(name: str, flow: str, messages: list[str], keys: list[str]) -> str:
        rules.append(
            {"id": name, "permission": "allow", "flows": [flow], "messages": messages,
             "key_exprs": keys}
        )  # fmt: skip
        return name

    for spec in placed.machines:
        other = spec.name
        if other == machine:
            continue
        theirs, mine = keys_from(placed, other, machine), keys_from(placed, machine, other)
        alive, here = [f"{prefix}/alive/{other}/*"], [f"{prefix}/alive/{machine}/*"]
        token = ["liveliness_token"]
        asks = ["declare_liveliness_subscriber", "liveliness_query"]
        subjects.append({"id": other, "cert_common_names": [other]})
        policies.append(
            {
                "subjects": [other],
                "rules": [
                    allow(f"{other} sends", "ingress", ["put"], theirs),
                    allow(f"{other} hears", "egress", ["put"], mine),
                    allow(f"{other} asks for messages", "ingress", ["declare_subscriber"], mine),
                    allow(f"{other} is asked for them", "egress", ["declare_subscriber"], theirs),
                    allow(f"{other} is there", "ingress", token, alive),
                    allow(f"{other} sees this one", "egress", token, here),
                    allow(f"{other} asks who is there", "ingress", asks, here),
                    allow(f"{other} is asked whether it is", "egress", asks, alive),
                ],
            }
        )
    if observers:
        own = [f"{prefix}/{WATCH}/{machine}/**"]
        subjects.append({"id": "observers", "cert_common_names": list(observers)})
        asked = [*own, f"{prefix}/{WATCH}/**"]
        policies.append(
            {
                "subjects": ["observers"],
                "rules": [
                    allow("observers hear", "egress", ["put"], own),
                    allow("observers ask", "ingress", ["declare_subscriber"], asked),
                ],
            }
        )
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def observers_access(placed: PlacedGraph, name: str) -> dict[str, Any]:
    """Zenoh's ``access_control`` for an observer's session: it hears, and sends nothing."""
    prefix = prefix_of(placed.graph.name)
    keys = [f"{prefix}/{WATCH}/**"]
    rules = [
        {"id": "hears", "permission": "allow", "flows": ["ingress"], "messages": ["put"],
         "key_exprs": keys},
        {"id": "asks", "permission": "allow", "flows": ["egress"],
         "messages": ["declare_subscriber"], "key_exprs": keys},
    ]  # fmt: skip
    machines = [spec.name for spec in placed.machines]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": "machines", "cert_common_names": machines}],
        "policies": [{"rules": ["hears", "asks"], "subjects": ["machines"]}],
    }
