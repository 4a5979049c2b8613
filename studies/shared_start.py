"""Runs that differ in live parameters only: loaded and bound once, and begun where they first differ.

One run of the graph as it is written, the shared one, is kept: a snapshot of everything every
``EVERY`` ticks, and of the blocks whose parameters are drawn all that they read, write and remember in every
tick. With other parameters these blocks run alone on what they read in the shared run. Up to the first
tick in which one of them writes or remembers something else every block reads what it read there, so
the whole run has the same bytes, and it begins with the last snapshot before that tick.

A block that keeps something outside its declared memory cannot be asked so: such runs begin with
the first tick. The first run of each shared one is made in both ways, so that a graph that does not repeat
itself from a snapshot is found; all its runs are then made as others are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runtime.graph import Graph
from ..runtime.language.block import Block
from ..runtime.language.errors import AloftError, RunError
from ..runtime.language.parameter_change import Adjustment
from ..runtime.language.parameters import is_live
from ..runtime.loading.checking.parameters import adjust
from ..runtime.running.memory import BoundGraph
from ..runtime.running.run_result import RunResult
from ..runtime.running.sink import Sink
from ..runtime.running.sinks import RunHash
from ..runtime.running.snapshot import Snapshot
from ..runtime.running.stepping import SteppedRun
from ..runtime.running.tick_calls import can_be_chained
from .expansion import Job, seeded_graph

EVERY = 10
"""Ticks between two snapshots."""


class SharedStart:
    """Makes runs of a graph with other live parameters.

    Args:
        graph: the graph of the shared run.
        blocks: those whose parameters will change.

    Raises:
        RunError: a block could not be set up or started, or failed in the shared run.
    """

    def __init__(self, graph: Graph, blocks: Sequence[str]) -> None:
        self._hash = RunHash()
        self._trace = _Trace(blocks)
        self._run = SteppedRun(graph.checked, sinks=(self._hash, self._trace))
        self._specs = {path: graph.checked.block(path) for path in blocks}
        self._kept: list[tuple[Snapshot, RunHash]] = []
        try:
            while not self._run.reason:
                self._kept.append((self._run.snapshot(), self._hash.kept()))
                self._run.step(EVERY)
        except BaseException:
            self._run.close()
            raise
        self._trace.over = True
        self.skipped = 0
        """Number of ticks of the last run that were not run."""

    def close(self) -> None:
        """Close all blocks."""
        self._run.close()

    def run(self, changes: Mapping[str, Any]) -> RunResult:
        """Make the run with these live parameters, from its start to its end.

        Raises:
            LoadError: a change is wrong, or of a parameter that is not live.
            AloftError: a block refuses it.
        """
        run = self._run
        run.restore(self._kept[0][0])
        run.change(Adjustment({path: spec.params for path, spec in self._specs.items()}, ()))
        blocks = {path: run.block(path) for path in self._specs}
        run.change(adjust(blocks, changes))
        first = min(self._trace.first_difference(path, self._kept[0][0]) for path in blocks)
        snapshot, hashed = self._kept[min(first // EVERY, len(self._kept) - 1)]
        run.restore(snapshot)
        self._hash.go_on_from(hashed)
        self.skipped = snapshot.tick
        error = None
        try:
            while not run.reason:
                run.step(1_000_000)
        except RunError as failure:
            error = failure
        return replace(run.result(error), run_hash=self._hash.hexdigest())


@dataclass(frozen=True)
class _MemoryBytes:
    """The places of a block's memory: bytes of the bus and of the state."""

    read: NDArray[np.intp]
    written: NDArray[np.intp]
    remembered: NDArray[np.intp]


class _Trace(Sink):
    """A sink that keeps what some blocks read, write and remember in each tick in which they run."""

    def __init__(self, blocks: Sequence[str]) -> None:
        self._paths = blocks
        self.over = False

    def open(self, bound: BoundGraph) -> None:
        """Find the places of the blocks that have all of their memory declared."""
        self._bound = bound
        self._bus, self._state = bound.memory.bus.buffer, bound.memory.state.buffer
        asked = [path for path in self._paths if _is_all_declared(bound.blocks[path])]
        self._places = {path: _places(bound, path) for path in asked}
        self._rows: dict[str, list[tuple[int, Any, Any, Any]]] = {path: [] for path in asked}

    def record(self, tick: int) -> None:
        """Keep one tick."""
        if self.over:
            return
        for path, places in self._places.items():
            spec = self._bound.graph.block(path)
            if tick % spec.period_ticks == spec.offset_ticks:
                self._rows[path].append(
                    (tick, self._bus[places.read], self._bus[places.written],
                     self._state[places.remembered])
                )  # fmt: skip

    def first_difference(self, path: str, start: Snapshot) -> int:
        """Find the first tick in which a block, with its present parameters and on its inputs in
        the shared run, writes or remembers something else; after the last if there is none."""
        if path not in self._places:
            return 0
        bound, places, block = self._bound, self._places[path], self._bound.blocks[path]
        moore = type(block).is_moore()
        bound.restore(start)
        for tick, read, written, remembered in self._rows[path]:
            bound.clock.tick = tick
            self._bus[places.read] = read
            try:
                block.emit() if moore else block.step()  # type: ignore[attr-defined]  # it has the one or the other
                if moore:
                    block.update()  # type: ignore[attr-defined]
            except Exception:  # noqa: BLE001  # it will fail again in the run, which says so
                return tick
            if (
                bound.clock.stop_reason is not None
                or (self._bus[places.written] != written).any()
                or (self._state[places.remembered] != remembered).any()
            ):
                return tick
        return self._rows[path][-1][0] + 1 if self._rows[path] else 0


def _is_all_declared(block: Block) -> bool:
    """Tell whether a block is nothing but compiled kernels, which see no memory but the declared
    one."""
    kind = type(block)
    if kind.save_state is not Block.save_state or not can_be_chained(block):
        return False
    return not kind.is_moore() or can_be_chained(block, "update_calls")


def _places(bound: BoundGraph, path: str) -> _MemoryBytes:
    spec = bound.graph.block(path)
    bus, state = bound.memory.bus.layout, bound.memory.state.layout
    kind = spec.block_type

    def bytes_of(layout: Any, ports: Mapping[str, Any]) -> NDArray[np.intp]:
        ranges = [
            np.arange(*layout.byte_range(f"{source}.{name}"), dtype=np.intp)
            for source, port in ports.items() for name in port.signal.fields
        ]  # fmt: skip
        return np.concatenate([np.zeros(0, np.intp), *ranges])

    read = {
        spec.wires[name].source if name in spec.wires else f"{path}.{name}": port
        for name, port in kind.inputs.items()
    }
    return _MemoryBytes(
        bytes_of(bus, read),
        bytes_of(bus, {f"{path}.{name}": port for name, port in kind.outputs.items()}),
        bytes_of(state, {f"{path}.{name}": port for name, port in kind.states.items()}),
    )


MOST = 16
"""Shared runs that a process keeps; of more cells and seeds the runs are made one by one."""
_kept: dict[str, SharedStart | None] = {}


def shared_result(work: Job) -> RunResult | None:
    """Make the run of a draw from the tick where it first differs from the run without the draw;
    ``None`` where it has to be made from its start, with its graph loaded anew."""
    if not work.drawn:
        return None
    key = repr((replace(work, drawn={}), tuple(work.drawn)))
    new = key not in _kept
    if new:
        if sum(each is not None for each in _kept.values()) >= MOST:
            return None
        _kept[key] = _shared_start(work)
    shared = _kept[key]
    if shared is None:
        return None
    try:
        result = shared.run(work.drawn)
    except AloftError:
        return None  # whoever makes the run from its start says what is wrong
    if result.error is not None:
        shared.close()
        del _kept[key]
        return None
    if new:
        whole = seeded_graph(work).run(log=False)
        if (whole.run_hash, whole.success, whole.reason) != (
            result.run_hash, result.success, result.reason,
        ):  # fmt: skip
            shared.close()
            _kept[key] = None
        return whole
    return result


def _shared_start(work: Job) -> SharedStart | None:
    """Return the shared run of a job, if all that it draws is live."""
    try:
        graph = seeded_graph(replace(work, drawn={}))
        specs = {spec.path: spec for spec in graph.checked.blocks}
        if any(spec.block_type.outside == "real" for spec in specs.values()):
            return None
        for name in work.drawn:
            path, *rest = name.split(".")
            fields = type(specs[path].params).model_fields if path in specs else {}
            if not rest or rest[0] not in fields or not is_live(fields[rest[0]]):
                return None
        return SharedStart(graph, list(dict.fromkeys(n.partition(".")[0] for n in work.drawn)))
    except AloftError:
        return None
