"""The whole jump, from sensors to physics, goes on bit for bit from a snapshot taken in thrust."""

from pathlib import Path

import pytest

import aloft
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing import count_array_allocations

JUMP = Path(aloft.__file__).parent / "graphs" / "jump.yaml"
BEFORE, AFTER = 600, 300
"""Ticks: thrust, flight and landing come after the snapshot."""


def started(graph: CheckedGraph, *, plain: bool = False) -> Executor:
    """A run before its first tick, as machine code unless it is to be ``plain`` Python."""
    executor = Executor(BoundGraph(graph))
    if not plain:
        assert compile_calls(executor.bound.kernel_calls) == ""
        executor.ticker.fuse()
    executor.life.start()
    return executor


def trace(executor: Executor) -> list[bytes]:
    """The bus after each of the ticks."""
    rows = []
    for _ in range(AFTER):
        executor.ticker.advance(1)
        rows.append(executor.bound.memory.bus.buffer.tobytes())
    return rows


@pytest.fixture(scope="module")
def graph() -> CheckedGraph:
    return aloft.load(JUMP).checked


def test_restored_in_place_and_in_a_new_graph(graph: CheckedGraph) -> None:
    first = started(graph)
    first.ticker.advance(BEFORE)
    snapshot = first.bound.snapshot()
    expected = trace(first)
    flying = first.bound.blocks["phase"].phase.time_since_touchdown
    assert flying[()] > 0.0, "the stretch must hold a flight and a landing"
    first.bound.restore(snapshot)
    other = started(graph)
    other.bound.restore(snapshot)
    assert trace(first) == expected
    assert trace(other) == expected


@pytest.mark.long
def test_no_tick_allocates_more_arrays_than_its_blocks_declare(graph: CheckedGraph) -> None:
    compiled, executor = (
        started(graph),
        started(graph, plain=True),
    )  # whose mathematics is seen, too
    compiled.ticker.advance(BEFORE)
    executor.bound.restore(compiled.bound.snapshot())
    declared = sum(spec.block_type.array_allocations for spec in graph.blocks)
    for tick in range(BEFORE, BEFORE + AFTER):
        with count_array_allocations() as counted:
            executor.ticker.advance(1)
        assert counted.count <= declared, (tick, counted.places)
