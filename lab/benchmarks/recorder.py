"""The cost of recording: control thread time for each tick, packing, disk space for each minute, memory.

The graph is the whole jump's, without the score that would end it; so the bus is BRUCE's and the
control thread has its real work. ``aloft bench recorder --seconds 600`` makes the run in real time
ten minutes long, which shows whether memory grows.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...logs.file.header import make_header
from ...logs.file.row_codec import pack
from ...logs.recording.recorder import Recorder
from ...runtime.graph import load
from ...runtime.language.errors import ExitCode
from ...runtime.language.stages import CheckedGraph, ClockSpec
from ...runtime.loading.reading.files import FOLDER
from ...runtime.running.executor import Executor
from ...runtime.running.memory import BoundGraph
from ...runtime.running.run_result import RunResult
from ...runtime.running.sink import Sink
from ...runtime.testing.allocations import count_array_allocations
from .recording_peers import recording_peers
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
PACKED_TICKS, PACKED_BATCH = 1500, 256
"""Ticks of the jump that are packed, and how many together: about half a second."""


def recorder(seconds: float = 60.0, rounds: int = 30) -> list[Row]:
    """Measure and return the rows.

    Args:
        seconds: how long the run in real time is.
        rounds: of ``BURST`` ticks, of which the cost is the median.
    """
    graph = endless_jump()
    with TemporaryDirectory() as folder:
        return [
            *cost(graph, Path(folder), rounds),
            *packing(graph, Path(folder)),
            *paced(graph, Path(folder), seconds),
        ]


def endless_jump() -> CheckedGraph:
    """Return the graph of the jump without the block that ends it."""
    graph = load(GRAPH).checked
    blocks = tuple(spec for spec in graph.blocks if spec.path != "score")
    order = tuple(path for path in graph.order if path != "score")
    return replace(graph, blocks=blocks, order=order, ticks=None)


def cost(graph: CheckedGraph, folder: Path, rounds: int) -> list[Row]:
    """Measure one call of the recorder, with and without a keyframe, and a bare copy."""
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
        assert one.link is not None
        one.link.wait_until_ready()

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
    """Return the median over rounds of the microseconds a call takes, ``rest`` after each round."""
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


def packing(graph: CheckedGraph, folder: Path) -> list[Row]:
    """Measure size and time of the packed rows, beside Arrow's of the same columns, and of whole files, beside
    those of other writers."""
    result = Executor(graph).run(PACKED_TICKS)
    result.raise_if_failed()
    assert result.log is not None and result.log.layout is not None
    rows = result.log.rows()
    batches = [rows[first : first + PACKED_BATCH] for first in range(0, len(rows), PACKED_BATCH)]
    size, cost = _packed(lambda batch: pack(0, batch), batches)
    raw = f"{rows.nbytes / 1e6:.1f} MB of {len(rows)} ticks, {PACKED_BATCH} at a time"
    found = []
    for peer, write in (
        ("Arrow IPC with Zstandard", _arrow_ipc),
        ("Parquet, byte-stream split and Zstandard", _parquet),
    ):
        its_size, its_cost = _packed(write, batches)
        found += [
            Row("packed rows, size", size, "MB", peer, size / its_size, goal=1.0, note=raw),
            Row("packed rows, time", cost, "us/tick", peer, cost / its_cost, goal=1.0),
        ]
    header = make_header(graph, result.log.layout, rows[0].tobytes())
    return found + recording_peers(header, rows, folder)


def _packed(
    write: Callable[[NDArray[np.uint8]], bytes], batches: Sequence[NDArray[np.uint8]]
) -> tuple[float, float]:
    """Write all batches and return their megabytes, and the median of the microseconds a tick."""
    costs, size = [], 0
    for _ in range(3):
        began = time.process_time()
        size = sum(len(write(batch)) for batch in batches)
        costs.append((time.process_time() - began) * 1e6 / sum(map(len, batches)))
    return size / 1e6, float(np.median(costs))


def _columns(rows: NDArray[np.uint8]) -> Any:
    """Return the rows as a table with a column for each number."""
    import pyarrow as pa

    numbers = np.ascontiguousarray(rows).view(np.float64)
    return pa.table({str(k): np.ascontiguousarray(each) for k, each in enumerate(numbers.T)})


def _arrow_ipc(rows: NDArray[np.uint8]) -> bytes:
    import pyarrow as pa

    table, out = _columns(rows), pa.BufferOutputStream()
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_stream(out, table.schema, options=options) as writer:
        writer.write_table(table)
    return bytes(out.getvalue())


def _parquet(rows: NDArray[np.uint8]) -> bytes:
    import pyarrow as pa
    from pyarrow import parquet

    out = pa.BufferOutputStream()
    parquet.write_table(
        _columns(rows),
        out,
        compression="zstd",
        use_dictionary=False,
        use_byte_stream_split=True,
        write_statistics=False,
    )
    return bytes(out.getvalue())


class _MemoryWatch(Sink):
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

    def growth(self) -> float | None:
        """Return the mebibytes by which the last quarter's median is above that of the second
        quarter."""
        quarter = len(self.found) // 4
        if quarter < 2:
            return None
        second, last = self.found[quarter : 2 * quarter], self.found[-quarter:]
        return float(np.median(last) - np.median(second)) / 2**20


def paced(graph: CheckedGraph, folder: Path, duration: float) -> list[Row]:
    """Measure a run in real time: rows that were dropped, bytes a minute, memory."""
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
