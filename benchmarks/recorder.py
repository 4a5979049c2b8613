"""The cost of recording: control thread time for each tick, disk space for each minute, and memory.

The graph is the whole jump's, without the score that would end it; so the bus is BRUCE's and the
control thread has its real work. ``aloft bench recorder --seconds 600`` makes the run in real time
ten minutes long, which shows whether memory grows.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ..logs.recording.recorder import Recorder
from ..runtime.graph import load
from ..runtime.language.errors import ExitCode
from ..runtime.language.stages import CheckedGraph, ClockSpec
from ..runtime.loading.reading.files import FOLDER
from ..runtime.running.executor import Executor
from ..runtime.running.memory import BoundGraph
from ..runtime.running.run_result import RunResult
from ..runtime.testing.allocations import count_array_allocations
from .rows import Row

COST_GOAL = 2.0
"""Microseconds of the control thread a tick [us]."""
BURST = 200
"""Ticks recorded at once, less than the ring holds."""
GRAPH = FOLDER / "jump.yaml"
GROWTH_GOAL = 16.0
"""Mebibytes that memory may grow from the second to the last quarter of a run of any length."""
MEMORY_PERIOD = 1.0
"""Seconds between two looks at the recorder's memory."""


def recorder(seconds: float = 60.0, rounds: int = 30) -> list[Row]:
    """The rows.

    Args:
        seconds: how long the run in real time is.
        rounds: of ``BURST`` ticks, of which the cost is the median.
    """
    graph = endless_jump()
    with TemporaryDirectory() as folder:
        return [*cost(graph, Path(folder), rounds), *paced(graph, Path(folder), seconds)]


def endless_jump() -> CheckedGraph:
    """The graph of the jump without the block that ends it."""
    graph = load(GRAPH).checked
    blocks = tuple(spec for spec in graph.blocks if spec.path != "score")
    order = tuple(path for path in graph.order if path != "score")
    return replace(graph, blocks=blocks, order=order, ticks=None)


def cost(graph: CheckedGraph, folder: Path, rounds: int) -> list[Row]:
    """What one call of the recorder takes, with and without a keyframe, and a bare copy."""
    bound = BoundGraph(graph)
    sink = Recorder(folder / "cost.rrd", keyframe_period=0.0, when_full="drop")
    with_keyframes = Recorder(
        folder / "keyframes.rrd", keyframe_period=graph.base_period, when_full="drop"
    )
    bus = bound.memory.bus.buffer.data
    target = memoryview(bytearray(len(bus)))
    opened = (sink, with_keyframes)
    for one in opened:
        one.open(bound)
        assert one.link is not None and one.link.wait_until_ready()

    def copy(tick: int) -> None:
        target[:] = bus

    gc.collect()
    gc.disable()
    try:
        plain = _median(copy, rounds)
        single = _median(sink.record, rounds, lambda: _drain(sink))
        keyframe = _median(with_keyframes.record, 10, lambda: _drain(with_keyframes), burst=20)
        with count_array_allocations() as allocations:
            for tick in range(BURST):
                sink.record(tick)
    finally:
        gc.enable()
    for one in opened:
        one.finish(RunResult(True, "", ExitCode.SUCCESS, 0, graph.base_period, 0.0))
        assert one.dropped == 0
    return [
        Row("one copy of the bus, bare", plain, "us", note=f"{len(bus)} bytes"),
        Row("recording a tick", single, "us", goal=COST_GOAL),
        Row("recording a tick with a keyframe", keyframe, "us", note="one tick in a second"),
        Row("array allocations of recording", allocations.count / BURST, "1/tick", goal=0.0),
    ]


def _median(
    call: Callable[[int], object],
    rounds: int,
    rest: Callable[[], object] = lambda: None,
    burst: int = BURST,
) -> float:
    """The median over rounds of the microseconds a call takes, ``rest`` after each round."""
    found = []
    for _ in range(rounds):
        began = time.perf_counter_ns()
        for tick in range(burst):
            call(tick)
        found.append((time.perf_counter_ns() - began) * 1e-3 / burst)
        rest()
    return float(np.median(found))


def _drain(sink: Recorder) -> None:
    assert sink.link is not None
    while sink.link.ring.read_back < sink.link.ring.written:
        time.sleep(1e-3)


class _MemoryWatch:
    """A sink that looks at the memory of a recorder's process now and then."""

    def __init__(self, sink: Recorder) -> None:
        self.sink = sink
        self.found: list[int] = []

    def open(self, bound: BoundGraph) -> None:
        """Find out how often."""
        self.every = round(MEMORY_PERIOD * bound.graph.base_rate)

    def record(self, tick: int) -> None:
        """Look, if it is time."""
        if tick % self.every == 0 and self.sink.link is not None:
            status = Path(f"/proc/{self.sink.link.process_id}/statm")
            if status.exists():
                self.found.append(int(status.read_text().split()[1]) * 4096)

    def close(self) -> None:
        """Nothing to do."""

    def growth(self) -> float | None:
        """Mebibytes that the last quarter's median is above that of the second quarter."""
        quarter = len(self.found) // 4
        if quarter < 2:
            return None
        second, last = self.found[quarter : 2 * quarter], self.found[-quarter:]
        return float(np.median(last) - np.median(second)) / 2**20


def paced(graph: CheckedGraph, folder: Path, duration: float) -> list[Row]:
    """A run in real time: rows that were dropped, bytes a minute, memory."""
    sink = Recorder(folder / "paced.rrd")
    watch = _MemoryWatch(sink)
    executor = Executor(graph, clock=ClockSpec("paced"), sinks=[sink, watch], log=False)
    result = executor.run(round(duration * graph.base_rate))
    result.raise_if_failed()
    report = sink.report
    assert report is not None and not report.problem, result.warnings
    what = f"{duration:g} s at {graph.base_rate:g} Hz"
    late = f"{result.overruns} overruns of {result.ticks} ticks"
    minute = report.size / result.ticks * graph.base_rate * 60.0 / 1e6
    return [
        Row(
            "rows dropped", float(result.ticks - report.rows), "", goal=0.0, note=f"{what}; {late}"
        ),
        Row("size of the file", minute, "MB/min", note="all signals of all ticks"),
        Row("memory of the recorder, at most", report.memory / 2**20, "MiB"),
        Row(
            "memory growth, second to last quarter",
            watch.growth(),
            "MiB",
            goal=GROWTH_GOAL,
            note=what,
        ),
    ]
