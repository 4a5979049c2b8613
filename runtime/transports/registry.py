"""Registry of the transports that carry the links of a graph, and the form of their endpoints.

An endpoint is ``SCHEME/ADDRESS:PORT``. All machines of a graph use one transport. Another transport is a
class with the methods of ``NetworkTransport`` in a file of its own, and a line in ``TRANSPORTS``.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Sequence
from ipaddress import ip_address
from pathlib import Path

from ..language.stages import MachineSpec
from ..placement.placed import PlacedGraph
from .transport import NetworkTransport
from .zenoh_transport import ZenohTransport

TRANSPORTS: dict[str, type[NetworkTransport]] = {
    "tcp": ZenohTransport,
    "tls": ZenohTransport,
}
"""The class of each scheme."""
EXAMPLE = "tcp/127.0.0.1:7450"
_ENDPOINT = re.compile(
    r"(?P<scheme>[a-z0-9]+)/(?P<host>\[[0-9a-fA-F:.]+\]|[A-Za-z0-9.-]+):(?P<port>[0-9]+)$"
)


def endpoint_pattern() -> str:
    """Return a regular expression for endpoints, as in a JSON Schema."""
    return f"^({'|'.join(TRANSPORTS)})/.+:[0-9]+$"


def endpoint_problem(text: str) -> str:
    """Describe the fault of an endpoint; empty if there is none."""
    match = _ENDPOINT.match(text)
    if match is None or match["scheme"] not in TRANSPORTS:
        *most, last = [f"{scheme}/ADDRESS:PORT" for scheme in TRANSPORTS]
        return f"it is not of the form {', '.join(most)} or {last}"
    if not 1 <= int(match["port"]) <= 65535:
        return f"port {match['port']} is not between 1 and 65535"
    host = match["host"].strip("[]")
    try:
        address = ip_address(host)
    except ValueError:
        pass  # a name, which is looked up when the run begins
    else:
        if address.is_unspecified:
            return "it stands for all addresses of a machine, and the others need one to connect to"
        if address.is_multicast:
            return "a multicast address is not the address of one machine"
    return ""


def open_endpoints(machines: Sequence[MachineSpec]) -> list[str]:
    """Return warnings on machines that anybody in their network can reach: one text for each whose
    endpoint is beyond the loopback and requires no keys."""
    return [
        f"machine {spec.name!r} listens at {spec.endpoint}: whoever reaches it can read and command this "
        "graph; `aloft keys` makes certificates for tls/ endpoints"
        for spec in machines
        if _parts(spec.endpoint)[0] != "tls" and not _is_loopback(spec.endpoint)
    ]


def _parts(endpoint: str) -> tuple[str, str, int]:
    """Scheme, host and port of an endpoint that was checked when the graph was loaded."""
    match = _ENDPOINT.match(endpoint)
    assert match is not None, endpoint
    return match["scheme"], match["host"].strip("[]"), int(match["port"])


def _is_loopback(endpoint: str) -> bool:
    host = _parts(endpoint)[1]
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def silent_endpoint(endpoint: str) -> str:
    """Find the likely cause of a machine's silence: whether anybody listens at its endpoint. Opens
    a connection and sends nothing."""
    scheme, host, port = _parts(endpoint)
    try:
        socket.create_connection((host, port), 0.3).close()
    except OSError as error:
        return f"no connection to {endpoint}: {error.strerror or error}"
    keys = "are the keys of this graph's authority? Or does it" if scheme == "tls" else "does it"
    return f"{endpoint} listens and says nothing of this graph: {keys} run another graph?"


def transport_type(machines: Sequence[MachineSpec]) -> type[NetworkTransport]:
    """Return the transport that these machines use, of which there is one."""
    return TRANSPORTS[machines[0].endpoint.partition("/")[0]]


def network_transport(placed: PlacedGraph, name: str, keys: Path | None = None) -> NetworkTransport:
    """Return the transport of the machine or the observer ``name``, not yet connected.

    Args:
        placed: the graph.
        name: of the machine or the observer.
        keys: the folder of ``aloft keys``, where links are encrypted.

    Raises:
        AloftError: the endpoints and the keys do not fit together.
    """
    return transport_type(placed.machines).of(placed, name, keys)
