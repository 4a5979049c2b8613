"""The cost of the runtime: a chain of 20 small vector blocks beside a hand-written loop."""

from __future__ import annotations

import gc
from collections.abc import Callable
from typing import Any

import numpy as np

from ...runtime.language.block import Block
from ...runtime.language.stages import ClockSpec
from ...runtime.running.memory import BoundGraph
from ...runtime.running.pacing import WallTime
from ...runtime.running.sinks import MemoryLog, RunHash, Sink
from ...runtime.running.ticker import Ticker
from ...runtime.testing.allocations import count_array_allocations
from ..rows import Row, compare, take_turns
from .filter_chain import COUNT, Filter, PlainFilter, chain_graph, hand_loop
from .peers import peer_chains

HAND = "hand-written loop"
BARE = "scheduler"
CHECKED = "scheduler with timing and checks"
FULL = "scheduler with timing, checks, log and hash"
PLAIN = "scheduler, ports looked up in step"
BARE_GOAL, CHECKED_GOAL = 1.10, 1.25
TICKS = 200
COMPARED_TICKS = 50
Case = Callable[[int], object]


def _ticker(block_type: type[Block], *, checks: bool) -> Ticker:
    bound = BoundGraph(chain_graph(block_type))
    return Ticker(bound, ClockSpec(), WallTime(), timing=checks, finite_check=checks)


def scheduler(rounds: int = 60) -> list[Row]:
    """The rows; ``rounds`` of 200 ticks for every case.

    Raises:
        AssertionError: some case's outputs differ in any bit from the hand-written loop's.
    """
    hand, expected = hand_loop()
    bare, checked = _ticker(Filter, checks=False), _ticker(Filter, checks=True)
    full, plain = _ticker(Filter, checks=True), _ticker(PlainFilter, checks=False)
    sinks: list[Sink] = [_BoundedLog(), RunHash()]
    for sink in sinks:
        sink.open(full.bound)
        full.records.append(sink.record)
    cases: dict[str, Case] = {
        HAND: hand,
        BARE: bare.advance,
        CHECKED: checked.advance,
        FULL: full.advance,
        PLAIN: plain.advance,
    }
    _assert_same(cases, expected, (bare, checked, full, plain))
    peers, missing = peer_chains(expected, COMPARED_TICKS)
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        times = take_turns({**cases, **peers}, rounds, TICKS)
    finally:
        gc.enable()
        gc.unfreeze()
    rows = [
        Row(HAND, float(np.median(times[HAND])), "us/tick"),
        compare(BARE, times, HAND, goal=BARE_GOAL),
        compare(CHECKED, times, HAND, goal=CHECKED_GOAL),
        compare(FULL, times, HAND),
        compare(PLAIN, times, HAND),
        *(compare(name, times, HAND) for name in peers),
        *(Row(name, None, "us/tick", HAND, note=why) for name, why in missing.items()),
    ]
    return [*rows, _allocations(full)]


class _BoundedLog(MemoryLog):
    """A log that starts again when a chunk is full, because a benchmark has no end."""

    def record(self, tick: int) -> None:
        if len(self.ticks) == self.CHUNK:
            self.ticks.clear()
            self._used = 0
        super().record(tick)


def _assert_same(cases: dict[str, Case], expected: list[Any], tickers: tuple[Ticker, ...]) -> None:
    """Raise unless every case computes the same bits."""
    for case in cases.values():
        case(COMPARED_TICKS)
    for ticker in tickers:
        for i in range(COUNT):
            found: Any = ticker.bound.blocks[f"b{i}"]
            assert found.y.value.tobytes() == expected[i].tobytes(), f"block {i} differs"


def _allocations(ticker: Ticker) -> Row:
    """The number of arrays that NumPy allocates in a tick, with all features on."""
    ticks = 2000
    with count_array_allocations() as counted:
        ticker.advance(ticks)
    per_tick = (counted.count + counted.boxed) / ticks
    return Row(
        "array allocations per tick", per_tick, "1/tick", goal=0.0, note="also of one number"
    )
