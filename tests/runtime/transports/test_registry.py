"""Endpoints are checked by the registry of transports, which also finds the class for a graph."""

import re
import socket
from ipaddress import IPv4Address
from pathlib import Path

import pytest

from aloft.runtime.language.stages import MachineSpec
from aloft.runtime.loading import LoadError, checked_text
from aloft.runtime.transports import registry
from aloft.runtime.transports.registry import (
    EXAMPLE,
    TRANSPORTS,
    endpoint_pattern,
    endpoint_problem,
    open_endpoints,
    silent_endpoint,
    transport_type,
)
from aloft.runtime.transports.zenoh_transport import ZenohTransport

from ...waiting import free_port

ENDPOINTS = {scheme: f"{scheme}/127.0.0.1:7450" for scheme in TRANSPORTS}


def test_every_scheme_is_taken_and_has_its_class() -> None:
    for scheme, endpoint in ENDPOINTS.items():
        assert endpoint_problem(endpoint) == "" and re.match(endpoint_pattern(), endpoint)
        assert transport_type([MachineSpec("a", endpoint)]) is TRANSPORTS[scheme]
    assert endpoint_problem(EXAMPLE) == ""


@pytest.mark.parametrize(
    ("endpoint", "fault"),
    [
        ("127.0.0.1:7450", "it is not of the form tcp/ADDRESS:PORT"),
        ("pigeon/127.0.0.1:7450", "it is not of the form tcp/ADDRESS:PORT or tls/ADDRESS:PORT"),
        ("udp/127.0.0.1:7450", "it is not of the form tcp/ADDRESS:PORT or tls/ADDRESS:PORT"),
        ("tcp/127.0.0.1", "it is not of the form tcp/ADDRESS:PORT"),
        ("tcp/127.0.0.1:0", "port 0 is not between 1 and 65535"),
        (f"tcp/{IPv4Address(0)}:7450", "it stands for all addresses of a machine"),
        ("tcp/224.0.0.1:7450", "a multicast address is not the address of one machine"),
    ],
)
def test_a_wrong_endpoint_is_explained(endpoint: str, fault: str) -> None:
    assert endpoint_problem(endpoint).startswith(fault)
    assert (
        endpoint_problem("tcp/[::1]:7450") == "" and endpoint_problem("tls/robot.local:7450") == ""
    )


def test_endpoints_that_anybody_reaches_are_named() -> None:
    reached = ("tcp/10.0.0.7:1", "tcp/robot.local:1", "tcp/[fe80::1]:1")
    safe = (
        "tcp/127.0.0.1:1",
        "tcp/127.9.9.9:1",
        "tcp/[::1]:1",
        "tcp/localhost:1",
        "tls/10.0.0.7:1",
    )
    for endpoint in reached:
        (text,) = open_endpoints([MachineSpec("arm", endpoint)])
        assert f"machine 'arm' listens at {endpoint}: whoever reaches it" in text
        assert "`aloft keys`" in text
    assert open_endpoints([MachineSpec("arm", endpoint) for endpoint in safe]) == []


def test_why_a_machine_is_silent() -> None:
    port = free_port()
    assert silent_endpoint(f"tcp/127.0.0.1:{port}").startswith(
        f"no connection to tcp/127.0.0.1:{port}: "
    )
    with socket.create_server(("127.0.0.1", 0)) as server:
        at = f"127.0.0.1:{server.getsockname()[1]}"
        assert silent_endpoint(f"tcp/{at}").endswith(
            "nothing of this graph: does it run another graph?"
        )
        assert "are the keys of this graph's authority?" in silent_endpoint(f"tls/{at}")


def test_the_schemes_are_listed() -> None:
    text = endpoint_problem("nonsense")
    assert all(f"{scheme}/ADDRESS:PORT" in text for scheme in TRANSPORTS)
    assert " or " in text


def test_one_graph_uses_one_transport(monkeypatch: pytest.MonkeyPatch) -> None:
    class Pigeon(ZenohTransport):
        """Another transport."""

    monkeypatch.setitem(registry.TRANSPORTS, "pigeon", Pigeon)
    graph = """
rate: 100 Hz
machines: {near: tcp/127.0.0.1:7450, far: pigeon/127.0.0.1:7451}
blocks:
  a: {use: blocks.Constant, with: {value: [1]}}
"""
    with pytest.raises(LoadError) as found:
        checked_text(graph, Path("graph.yaml"))
    text = str(found.value)
    assert "machines 'near' and 'far' use different transports" in text
    assert "tcp/127.0.0.1:7450" in text and "pigeon/127.0.0.1:7451" in text
    assert checked_text(graph.replace("pigeon/", "tls/"), Path("graph.yaml")).machines


@pytest.mark.parametrize("transport", list(dict.fromkeys(TRANSPORTS.values())))
def test_endpoints_for_a_run_on_this_machine(transport: type[ZenohTransport]) -> None:
    endpoints = transport.local_endpoints(3)
    assert len(set(endpoints)) == 3
    assert all(endpoint_problem(endpoint) == "" for endpoint in endpoints)
    assert {transport_type([MachineSpec("a", e)]) for e in endpoints} == {transport}
