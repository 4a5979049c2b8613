"""The lateness of ticks as another process sees it: both measurements agree, however busy the machine is.

The block writes the number of its tick into shared memory; the witness reads the clock around every
look there. So it knows two instants between which the tick must have begun, whatever delays either
process.
"""

import mmap
import multiprocessing
import os
import time
from multiprocessing.connection import Connection

import numpy as np

from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.pacing import WallTime
from aloft.runtime.running.snapshot import nameless_memory
from aloft.runtime.testing.graphs import BlockUse, checked_graph

TICKS, RATE = 120, 100.0
FORCED = range(10, TICKS, 4)
"""Ticks before which the system is made to sleep half a period too long."""


class Shown(Block):
    """Shows which tick it runs."""

    class Params(Parameters):
        n: int = 1

    y = Output(Vector, text="nothing")
    word: memoryview

    def step(self) -> None:
        Shown.word[0] = self.tick + 1


def watch(descriptor: int, channel: Connection) -> None:
    """Send for each tick the last instant at which it had not begun and the first at which it had."""
    word = memoryview(mmap.mmap(descriptor, 8)).cast("q")
    found, seen, before = [], 0, time.perf_counter_ns()
    channel.send("ready")
    until = before + 30_000_000_000
    while seen < TICKS and before < until:
        # the clock comes before and after the look, so the tick begins between two of its instants
        instant, now = time.perf_counter_ns(), word[0]
        if now != seen:
            after = time.perf_counter_ns()
            found += [(number, before, after) for number in range(seen, now)]
            seen = now
        before = instant
        if len(found) % 2:  # leave the processor to the run, where there is only one
            time.sleep(0)
    channel.send(found)


class SleepyTime:
    """The system's time, with late wake-ups before some ticks."""

    now = staticmethod(time.perf_counter_ns)

    def __init__(self) -> None:
        self.sleeps = 0

    def sleep(self, seconds: float) -> None:
        self.sleeps += 1
        WallTime.sleep(seconds + (0.5 / RATE if self.sleeps in FORCED else 0.0))


def test_another_process_sees_the_same_lateness() -> None:
    descriptor = nameless_memory(8, "aloft-witness")
    Shown.word = memoryview(mmap.mmap(descriptor, 8)).cast("q")
    ours, theirs = multiprocessing.Pipe()
    os.set_inheritable(descriptor, True)
    witness = multiprocessing.get_context("fork").Process(target=watch, args=(descriptor, theirs))
    witness.start()
    try:
        assert ours.poll(20.0) and ours.recv() == "ready"
        graph = checked_graph(
            {"a": BlockUse(Shown)},
            rate=RATE,
            ticks=TICKS,
            clock=ClockSpec("paced", late_after=0.25),
        )
        executor = Executor(graph, time_source=SleepyTime())
        pacer = executor.ticker.pacer
        assert pacer is not None
        counter, told = pacer.lateness, []
        count = counter.add

        def add(lateness: int) -> bool:
            told.append((time.perf_counter_ns(), lateness))
            return count(lateness)

        counter.add = add  # type: ignore[method-assign]
        result = executor.run()
        assert ours.poll(30.0)
        found = ours.recv()
    finally:
        witness.join(10.0)
        witness.kill()
        os.close(descriptor)
    assert result.ticks == len(found) == TICKS and len(told) == TICKS - 1
    lateness = np.array([value for _, value in told])
    due = np.array([instant for instant, _ in told]) - lateness  # a little late: never too early
    seen_before, seen_after = (np.array([row[k] for row in found[1:]]) for k in (1, 2))
    assert np.all(lateness <= seen_after - due + 100_000), "no tick began after it was seen to run"
    # seen not to have begun yet: the block writes microseconds after its tick has begun, so ours may
    # be less only where the thread was stopped between
    stopped = np.count_nonzero(lateness < seen_before - due - 500_000)
    assert stopped <= TICKS // 10
    limit = 0.25e9 / RATE
    surely = np.count_nonzero(seen_before - due > limit)
    possibly = np.count_nonzero(seen_after - due > limit)
    assert surely - stopped <= result.overruns <= possibly
    assert result.overruns >= len(FORCED) * 3 // 4, "as many as were forced, but for skipped ones"
