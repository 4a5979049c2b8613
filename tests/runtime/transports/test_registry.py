"""Endpoints are checked by the registry of transports, which also finds the class for a graph."""

import re
from ipaddress import IPv4Address
from pathlib import Path

import pytest

from aloft.runtime.language.stages import MachineSpec
from aloft.runtime.loading import LoadError, load_text
from aloft.runtime.transports import registry
from aloft.runtime.transports.registry import (
    EXAMPLE,
    TRANSPORTS,
    endpoint_fault,
    endpoint_pattern,
    transport_type,
)
from aloft.runtime.transports.zenoh_transport import ZenohTransport

ENDPOINTS = {scheme: f"{scheme}/127.0.0.1:7450" for scheme in TRANSPORTS}


def test_every_scheme_is_taken_and_has_its_class() -> None:
    for scheme, endpoint in ENDPOINTS.items():
        assert endpoint_fault(endpoint) == "" and re.match(endpoint_pattern(), endpoint)
        assert transport_type([MachineSpec("a", endpoint)]) is TRANSPORTS[scheme]
    assert endpoint_fault(EXAMPLE) == ""


@pytest.mark.parametrize(
    ("endpoint", "fault"),
    [
        ("127.0.0.1:7450", "it is not of the form tcp/ADDRESS:PORT"),
        ("pigeon/127.0.0.1:7450", "it is not of the form tcp/ADDRESS:PORT"),
        ("tcp/127.0.0.1", "it is not of the form tcp/ADDRESS:PORT"),
        ("tcp/127.0.0.1:0", "port 0 is not between 1 and 65535"),
        (f"tcp/{IPv4Address(0)}:7450", "it stands for all addresses of a machine"),
        ("tcp/224.0.0.1:7450", "a multicast address is not the address of one machine"),
    ],
)
def test_a_wrong_endpoint_is_explained(endpoint: str, fault: str) -> None:
    assert endpoint_fault(endpoint).startswith(fault)
    assert endpoint_fault("tcp/[::1]:7450") == "" and endpoint_fault("tls/robot.local:7450") == ""


def test_the_schemes_are_listed() -> None:
    text = endpoint_fault("nonsense")
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
        load_text(graph, Path("graph.yaml"))
    text = str(found.value)
    assert "machines 'near' and 'far' use different transports" in text
    assert "tcp/127.0.0.1:7450" in text and "pigeon/127.0.0.1:7451" in text
    assert load_text(graph.replace("pigeon/", "tls/"), Path("graph.yaml")).machines


@pytest.mark.parametrize("transport", list(dict.fromkeys(TRANSPORTS.values())))
def test_endpoints_for_a_run_on_this_machine(transport: type[ZenohTransport]) -> None:
    endpoints = transport.local_endpoints(3)
    assert len(set(endpoints)) == 3
    assert all(endpoint_fault(endpoint) == "" for endpoint in endpoints)
    assert {transport_type([MachineSpec("a", e)]) for e in endpoints} == {transport}
