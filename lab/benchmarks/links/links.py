"""The cost of links between machines: latency beside bare Zenoh, time on the sending tick, loss.

A second process answers over the loopback. A round trip through links (header, checksum, mailbox,
copies into and out of the bus, both ways) takes turns with one of the same bytes through bare
publishers and subscribers of the same settings. Then ten free-running links carry a message each
1000 times a second, first to a machine that takes them and then to one that is frozen. Last, the
drives' watchdog damps after commands have ended.
"""

from __future__ import annotations

import json
import os
import select
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....hal.bear.watchdog import DriveWatchdog, damping_frame
from ....runtime.language.stages import WATCHDOG, LinkPolicy
from ....runtime.links.free_link import LatestReceiver, LinkHealth
from ....runtime.links.lockstep_link import LockstepReceiver
from ....runtime.links.message import HEADER, MessageReader, MessageWriter
from ....runtime.links.peers import ClockOffset
from ....runtime.links.traffic import Traffic
from ....runtime.loading import checked_text
from ....runtime.placement.placed import MachineLink, PlacedGraph, split_over_machines
from ....runtime.running.memory import Memory
from ....runtime.transports.transport import Transport, data_key
from ....runtime.transports.zenoh_transport import ZenohTransport
from ..rows import Row, compare, other_process, take_turns

GOAL = 20.0
"""Milliseconds from the last command to damping."""
_DEVICES = list(range(1, 11))


def damping(repetitions: int = 40) -> Row:
    """Measure the longest time from the last command to the instruction that damps, by the
    watchdog's process, with nothing said by the process that it watches; on a pipe in place of a
    bus."""
    size = len(damping_frame(_DEVICES))
    times = np.full(repetitions, np.inf)
    for k in range(repetitions):
        reading, writing = os.pipe()
        watchdog = DriveWatchdog(writing, _DEVICES, 60.0, WATCHDOG)
        try:
            heard = time.monotonic_ns()
            watchdog.beat(heard)
            if select.select([reading], [], [], 10.0)[0] and len(os.read(reading, size)) == size:
                times[k] = (time.monotonic_ns() - heard) * 1e-6
        finally:
            watchdog.close()
            os.close(reading)
            os.close(writing)
    note = f"of {repetitions}; median {np.median(times):.1f} ms, {WATCHDOG * 1e3:g} ms of silence"
    return Row("from the last command to damping", float(times.max()), "ms", goal=GOAL, note=note)


LATENCY_GOAL = 1.3
"""The largest good ratio of a round trip through links to one through bare Zenoh."""
SENDING_GOAL = 20.0
"""Microseconds of the sending tick a message [us]."""
COUNT, RATE, PATIENCE = 10, 1000.0, 20.0
NUMBERS = 64
"""Number of float64 in a message."""
RUN = b"benchmrk"


def graph(ports: tuple[int, int]) -> PlacedGraph:
    """Return ten blocks on the first machine that the second reads, and one answer that the first
    reads."""
    there = "\n".join(
        f"  source{k}: {{use: blocks.Constant, with: {{value: {[float(k)] * NUMBERS}}}}}\n"
        f"  reader{k}: {{use: blocks.Gain, with: {{n: {NUMBERS}}}, in: {{u: source{k}.y}}, on: b}}"
        for k in range(COUNT)
    )
    text = f"""
rate: {RATE} Hz
machines: {{a: tcp/127.0.0.1:{ports[0]}, b: tcp/127.0.0.1:{ports[1]}}}
blocks:
{there}
  end: {{use: blocks.Gain, with: {{n: {NUMBERS}}}, in: {{u: reader0.y}}}}
"""
    return split_over_machines(checked_text(text, Path("links.yaml")))


class _Known:
    """Stands for the handshake, which is no part of what is measured: the run is known."""

    def __init__(self, placed: PlacedGraph, link: MachineLink) -> None:
        self.mailboxes: list[Callable[[], None]] = []
        self.traffic = {link.sender: Traffic(placed, link.sender, link.receiver)}

    def run_of(self, name: str) -> bytes:
        return RUN

    def clock_of(self, name: str) -> ClockOffset:
        return ClockOffset()

    def note_checked(self, link: str) -> None:
        pass

    def check(self, tick: int) -> None:
        pass

    def measured(self, name: str) -> str:
        return self.traffic[name].measured(-1.0)


class _End:
    """One machine's end: its memory, and both ends of links on it."""

    def __init__(self, placed: PlacedGraph, machine: str, *, wait: bool) -> None:
        self.placed = placed
        self.memory = Memory(placed.graph.blocks)
        self.transport: Transport = ZenohTransport("bench", placed.machines, wait=wait)
        self.transport.open(machine, lambda name: None)

    def sender(self, link: MachineLink) -> tuple[MessageWriter, Callable[[bytes], None]]:
        bus = self.memory.bus
        put = self.transport.publisher(data_key(link.sender, link.receiver, link.source))
        return MessageWriter(link, bus.layout, bus.buffer.data, RUN), put

    def reader(self, link: MachineLink) -> MessageReader:
        return MessageReader(link, self.memory.bus.layout, self.memory.bus.buffer.data)

    def receiver(self, link: MachineLink) -> LockstepReceiver:
        receiver = LockstepReceiver(link, self.reader(link), _Known(self.placed, link), PATIENCE)  # type: ignore[arg-type]  # stands in for the peers
        self.transport.subscribe(
            data_key(link.sender, link.receiver, link.source), receiver.on_message
        )
        return receiver


def _links(placed: PlacedGraph) -> tuple[list[MachineLink], MachineLink]:
    """Return the links to the other process, and the one back."""
    back = next(link for link in placed.links if link.sender == "b")
    return [link for link in placed.links if link.sender == "a"], back


def links(rounds: int = 40, repetitions: int = 25, ticks: int = 3000) -> list[Row]:
    """Round trips beside bare Zenoh, the cost of sending, the loss of ten links at 1 kHz, and how
    soon the drives are damped when commands end."""
    with socket.socket() as one, socket.socket() as two:
        one.bind(("127.0.0.1", 0))
        two.bind(("127.0.0.1", 0))
        ports = one.getsockname()[1], two.getsockname()[1]
    told: dict[str, int] = {}
    code = f"from aloft.lab.benchmarks.links.links import answer; answer({ports})"
    with other_process(code) as other:

        def freeze() -> None:
            """Have the other process count what has come, and stop it."""
            told.update(other.ask("count"))
            other.freeze()

        rows = _round_trips(graph(ports), rounds, repetitions)
        other.ask("ten links")
        rows += _ten_links(graph(ports), ticks, freeze)
    sent = COUNT * ticks
    note = f"{told['received']} of {sent} messages of {NUMBERS * 8} B came, {told['lost']} gaps"
    rows.append(Row("lost by ten links at 1 kHz", float(sent - told["received"]), "messages",
                    goal=0.0, note=note))  # fmt: skip
    return [*rows, damping(rounds)]


def _round_trips(placed: PlacedGraph, rounds: int, repetitions: int) -> list[Row]:
    there, back = _links(placed)
    end = _End(placed, "a", wait=True)
    try:
        writer, put = end.sender(there[0])
        receiver = end.receiver(back)
        bare, answers = end.transport.publisher("bare/there"), SimpleQueue[bytes]()
        end.transport.subscribe("bare/back", answers.put)
        data = bytes(HEADER + there[0].payload)
        _until_answered(bare, answers, data)
        sending: list[int] = []
        putting: list[int] = []
        tick = 0

        def through_links(count: int) -> None:
            nonlocal tick
            for _ in range(count):
                began = time.perf_counter_ns()
                put(writer.write(tick, time.monotonic_ns()))
                sending.append(time.perf_counter_ns() - began)
                receiver.write_outputs(tick)
                tick += 1

        def through_zenoh(count: int) -> None:
            for _ in range(count):
                began = time.perf_counter_ns()
                bare(data)
                putting.append(time.perf_counter_ns() - began)
                answers.get(timeout=PATIENCE)

        times = take_turns(
            {"links": through_links, "bare Zenoh": through_zenoh}, rounds, repetitions
        )
    finally:
        end.transport.close()
    round_trip = compare("links", times, "bare Zenoh", goal=LATENCY_GOAL)
    cost, bare_cost = float(np.median(sending)) * 1e-3, float(np.median(putting)) * 1e-3
    return [
        Row("round trip through links", round_trip.value, "us", "bare Zenoh", round_trip.ratio,
            LATENCY_GOAL, round_trip.ratio_p10, round_trip.ratio_p90,
            note=f"{len(data)} B each way"),
        Row("sending a message", cost, "us", goal=SENDING_GOAL,
            note=f"of which a bare put takes {bare_cost:.1f}"),
    ]  # fmt: skip


def _until_answered(put: Callable[[bytes], None], answers: SimpleQueue[bytes], data: bytes) -> None:
    """Wait until the other process is there, then until all of its answers have come."""
    end = time.monotonic() + PATIENCE
    while answers.empty() and time.monotonic() < end:
        put(data)
        time.sleep(0.05)
    time.sleep(0.3)
    while not answers.empty():
        answers.get()


def _ten_links(placed: PlacedGraph, ticks: int, freeze: Callable[[], None]) -> list[Row]:
    """Send on ten links, 1000 times a second; then once more, after the other process was frozen.

    A tick that is late is not made up for.
    """
    there, _ = _links(placed)
    end = _End(placed, "a", wait=False)
    try:
        senders = [end.sender(link) for link in there]
        bare, answers = end.transport.publisher("bare/there"), SimpleQueue[bytes]()
        end.transport.subscribe("bare/back", answers.put)
        _until_answered(bare, answers, b"?")
        awake = _sending_times(senders, ticks)
        time.sleep(0.5)
        freeze()
        frozen = _sending_times(senders, ticks)
    finally:
        end.transport.close()
    return [
        Row(f"sending one of ten messages{where}", float(np.median(costs)), "us", goal=SENDING_GOAL,
            note=f"99 %: {np.percentile(costs, 99):.1f} us, longest {costs.max():.0f} us")
        for where, costs in (("", awake), (" to a frozen machine", frozen))
    ]  # fmt: skip


def _sending_times(
    senders: Sequence[tuple[MessageWriter, Callable[[bytes], None]]], ticks: int
) -> NDArray[np.float64]:
    """Measure the microseconds that each message took (ticks * links,), sent at ``RATE``."""
    costs = np.zeros((ticks, len(senders)))
    deadline = time.perf_counter_ns()
    for tick in range(ticks):
        now = time.perf_counter_ns()
        deadline = max(deadline + int(1e9 / RATE), now)
        time.sleep(max(0, deadline - now) * 1e-9)
        for number, (writer, put) in enumerate(senders):
            began = time.perf_counter_ns()
            put(writer.write(tick, time.monotonic_ns()))
            costs[tick, number] = (time.perf_counter_ns() - began) * 1e-3
    return costs.ravel()


def answer(ports: tuple[int, int]) -> None:
    """Answer round trips, then count what ten links bring, in the other process."""
    placed = graph(ports)
    there, back = _links(placed)
    end = _End(placed, "b", wait=True)
    receiver = end.receiver(there[0])
    writer, put = end.sender(back)
    questions, bare = SimpleQueue[bytes](), end.transport.publisher("bare/back")
    end.transport.subscribe("bare/there", questions.put)

    def answer_bare() -> None:
        while True:
            bare(questions.get())

    def answer_links() -> None:
        tick = 0
        while True:
            receiver.write_outputs(tick)
            put(writer.write(tick, time.monotonic_ns()))
            tick += 1

    threading.Thread(target=answer_bare, daemon=True).start()
    threading.Thread(target=answer_links, daemon=True).start()
    counters: list[Any] = []
    for line in sys.stdin:
        if line.strip() == "count":
            received = sum(counter.received for counter in counters)
            lost = sum(counter.lost for counter in counters)
            print(json.dumps({"received": received, "lost": lost}), flush=True)
            continue
        end.transport.close()
        end = _End(placed, "b", wait=False)
        questions, bare = SimpleQueue[bytes](), end.transport.publisher("bare/back")
        end.transport.subscribe("bare/there", questions.put)
        for link in there:
            counter = LatestReceiver(
                link, end.reader(link), _Known(placed, link),  # type: ignore[arg-type]  # stands in for the peers
                LinkPolicy(), LinkHealth.allocate(), lambda reason: None,
            )  # fmt: skip
            end.transport.subscribe(data_key("a", "b", link.source), counter.on_message)
            counters.append(counter)
        print(json.dumps("ready"), flush=True)
        threading.Thread(target=answer_bare, daemon=True).start()
    end.transport.close()
