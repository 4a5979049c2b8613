"""Links over UDP on the loopback: split, joined, sent again, and nothing beyond the loopback."""

import os
import random
import re
import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.runtime.language.errors import AloftError
from aloft.runtime.language.stages import CheckedGraph, LinkPolicy, LinkSettings
from aloft.runtime.links.observer import Observer, StatusPublisher
from aloft.runtime.links.part import BoundPart, run_part
from aloft.runtime.loading import LoadError, load, load_text
from aloft.runtime.placement.placed import place
from aloft.runtime.running.executor import run
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.testing.spread import run_parts_of
from aloft.runtime.transports.registry import endpoint_fault, network_transport
from aloft.runtime.transports.udp import LEASE, PIECE, RETRIES, UdpTransport

from ...waiting import wait_for
from ..links.example_graphs import ring

ROOT = Path(__file__).parents[3]
Pair = tuple[UdpTransport, UdpTransport, list[str]]


class Lossy(UdpTransport):
    """Loses, doubles and delays datagrams, by a seed."""

    rng = random.Random(5)
    loss = 0.3
    kept: tuple[bytes, tuple[str, int]] | None = None
    lost_count = 0

    def _send(self, datagram: bytes, address: tuple[str, int]) -> None:
        chance = self.rng.random()
        if chance < self.loss:
            self.lost_count += 1
            return
        if chance < self.loss + 0.1 and self.kept is None:
            self.kept = datagram, address  # it comes after the next one
            return
        super()._send(datagram, address)
        if chance < self.loss + 0.2:
            super()._send(datagram, address)
        kept, self.kept = self.kept, None
        if kept is not None:
            super()._send(*kept)


def over_udp(graph: CheckedGraph) -> CheckedGraph:
    """The graph with endpoints of UDP that are free."""
    endpoints = UdpTransport.local_endpoints(len(graph.machines))
    machines = [
        replace(spec, endpoint=endpoint)
        for spec, endpoint in zip(graph.machines, endpoints, strict=True)
    ]
    return replace(graph, machines=tuple(machines))


def pair_of(kind: type[UdpTransport], *, reliable: bool = True) -> Pair:
    ends = dict(zip("ab", UdpTransport.local_endpoints(2), strict=True))
    lost: list[str] = []
    first, second = (kind("test", ends, reliable=reliable) for _ in range(2))
    second.open("b", lambda name: None)
    first.open("a", lost.append)
    return first, second, lost


@pytest.fixture(params=[True, False], ids=["reliable", "once"])
def pair(request: pytest.FixtureRequest) -> Iterator[Pair]:
    """Two open transports, and the machines that the first has lost."""
    made = pair_of(UdpTransport, reliable=request.param)
    yield made
    for transport in made[:2]:
        transport.close()


def knows(transport: UdpTransport, key: str) -> bool:
    """Whether somebody has said to a transport that it subscribes to the key."""
    return any(transport._hash(key) in peer.keys for peer in transport._peers.values())


def test_messages_of_any_length_arrive_at_those_that_subscribe(pair: Pair) -> None:
    first, second, _ = pair
    received: list[bytes] = []
    others: list[bytes] = []
    second.subscribe("data/a/b/x", received.append)
    second.subscribe("data/a/b/y", others.append)
    assert wait_for(lambda: knows(first, "data/a/b/y"))
    put = first.publisher("data/a/b/x")
    sizes = [0, 1, PIECE - 1, PIECE, PIECE + 1, 5 * PIECE + 7]
    sent = [os.urandom(size) for size in sizes]
    for number, data in enumerate(sent):
        put(data)
        assert wait_for(lambda number=number: len(received) > number)
    assert received == sent and others == []


def test_what_is_lost_doubled_or_late_arrives_once_all_the_same() -> None:
    first, second, lost = pair_of(Lossy)
    received: list[bytes] = []
    try:
        second.subscribe("data/a/b/x", received.append)
        assert wait_for(lambda: knows(first, "data/a/b/x"))
        put = first.publisher("data/a/b/x")
        sent = [os.urandom(size) for size in (10, 3 * PIECE, 20, PIECE + 1) * 5]
        for data in sent:
            put(data)
        assert wait_for(lambda: len(received) >= len(sent))
        assert sorted(received) == sorted(sent) and not lost
        assert isinstance(first, Lossy) and first.lost_count > 5
    finally:
        first.close()
        second.close()


def test_without_acknowledgements_what_is_lost_stays_lost() -> None:
    first, second, _ = pair_of(Lossy, reliable=False)
    received: list[bytes] = []
    try:
        second.subscribe("data/a/b/x", received.append)
        assert wait_for(lambda: knows(first, "data/a/b/x"))
        put, sent = first.publisher("data/a/b/x"), 0
        while len(received) <= 100 and sent < 10_000:  # a busy machine may drop some as well
            for _ in range(20):
                put(sent.to_bytes(2, "big"))
                sent += 1
            wait_for(lambda: len(received) > 100, 0.05)
        assert len(received) > 100
        assert not any(peer.unconfirmed for peer in first._peers.values())
        assert len({bytes(data) for data in received}) < sent
    finally:
        first.close()
        second.close()


def test_a_machine_that_leaves_is_lost_at_once(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aloft.runtime.transports.udp.LEASE", 600.0)  # so it is not the silence
    first, second, lost = pair
    assert wait_for(lambda: first._peers and second._peers) and lost == []
    second.close()
    assert wait_for(lambda: lost == ["b"])
    assert first.is_open and not second.is_open


def test_a_machine_that_is_silent_is_lost_after_a_while() -> None:
    first, second, lost = pair_of(Lossy)
    try:
        assert wait_for(lambda: first._peers and second._peers)
        assert isinstance(second, Lossy)
        second.loss = 1.0
        assert wait_for(lambda: lost == ["b"], 3 * LEASE)
    finally:
        first.close()
        second.close()


@pytest.mark.long
def test_who_acknowledges_nothing_is_lost_after_a_bounded_number_of_attempts() -> None:
    first, second, lost = pair_of(UdpTransport)
    try:
        second.subscribe("data/a/b/x", lambda data: None)
        assert wait_for(lambda: knows(first, "data/a/b/x"))
        second._take_piece = lambda *_: None  # type: ignore[method-assign]  # it still announces itself
        first.publisher("data/a/b/x")(b"unheard")
        (unconfirmed,) = next(iter(first._peers.values())).unconfirmed.values()
        assert wait_for(lambda: lost == ["b"])
        assert unconfirmed.retries == RETRIES
    finally:
        first.close()
        second.close()


def test_bytes_of_strangers_change_nothing() -> None:
    first, second, lost = pair_of(UdpTransport)
    received: list[bytes] = []
    rng = random.Random(3)
    try:
        second.subscribe("data/a/b/x", received.append)
        assert wait_for(lambda: knows(first, "data/a/b/x"))
        put = first.publisher("data/a/b/x")
        with socket.socket(type=socket.SOCK_DGRAM) as stranger:
            for length in [0, 1, 39, 40, 41, 2000]:
                stranger.sendto(rng.randbytes(length), second._machines["b"])
            number = (1, 0)
            forged = first._datagram(1, body=b"", place=number)  # type: ignore[arg-type]
            stranger.sendto(forged, second._machines["b"])  # "a leaves", from elsewhere
            impostor = UdpTransport("test", {"a": "udp/127.0.0.1:1", "b": "udp/127.0.0.1:2"})
            name = impostor._datagram(0, first._hash(""), body=b"\x01a")  # type: ignore[arg-type]
            stranger.sendto(name, second._machines["b"])
        put(b"real")
        assert wait_for(lambda: received == [b"real"]) and not lost
        assert {peer.name for peer in second._peers.values()} == {"a"}
    finally:
        first.close()
        second.close()


# -- addresses and keys ----------------------------------------------------------------------------


def test_only_the_loopback_is_allowed() -> None:
    for host in ("192.168.1.7", "robot.local", "[::1]", "localhost"):
        text = endpoint_fault(f"udp/{host}:7450")
        assert text.startswith("links over UDP are neither encrypted nor authenticated")
        assert "use tcp/ or tls/" in text
        with pytest.raises(AloftError, match="they stay on 127"):
            UdpTransport("test", {"a": f"udp/{host}:7450"})
    graph = """
rate: 100 Hz
machines: {near: udp/192.168.1.7:7450}
blocks:
  a: {use: blocks.Constant, with: {value: [1]}}
"""
    with pytest.raises(LoadError, match="the endpoint of machine 'near' is wrong: links over UDP"):
        load_text(graph, Path("graph.yaml"))


def test_an_endpoint_in_use_and_keys_are_refused(tmp_path: Path) -> None:
    first, second, _ = pair_of(UdpTransport)
    try:
        again = UdpTransport("test", {"a": f"udp/127.0.0.1:{first._machines['a'][1]}"})
        with pytest.raises(AloftError, match=r"machine 'a' cannot listen at udp/127.*Another run"):
            again.open("a", lambda name: None)
        again.close()
    finally:
        first.close()
        second.close()
    with pytest.raises(AloftError, match="links over UDP stay on one machine and take no keys"):
        network_transport(place(over_udp(ring())), "onboard", tmp_path)


# -- parts -----------------------------------------------------------------------------------------


class Ends:
    """In place of a hub: a transport of UDP for each part, in the order of the machines."""

    def __init__(self, graph: CheckedGraph, kind: type[UdpTransport] = UdpTransport) -> None:
        self.placed = place(graph)
        self.made = [kind.of(self.placed, spec.name) for spec in self.placed.machines]
        self._next = iter(self.made)

    def transport(self) -> Any:
        return next(self._next)


@pytest.mark.parametrize("kind", [UdpTransport, Lossy])
def test_lockstep_gives_the_bytes_of_one_process(kind: type[UdpTransport]) -> None:
    graph = over_udp(ring())
    ends = Ends(graph, kind)
    ticks = 20 if kind is Lossy else 60
    spread = run_parts_of(ends.placed, ends, ticks=ticks, timeout=60.0, wall_time=120.0)  # type: ignore[arg-type]
    assert all(result.success for result in spread.results.values())
    assert spread.run_hash == run(ring(), ticks=ticks).run_hash
    assert all(not transport.is_open for transport in ends.made)


@pytest.mark.parametrize("loss", [0.0, 0.2])
def test_free_parts_count_what_is_lost(loss: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Lossy, "loss", loss)
    links = LinkSettings("free", LinkPolicy(max_age=5.0, late="hold"))
    graph = over_udp(replace(ring(ticks=200), links=links))
    ends = Ends(graph, Lossy if loss else UdpTransport)
    assert not any(transport._reliable for transport in ends.made)
    spread = run_parts_of(ends.placed, ends, ticks=200, timeout=60.0, wall_time=120.0)  # type: ignore[arg-type]
    assert all(result.success for result in spread.results.values())
    about = [box.about() for part in spread.parts.values() for box in part.receivers]
    assert all(link["received"] > 20 for link in about)
    assert bool(sum(link["lost"] for link in about)) == bool(loss)


def with_another_rate(graph: CheckedGraph) -> CheckedGraph:
    blocks = [replace(spec, offset_ticks=int(spec.path == "last")) for spec in graph.blocks]
    return replace(graph, blocks=tuple(blocks))


@pytest.mark.parametrize(
    ("change", "difference"),
    [
        (lambda graph: replace(graph, text="# another"), "the graph is .*'# another' on far"),
        (with_another_rate, "the schema is .*'last: every 1 ticks from 1' on far"),
    ],
    ids=["graph", "schema"],
)
def test_parts_that_would_run_something_else_are_refused(
    change: Callable[[CheckedGraph], CheckedGraph], difference: str
) -> None:
    graph = over_udp(ring())
    graphs = (graph, graph, change(graph))
    parts = [
        BoundPart(place(g), m.name, UdpTransport.of(place(g), m.name), connect_timeout=20.0)
        for g, m in zip(graphs, graph.machines, strict=True)
    ]
    results = in_threads(parts)
    assert all("do not fit together" in result.reason for result in results)
    assert any(re.search(difference, result.reason) for result in results)


def in_threads(parts: list[BoundPart]) -> list[RunResult]:
    """The results of parts that run beside each other."""
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(len(parts)) as pool:
        return list(pool.map(lambda part: run_part(part, 20), parts))


def test_an_observer_sees_the_machines_and_sends_nothing() -> None:
    graph = over_udp(ring())
    placed = place(graph)
    transport = UdpTransport.of(placed, "onboard")
    part = BoundPart(placed, "onboard", transport)
    status = StatusPublisher("onboard", transport, part.peers, part.receivers)
    rows: list[tuple[int, bytes]] = []
    transport.open("onboard", lambda name: None)
    try:
        status.open(part)
        with Observer(placed) as observer:
            observer.rows("onboard", part.memory.bus.layout.size, lambda *row: rows.append(row))
            assert wait_for(lambda: status.record(0) or bool(rows))
            assert observer.wait_for(("onboard",), 30.0) == ()
            assert observer.state_of("onboard") == "hello"
            eager: Any = observer._transport
            eager.subscribe("tick/onboard/near", rows.append)
            eager.publisher("tick/near/onboard")(b"stop")  # nobody takes it from an observer
            assert rows[0][1] == part.memory.bus.buffer.tobytes()
            assert wait_for(lambda: knows(transport, "tick/onboard/near"))
            before = len(rows)
            transport.publisher("tick/onboard/near")(b"x" * 3)
            assert all(isinstance(row, tuple) for row in rows[before:])
        assert wait_for(lambda: not transport._peers)
    finally:
        status.close()
        transport.close()


@pytest.mark.long
def test_the_jump_on_two_machines_is_that_of_one_process() -> None:
    graph = load(ROOT / "graphs" / "machines" / "jump_two.yaml")
    alone = run(graph)
    ends = Ends(over_udp(graph))
    spread = run_parts_of(ends.placed, ends, timeout=60.0, wall_time=400.0)  # type: ignore[arg-type]
    assert alone.success and spread.run_hash == alone.run_hash
    assert np.array_equal(spread.rows, alone.log.rows() if alone.log is not None else None)
