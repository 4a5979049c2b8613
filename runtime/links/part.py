"""One machine's part of a placed graph: the blocks it runs, and what stands for all others.

The memory of a part has the layout of the whole graph, so that a message is written to where the
source would have written, and rows of several parts can be laid over one another.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from hashlib import blake2b
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.block import Block
from ..language.layout import Layout
from ..language.parameters import Parameters
from ..language.stages import BlockSpec, CheckedGraph, ClockSpec
from ..placement.placed import MachineLink, PlacedGraph
from ..running.executor import Executor
from ..running.memory import BoundGraph
from ..running.run_result import RunResult
from ..running.sink import Sink
from ..transports.transport import Transport, data_key
from .command_watch import CommandWatch
from .coordinator import (
    DistributedParameters,
    FaultReporter,
    LockstepCoordinator,
    PartClock,
    PartLinks,
    StartBarrier,
)
from .free_coordinator import FreeRunningCoordinator
from .free_link import TICK_TIME, LatestReceiver, LinkMonitor, TickTime, health_path
from .lockstep_link import LinkInput, LinkOutput, LockstepReceiver, link_input_type
from .message import MessageReader, MessageWriter
from .path_ages import PathAges, path_sinks
from .peers import PartPhase, PeerStates

CONNECT_TIMEOUT = 180.0
"""Seconds that a part waits at its start for the others, which may compile their kernels first."""
COORDINATOR, PREPARED, STARTED = "~coordinator", "~prepared", "~started"


def sender_path(link: MachineLink) -> str:
    """Return the path of the block that sends on a link."""
    return f"{link.source}~to~{link.receiver}"


def part_graph(placed: PlacedGraph, machine: str) -> CheckedGraph:
    """Return the graph that one machine runs.

    Blocks of other machines become stand-ins. One that is received from runs as late as it can:
    right before the first block that reads it, or at the end of the tick where only ``update``
    does. Each message is sent right after its source has run.

    Raises:
        PlacementError: there is no such machine.
    """
    placed.machine(machine)
    graph = placed.graph
    sends: dict[str, list[BlockSpec]] = {}
    for link in placed.sent_by(machine):
        source = graph.block(link.source)
        sends.setdefault(link.source, []).append(
            replace(_own(sender_path(link), LinkOutput, machine), period_ticks=source.period_ticks,
                    offset_ticks=source.offset_ticks)
        )  # fmt: skip
    received = dict.fromkeys(link.source for link in placed.received_by(machine))
    order: list[str] = []
    for path in graph.order:
        spec = graph.block(path)
        if spec.machine != machine:
            continue
        if not spec.block_type.is_moore():
            for wire in spec.wires.values():
                if wire.source_block in received:
                    del received[wire.source_block]
                    order.append(wire.source_block)
        order.append(path)
        order += [send.path for send in sends.get(path, ())]
    blocks = [
        spec
        if spec.machine == machine
        else replace(spec, block_type=link_input_type(spec.block_type))
        for spec in graph.blocks
    ]
    blocks += [send for of_block in sends.values() for send in of_block]
    blocks += [_own(PREPARED, StartBarrier, machine), _own(STARTED, StartBarrier, machine)]
    free = graph.links.mode == "free"
    if free:
        blocks += [
            _own(health_path(link), LinkMonitor, machine) for link in placed.received_by(machine)
        ]
        blocks.append(_own(TICK_TIME, TickTime, machine))
        order.insert(0, TICK_TIME)
    blocks.append(
        _own(COORDINATOR, FreeRunningCoordinator if free else LockstepCoordinator, machine)
    )
    return replace(graph, blocks=tuple(blocks), order=(*order, *received, COORDINATOR))


def _own(path: str, block_type: type[Block], machine: str) -> BlockSpec:
    """Return a block of the runtime, which has no ports."""
    return BlockSpec(path, block_type, Parameters(), {}, machine=machine)


class BoundPart(BoundGraph):
    """One machine's part, bound, with the ends of its links.

    Args:
        placed: the graph.
        machine: the machine.
        transport: what carries messages; the part opens it when it starts.
        timeout: the seconds to wait for a message; by default the graph's ``links.patience``.
        connect_timeout: the seconds to wait for the others at the start.
        clock: the time [ns] by which free-running links and the watch of commands go.

    Raises:
        PlacementError: there is no such machine.
        RunError: a block could not be set up.
    """

    clock_type = PartClock

    def __init__(
        self,
        placed: PlacedGraph,
        machine: str,
        transport: Transport,
        *,
        timeout: float | None = None,
        connect_timeout: float = CONNECT_TIMEOUT,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._now = clock
        timeout = placed.graph.links.patience if timeout is None else timeout
        super().__init__(part_graph(placed, machine))
        assert isinstance(self.clock, PartClock)
        own_clock = self.clock
        self.placed = placed
        self.machine = machine
        self.parameters = DistributedParameters(self.blocks)
        self.peers = PeerStates(
            placed,
            machine,
            transport,
            lambda: own_clock.stop_request and own_clock.stop_request[0],
            free=self.is_free,
        )
        self.receivers: list[LockstepReceiver | LatestReceiver] = []
        self.path_ages: list[PathAges] = []
        self.transport = transport
        coordinator = self._block(COORDINATOR, LockstepCoordinator)
        for path, phase in ((PREPARED, PartPhase.PREPARED), (STARTED, PartPhase.STARTED)):
            self._block(path, StartBarrier).connect(coordinator, phase)
        self._make_receivers(timeout)
        self.watch = CommandWatch(placed, machine, self.receivers, clock)
        if self.watch.links:
            own_clock.heard, own_clock.command_limit = self.watch.heard, self.watch.limit
        senders = {
            link.name: self._block(sender_path(link), LinkOutput)
            for link in placed.sent_by(machine)
        }
        coordinator.connect(
            self.peers,
            PartLinks(transport, self.receivers, senders, self.open_links, self.watch),
            self.parameters,
            clock=own_clock,
            timeout=timeout,
            connect_timeout=connect_timeout,
            moves=bool(self._moving()),
            elsewhere={s.path: s.machine for s in placed.graph.blocks if s.machine != machine},
        )
        self.coordinator = coordinator
        self.blocks = self._in_order_of_start()

    def _block(self, path: str, kind: type[Any]) -> Any:
        block = self.blocks[path]
        assert isinstance(block, kind)
        return block

    def _make_receivers(self, timeout: float) -> None:
        if self.is_free:
            self._block(TICK_TIME, TickTime).now = self._now
        bus, layout = self.memory.bus.buffer.data, self.memory.bus.layout
        for link in self.placed.received_by(self.machine):
            reader = MessageReader(link, layout, bus)
            receiver: LockstepReceiver | LatestReceiver
            if self.is_free:
                policy = self.placed.graph.links.policy_of(link.source)
                health = self._block(health_path(link), LinkMonitor).health
                receiver = LatestReceiver(
                    link, reader, self.peers, policy, health, self._ask_to_stop, self._now
                )
            else:
                receiver = LockstepReceiver(link, reader, self.peers, timeout)
            self._block(link.source, LinkInput).receiver = receiver
            self.receivers.append(receiver)

    @property
    def is_free(self) -> bool:
        """True if the part keeps its own time."""
        return self.placed.graph.links.mode == "free"

    def _ask_to_stop(self, reason: str) -> None:
        self.clock.stop_reason = reason

    def _moving(self) -> dict[str, Block]:
        """Return the blocks that move actuators: those that have something to do to come to
        rest."""
        still = Block.stop_cycle
        return {p: block for p, block in self.blocks.items() if type(block).stop_cycle is not still}

    def open_links(self) -> None:
        """Declare all links; the transport is open."""
        bus, layout = self.memory.bus.buffer.data, self.memory.bus.layout
        for receiver in self.receivers:
            link = receiver.link
            key = data_key(link.sender, link.receiver, link.source)
            self.transport.subscribe(key, receiver.on_message)
        for link in self.placed.sent_by(self.machine):
            writer = MessageWriter(link, layout, bus, self.peers.run)
            put = self.transport.publisher(data_key(link.sender, link.receiver, link.source))
            self._block(sender_path(link), LinkOutput).connect(writer, put, self._now)

    def _in_order_of_start(self) -> dict[str, Block]:
        """Return the blocks in the order in which they start: those that move actuators come last.

        Between the two stands a gate, so that nothing moves before all parts have come that far.
        """
        moving = self._moving()
        runtime = (COORDINATOR, PREPARED, STARTED)
        still = {p: b for p, b in self.blocks.items() if p not in moving and p not in runtime}
        return {
            COORDINATOR: self.blocks[COORDINATOR],
            **still,
            PREPARED: self.blocks[PREPARED],
            **moving,
            STARTED: self.blocks[STARTED],
        }


def part_clock(bound: BoundPart) -> ClockSpec:
    """Return the pacing of a part: one part is paced as the graph requires, and the others follow
    it.

    That part is the one with the block that drives the clock, or else the first machine. Where
    the parts run free, each is paced.
    """
    clock = bound.graph.clock
    if bound.is_free:
        drives = any(hasattr(block, "wait") for block in bound.blocks.values())
        return clock if clock.kind == "paced" or drives else replace(clock, kind="paced")
    if clock.kind == "robot":
        leads = any(hasattr(block, "wait") for block in bound.blocks.values())
    else:
        leads = bound.placed.machines[0].name == bound.machine
    return clock if leads else replace(clock, kind="free")


def run_part(
    bound: BoundPart, ticks: int | None = None, *, sinks: Sequence[Sink] = (), **options: Any
) -> RunResult:
    """Run one part from start to close, together with the others; the options are the executor's."""
    teller = FaultReporter(bound.coordinator)
    clock = options.pop("clock", None) or part_clock(bound)
    if not bound.is_free:
        bound.path_ages = path_sinks(bound.placed.graph, clock.kind)
    sinks = [teller, *bound.path_ages, *sinks]
    return Executor(bound, clock=clock, sinks=sinks, **options).run(ticks)


class MergedLayout:
    """Takes from each part's bytes what that part has computed.

    Args:
        placed: the graph.
        layout: the layout of the bus or of the state of the whole graph.
        parts: the layout of each part's bytes, by machine.

    Raises:
        ValueError: a field is of another type or shape in a part.
    """

    def __init__(self, placed: PlacedGraph, layout: Layout, parts: Mapping[str, Layout]) -> None:
        self._layout = layout
        self._copies: dict[str, list[tuple[int, int, int]]] = {}
        owners = {spec.path: spec.machine for spec in placed.graph.blocks}
        for name, slot in layout.slots.items():
            machine = owners[name.rpartition(".")[0].rpartition(".")[0]]
            part = parts[machine]
            if name not in part.slots:
                raise ValueError(f"{name} is not in the part of {machine}")
            other = part.slots[name]
            if (slot.section, slot.shape) != (other.section, other.shape):
                raise ValueError(f"{name} is of another type or shape on {machine}")
            first, last = layout.byte_range(name)
            start = part.byte_range(name)[0]
            copies = self._copies.setdefault(machine, [])
            if copies and copies[-1][1] == first and start - first == copies[-1][2] - copies[-1][0]:
                copies[-1] = (copies[-1][0], last, copies[-1][2])
            else:
                copies.append((first, last, start))

    def rows(self, parts: Mapping[str, NDArray[np.uint8]]) -> NDArray[np.uint8]:
        """Return the rows (n, bytes) of the whole from those of each part, (n, bytes of that
        part)."""
        count = len(next(iter(parts.values())))
        rows = np.zeros((count, self._layout.size), np.uint8)
        for machine, copies in self._copies.items():
            for first, last, start in copies:
                rows[:, first:last] = parts[machine][:, start : start + last - first]
        return rows


def hash_of(rows: NDArray[Any]) -> str:
    """Return the run hash of rows (ticks, bytes), as ``sinks.RunHash`` has it."""
    return blake2b(np.ascontiguousarray(rows).data, digest_size=16).hexdigest()
