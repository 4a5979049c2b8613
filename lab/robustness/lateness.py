"""Measures how late ticks begin, in calm and beside busy processes, by the run's own count and by another
process.

``python -m aloft.lab.robustness.lateness`` prints a table: each row is a run of a small graph in real
time. The other process reads the number of the tick in shared memory and the clock in turns, as the
test ``test_lateness_witness`` does. Where it looks often enough to know a tick's begin to 0.1 ms, both
are compared.
"""

from __future__ import annotations

import mmap
import multiprocessing
import os
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from ...blocks.general.vectors import Vector
from ...runtime.language.block import Block, Output
from ...runtime.language.errors import AloftError
from ...runtime.language.parameters import Parameters
from ...runtime.language.stages import ClockSpec
from ...runtime.running.executor import Executor
from ...runtime.running.real_time import NO_REAL_TIME, RealTimeOptions
from ...runtime.running.snapshot import nameless_memory
from ...runtime.testing.graphs import BlockUse, checked_graph

RATE, TICKS = 500.0, 4000
SHARP = 100_000
"""The longest time [ns] between the two instants of a tick for which both are compared."""
CASES = (
    ("calm", 0, NO_REAL_TIME),
    ("three busy processes", 3, NO_REAL_TIME),
    ("three busy processes, --priority 50", 3, RealTimeOptions(priority=50)),
)
"""What is said of the case, how many other processes compute, and what the run asks of the system."""


class _Shown(Block):
    """Shows which tick it runs."""

    class Params(Parameters):
        n: int = 1

    y = Output(Vector, text="nothing")
    word: memoryview

    def step(self) -> None:
        _Shown.word[0] = self.tick + 1


def watch(descriptor: int, ticks: int, channel: Connection) -> None:
    """Send two instants [ns] for each tick: it had not begun at one, and had at the other."""
    word = memoryview(mmap.mmap(descriptor, 8)).cast("q")
    found: list[tuple[int, int]] = []
    seen, before = 0, time.perf_counter_ns()
    until = before + int((10.0 + 4.0 * ticks / RATE) * 1e9)
    channel.send("ready")
    while seen < ticks and before < until:
        # the clock comes first: what is read after it had not happened by then
        instant, now = time.perf_counter_ns(), word[0]
        if now != seen:
            after = time.perf_counter_ns()
            found += [(before, after)] * (now - seen)
            seen = now
        before = instant
    channel.send(found)


def _compute() -> None:
    until = time.monotonic() + 300.0
    while time.monotonic() < until:
        sum(range(10_000))


@contextmanager
def busy(processes: int) -> Iterator[None]:
    """Let so many other processes compute."""
    context = multiprocessing.get_context("fork")
    running = [context.Process(target=_compute, daemon=True) for _ in range(processes)]
    for each in running:
        each.start()
    try:
        yield
    finally:
        for each in running:
            each.kill()
            each.join()


def measure(ticks: int, real_time: RealTimeOptions) -> dict[str, Any]:
    """Run ``ticks`` ticks and return the run's lateness, and the ticks seen late from outside."""
    descriptor = nameless_memory(8, "aloft-witness")
    _Shown.word = memoryview(mmap.mmap(descriptor, 8)).cast("q")
    ours, theirs = multiprocessing.Pipe()
    os.set_inheritable(descriptor, True)
    context = multiprocessing.get_context("fork")
    witness = context.Process(target=watch, args=(descriptor, ticks, theirs), daemon=True)
    witness.start()
    try:
        if not ours.poll(20.0):
            raise AloftError("the other process did not start within 20 s")
        ours.recv()
        graph = checked_graph(
            {"a": BlockUse(_Shown)}, rate=RATE, ticks=ticks, clock=ClockSpec("paced")
        )
        executor = Executor(graph, real_time=real_time)
        pacer = executor.ticker.pacer
        assert pacer is not None
        due: list[int] = []
        told: list[int] = []
        add = pacer.lateness.add

        def counted(lateness: int) -> bool:
            told.append(lateness)
            due.append(time.perf_counter_ns() - lateness)
            return add(lateness)

        pacer.lateness.add = counted  # type: ignore[method-assign]
        result = executor.run()
        if not ours.poll(60.0):
            raise AloftError("the other process did not see all ticks within a minute")
        before, after = np.array(ours.recv()[1:]).T - np.array(due)
    finally:
        witness.kill()
        witness.join()
        os.close(descriptor)
    assert result.lateness is not None
    limit = result.lateness.late_after_us * 1e3
    sharp = after - before < SHARP
    agreed = np.array(told)[sharp] > limit
    # not counted late though it had not begun by the limit; counted late though it had begun
    missed = np.count_nonzero(~agreed & (before[sharp] > limit))
    wrong = np.count_nonzero(agreed & (after[sharp] < limit))
    return {
        "lateness": result.lateness,
        "sharp": int(np.count_nonzero(sharp)),
        "late": int(np.count_nonzero(agreed)),
        "differ": int(missed + wrong),
    }


def rows(ticks: int = TICKS) -> Iterator[Sequence[str]]:
    """Return the rows of the table."""
    for name, processes, real_time in CASES:
        try:
            with busy(processes):
                found = measure(ticks, real_time)
        except AloftError as error:
            yield name, f"not measured: {error}", "", "", "", "", ""
            continue
        late = found["lateness"]
        yield (
            name, f"{late.p50_us:.3g}", f"{late.p99_us:.3g}", f"{late.p99_9_us:.3g}",
            f"{late.max_us:.4g}", f"{late.late}",
            f"{found['late']} of {found['sharp']}, {found['differ']} otherwise",
        )  # fmt: skip


HEAD = (
    f"{TICKS} ticks at {RATE:g} Hz", "median [us]", "99 % [us]", "99.9 % [us]", "longest [us]",
    "counted late", "late of those seen by the other process to 0.1 ms, which says otherwise of",
)  # fmt: skip

if __name__ == "__main__":
    print("| " + " | ".join(HEAD) + " |\n|" + "---|" * len(HEAD))
    for row in rows():
        print("| " + " | ".join(row) + " |")
