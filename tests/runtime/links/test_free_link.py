"""A free-running link gives the latest message with its age, and does what its policy says."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from aloft.runtime.language.stages import LinkPolicy
from aloft.runtime.links.free_link import LatestReceiver, LinkHealth
from aloft.runtime.links.message import MessageReader, MessageWriter
from aloft.runtime.links.peers import ClockOffset
from aloft.runtime.placement.placed import split_over_machines
from aloft.runtime.running.memory import Memory

from .example_graphs import ring

MS = 1_000_000


class Peers:
    """What an inbox asks of the other parts."""

    def __init__(self) -> None:
        self.run = b"12345678"
        self.clock = ClockOffset()
        self.checked: list[str] = []

    def run_of(self, name: str) -> bytes:
        return self.run

    def clock_of(self, name: str) -> ClockOffset:
        return self.clock

    def note_checked(self, link: str) -> None:
        self.checked.append(link)


class Bench:
    """A link in virtual time: the two ends, the clock, and the bus on both sides."""

    def __init__(self, policy: LinkPolicy) -> None:
        placed = split_over_machines(ring())
        (self.link,) = [link for link in placed.links if link.source == "last"]
        self.here, self.there = Memory(placed.graph.blocks), Memory(placed.graph.blocks)
        self.peers = Peers()
        self.now = 10**12
        self.stops: list[str] = []
        self.health = LinkHealth.allocate()
        bus = self.here.bus
        self.writer = MessageWriter(self.link, bus.layout, bus.buffer.data, self.peers.run)
        reader = MessageReader(self.link, bus.layout, self.there.bus.buffer.data)
        peers: Any = self.peers
        self.receiver = LatestReceiver(
            self.link, reader, peers, policy, self.health, self.stops.append, lambda: self.now
        )
        self.tick = 0

    def message(self, value: float) -> bytes:
        self.here.bus.field("last.y.value")[...] = value
        self.tick += 1
        return self.writer.write(self.tick, self.now + self.peers.clock.offset)

    def read(self, after: float = 0.0) -> float:
        self.now += int(after * MS)
        self.receiver.write_outputs(self.tick)
        return float(self.there.bus.field("last.y.value"))

    def counts(self) -> tuple[int, int, int, int]:
        receiver = self.receiver
        return receiver.received, receiver.lost, receiver.surplus, receiver.damaged


def test_the_latest_message_counts() -> None:
    bench = Bench(LinkPolicy(0.01, "stop"))
    messages = [bench.message(value) for value in (1.0, 2.0, 3.0, 4.0)]
    bench.receiver.on_message(messages[0])
    assert bench.read(1.0) == 1.0
    for message in (messages[3], messages[1], messages[3]):  # one is lost, one late, one twice
        bench.receiver.on_message(message)
    assert bench.read(1.0) == 4.0
    assert bench.counts() == (2, 2, 2, 0)
    assert bench.health.received == 2 and bench.health.lost == 2 and bench.health.surplus == 2
    assert bench.peers.checked and bench.stops == []


def test_the_age_is_by_the_clock_of_the_sender() -> None:
    bench = Bench(LinkPolicy(0.01, "hold"))
    bench.peers.clock.offset = -77_000 * MS
    bench.peers.clock.uncertainty = 3 * MS
    bench.receiver.on_message(bench.message(1.0))
    bench.read(2.5)
    assert float(bench.health.age) == pytest.approx(2.5e-3)
    assert not bench.health.late
    assert float(bench.health.clock_offset) == -77.0, "it is recorded with its uncertainty"
    assert float(bench.health.clock_uncertainty) == 3e-3
    bench.read(8.0)
    assert float(bench.health.age) == pytest.approx(10.5e-3)
    assert bench.health.late


@pytest.mark.parametrize("ahead", [0, 5_000 * MS])
def test_the_jitter_is_that_of_rfc_3550_whatever_the_clocks_say(ahead: int) -> None:
    bench = Bench(LinkPolicy(None, "hold"))
    bench.peers.clock.offset = ahead
    expected, last = 0.0, 0
    for number, late in enumerate((2 * MS, 5 * MS, 1 * MS, 1 * MS, 9 * MS)):
        data = bench.message(1.0)
        bench.now += late
        bench.receiver.on_message(data)
        if number:
            expected += (abs(late - last) - expected) / 16.0
        last = late
    bench.read()
    assert expected > 0.5 * MS
    assert float(bench.health.jitter) == pytest.approx(expected * 1e-9)
    assert bench.receiver.about()["jitter_ms"] == pytest.approx(expected * 1e-6)
    bench.peers.run = b"another!"  # started again: its first message says nothing
    bus = bench.here.bus
    bench.writer = MessageWriter(bench.link, bus.layout, bus.buffer.data, bench.peers.run)
    bench.now += 3_000 * MS
    bench.receiver.on_message(bench.message(1.0))
    assert bench.receiver.received == 6 and bench.receiver.jitter == pytest.approx(expected)


def test_hold_keeps_the_last_value() -> None:
    bench = Bench(LinkPolicy(0.01, "hold"))
    bench.receiver.on_message(bench.message(5.0))
    assert bench.read(1.0) == 5.0
    assert bench.read(100.0) == 5.0
    assert bench.receiver.late_ticks == 1 and bench.stops == []


def test_safe_reads_zeros_until_a_message_is_in_time_again() -> None:
    bench = Bench(LinkPolicy(0.01, "safe"))
    bench.receiver.on_message(bench.message(5.0))
    assert bench.read(1.0) == 5.0
    assert bench.read(20.0) == 0.0
    bench.receiver.on_message(bench.message(6.0))
    assert bench.read(0.5) == 6.0
    late = bench.message(7.0)
    bench.now += 20 * MS
    bench.receiver.on_message(late)  # it was too long on its way
    assert bench.read() == 0.0
    assert bench.receiver.late_ticks == 2


def test_stop_names_link_and_age() -> None:
    bench = Bench(LinkPolicy(0.01, "stop"))
    bench.receiver.on_message(bench.message(5.0))
    bench.read(9.9)
    assert bench.stops == []
    bench.read(0.2)
    assert bench.stops == [
        "link last@far -> onboard: nothing has come for 10.1 ms, at most 10 ms are allowed"
    ]


def test_before_the_first_message_the_age_counts_from_the_first_tick() -> None:
    bench = Bench(LinkPolicy(0.01, "stop"))
    assert bench.read() == 0.0
    bench.read(9.0)
    assert bench.stops == []
    bench.read(2.0)
    assert len(bench.stops) == 1


def test_damaged_messages_never_reach_the_bus() -> None:
    bench = Bench(LinkPolicy(None, "hold"))
    rng = np.random.default_rng(2)
    good = bench.message(5.0)

    def damaged() -> Iterable[bytes]:
        for _ in range(300):
            data = bytearray(good)
            data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
            yield bytes(data)
            yield good[: int(rng.integers(len(good)))]
            yield rng.bytes(len(good))

    for data in damaged():
        bench.receiver.on_message(data)
        assert bench.read() == 0.0
    assert bench.counts() == (0, 0, 0, 900)
    bench.receiver.on_message(good)
    assert bench.read() == 5.0


def test_a_restarted_sender_begins_to_count_anew() -> None:
    bench = Bench(LinkPolicy(None, "hold"))
    for value in (1.0, 2.0, 3.0):
        bench.receiver.on_message(bench.message(value))
    bench.peers.run = b"87654321"
    stale = bench.message(8.0)
    bus = bench.here.bus
    bench.writer = MessageWriter(bench.link, bus.layout, bus.buffer.data, bench.peers.run)
    bench.receiver.on_message(stale)
    bench.receiver.on_message(bench.message(9.0))
    assert bench.read() == 9.0
    assert bench.counts() == (4, 0, 0, 1)


def test_what_is_told_at_the_end() -> None:
    bench = Bench(LinkPolicy(0.01, "hold"))
    for _ in range(100):
        bench.receiver.on_message(bench.message(1.0))
        bench.read(2.0)
    about: dict[str, Any] = bench.receiver.about()
    assert about["received"] == 100 and about["lost"] == 0 and about["late_ticks"] == 0
    assert about["age_p50_ms"] == pytest.approx(2.0) and about["age_max_ms"] == pytest.approx(2.0)
