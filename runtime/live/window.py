"""Window of a running graph in shared memory: its signals, and when its blocks ran.

The control thread copies its bus and the last time stamps there, ``RATE`` times a second of the
graph's time; it asks and waits for nobody. Another process that was given the memory's descriptor reads
it whenever it likes, and computes and writes texts on its own time.

The memory is 64-bit words: a head, the missed deadlines of each block, a cursor for each program, the
bus, and the stamps of each program. The first word is odd while the writer writes, so a reader knows
when to read again. About memory order see ``logs.recording.ring``; the same holds here.
"""

from __future__ import annotations

import mmap
import os
import time
from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from ..language.layout import Layout
from ..language.stages import CheckedGraph
from ..running.lateness import BUCKETS, TickLateness, lateness_of
from ..running.memory import BoundGraph
from ..running.run_result import RunResult
from ..running.sink import Sink
from ..running.snapshot import nameless_memory
from ..running.ticker import Ticker
from ..running.timing import STAMPED_TICKS

RATE = 25.0
"""Rate at which the window is renewed [per second of the graph's time]."""
SEQUENCE, TICK, STATE, OVERRUNS, SKIPPED, CHANGES, SAID, LATE_LIMIT, LATEST = range(9)
"""The words of the head; ``SAID`` is the length of the text about the end [bytes], ``LATE_LIMIT`` the
limit of ``LatenessCounter`` and ``LATEST`` its longest [ns]. Its buckets follow."""
COUNTS = 9
HEAD = COUNTS + BUCKETS
STARTING, RUNNING, ENDED, PAUSED = range(4)
"""Values of ``STATE``."""
TEXT = 4096
"""Space for the text about the end [bytes]."""
MOST_STAMPS = 1 << 20
"""Bytes of stamps that are shown at most; a graph with so many phases shows times of some only."""


@dataclass(frozen=True)
class WindowLayout:
    """Layout of a window.

    Attributes:
        blocks: the paths of all blocks, whose missed deadlines are counted.
        programs: for each phase of the hyperperiod, the block of each call; see ``Program``.
        orders: for each phase, the places of a tick's stamps in the order of time.
        bus: the size of the bus [bytes].
    """

    blocks: Sequence[str]
    programs: Sequence[Sequence[str]]
    orders: Sequence[Sequence[int]]
    bus: int

    @property
    def cursors(self) -> int:
        """The word at which the cursors begin."""
        return HEAD + len(self.blocks)

    @property
    def text_start(self) -> int:
        """The byte at which the text about the end begins."""
        return 8 * (self.cursors + 2 * len(self.programs))

    @property
    def bus_start(self) -> int:
        """The byte at which the bus begins."""
        return self.text_start + TEXT

    def stamps(self, number: int) -> tuple[int, int]:
        """Return the bytes of a program's stamps: the first, and the one after the last."""
        sizes = [8 * STAMPED_TICKS * (len(owners) + 1) for owners in self.programs]
        first = self.bus_start + -(-self.bus // 8) * 8 + sum(sizes[:number])
        return first, first + sizes[number]

    @property
    def size(self) -> int:
        """Bytes of the whole."""
        last = len(self.programs) - 1
        return self.stamps(last)[1] if last >= 0 else self.bus_start + -(-self.bus // 8) * 8


class Window(Sink):
    """The side of the running graph; a sink for the executor."""

    def __init__(self) -> None:
        self.shape: WindowLayout | None = None
        self.descriptor = -1
        self._map: mmap.mmap | None = None
        self._next = self._tick = 0
        self._fence = Lock()

    def open(self, bound: BoundGraph) -> None:
        """Remember what is shown."""
        self._bound = bound
        self._bus = bound.memory.bus.buffer.data
        self._every = max(1, round(bound.graph.base_rate / RATE))
        self._next = self._tick = bound.clock.tick

    def watch_ticker(self, ticker: Ticker) -> None:
        """Make the memory. Without memory nothing is shown, and the run goes on."""
        self._ticker = ticker
        programs, room = [], MOST_STAMPS
        for program in ticker.programs:
            room -= program.last_stamps[0].nbytes
            if room >= 0:
                programs.append(program)
        shape = WindowLayout(
            tuple(ticker.overruns_by_block),
            tuple(program.owners for program in programs),
            tuple(program.stamp_order for program in programs),
            len(self._bus),
        )
        try:
            self.descriptor = nameless_memory(shape.size, "aloft-window")
            self._map = mmap.mmap(self.descriptor, shape.size)
        except OSError:
            return
        self._map[:] = bytes(shape.size)  # touch every page now, not while the robot moves
        view = memoryview(self._map)
        self._words = view[: shape.text_start].cast("q")
        self._text = view[shape.text_start : shape.bus_start]
        self._bus_out = view[shape.bus_start : shape.bus_start + shape.bus]
        self._programs = [
            (shape.cursors + 2 * number, program, view[slice(*shape.stamps(number))],
             program.last_stamps[0].data.cast("B"))
            for number, program in enumerate(programs)
        ]  # fmt: skip
        self.shape = shape

    def record(self, tick: int) -> None:
        """Renew the window if it is time."""
        self._tick = tick
        if tick >= self._next:
            self._next = tick + self._every
            self._renew(RUNNING)

    def turn(self, *, paused: bool) -> None:
        """Show that the run has been paused, has gone back or goes on; it stands before a tick."""
        tick = self._bound.clock.tick
        self._tick, self._next = max(0, tick - 1), tick
        self._renew(PAUSED if paused else RUNNING)

    def _renew(self, state: int) -> None:
        if self.shape is None:
            return
        words, ticker, pacer = self._words, self._ticker, self._ticker.pacer
        words[SEQUENCE] += 1
        with self._fence:
            pass
        words[TICK], words[STATE] = self._tick, state
        if pacer is not None:
            lateness = pacer.lateness
            words[OVERRUNS], words[SKIPPED] = lateness.late, pacer.skipped_periods
            words[LATE_LIMIT], words[LATEST] = lateness.limit, lateness.longest
            words[COUNTS:HEAD] = array("q", lateness.counts)
        words[CHANGES] = len(self._bound.parameters.changes)
        place = HEAD
        for count in ticker.overruns_by_block.values():
            words[place] = count
            place += 1
        self._bus_out[:] = self._bus
        for place, program, out, stamps in self._programs:
            words[place], words[place + 1] = program.ticks, program.last_stamps[1]
            out[:] = stamps
        with self._fence:
            pass
        words[SEQUENCE] += 1

    def close(self) -> None:
        """Show the last tick."""
        self._renew(ENDED)

    def finish(self, result: RunResult) -> list[str]:
        """Say why the run has ended, and let the memory go; whoever watches keeps it."""
        if self.shape is not None:
            said = result.reason.encode()[:TEXT]
            self._text[: len(said)] = said
            self._words[SAID] = len(said)
            self.shape = None
        if self.descriptor >= 0:
            os.close(self.descriptor)
            self.descriptor = -1
        return []


def digest(layout: Layout, graph: CheckedGraph) -> str:
    """Hash the layout of a bus; two processes with equal digests read its bytes alike."""
    from hashlib import blake2b

    slots = [(name, slot.section, slot.start, slot.shape) for name, slot in layout.slots.items()]
    paths = [spec.path for spec in graph.blocks]  # those of one machine's part are others
    text = repr((graph.name, paths, layout.size, layout.offsets, slots))
    return blake2b(text.encode(), digest_size=16).hexdigest()


TRIES = 50
"""Number of attempts to read a window that is being written, a millisecond apart."""


@dataclass(frozen=True)
class WindowContents:
    """Content of a window at one moment.

    Attributes:
        tick: the last tick that is shown.
        state: one of ``STARTING``, ``RUNNING``, ``PAUSED`` and ``ENDED``.
        lateness: how late ticks began.
        overruns: how many ticks began too late.
        skipped: how many periods were left out.
        changes: how many changes of parameters there were.
        late: for each block, how many deadlines passed while it ran.
        said: the reason for which the run has ended.
        bus: the bytes of the bus.
        stamps: for each program, the stamps [ns] of its last ticks, (ticks, calls + 1).
    """

    tick: int
    state: int
    lateness: TickLateness
    overruns: int
    skipped: int
    changes: int
    late: dict[str, int]
    said: str
    bus: NDArray[np.uint8]
    stamps: list[NDArray[np.int64]]


class WindowReader:
    """Reads a window; it takes the descriptor over."""

    def __init__(self, descriptor: int, shape: WindowLayout) -> None:
        self.shape = shape
        try:
            self._map = mmap.mmap(descriptor, shape.size, access=mmap.ACCESS_READ)
        finally:
            os.close(descriptor)
        self._fence = Lock()

    def look(self) -> WindowContents | None:
        """Read the present content of the window; ``None`` where its writer was stopped while it
        wrote."""
        copy = self.copy()
        return None if copy is None else parse_window(copy, self.shape)

    def copy(self) -> bytes | None:
        """Return the window's bytes as they are now; ``None`` as for ``look``."""
        for _ in range(TRIES):
            before = self._sequence()
            with self._fence:
                pass
            copy = self._map[:]
            with self._fence:
                pass
            if before % 2 == 0 and self._sequence() == before:
                return copy
            time.sleep(1e-3)
        return None

    def close(self) -> None:
        """Let the memory go."""
        self._map.close()

    def _sequence(self) -> int:
        return int.from_bytes(self._map[8 * SEQUENCE : 8 * SEQUENCE + 8], "little", signed=True)


def parse_window(copy: bytes, shape: WindowLayout) -> WindowContents:
    """Parse the bytes of a window, whose number must be that of its shape."""
    words = np.frombuffer(copy, np.int64, shape.text_start // 8)
    length = min(int(words[SAID]), TEXT)
    said = copy[shape.text_start : shape.text_start + length].decode(errors="replace")
    return WindowContents(
        tick=int(words[TICK]),
        state=int(words[STATE]),
        lateness=lateness_of(
            words[COUNTS:HEAD].tolist(), *words[[OVERRUNS, LATE_LIMIT, LATEST]].tolist()
        ),
        overruns=int(words[OVERRUNS]),
        skipped=int(words[SKIPPED]),
        changes=int(words[CHANGES]),
        late=dict(zip(shape.blocks, words[HEAD : shape.cursors].tolist(), strict=True)),
        said=said,
        bus=np.frombuffer(copy, np.uint8, shape.bus, shape.bus_start),
        stamps=[_stamps(copy, shape, words, number) for number in range(len(shape.programs))],
    )


def _stamps(
    copy: bytes, shape: WindowLayout, words: NDArray[np.int64], number: int
) -> NDArray[np.int64]:
    """Return the rows of a program that hold stamps, the oldest first, each in the order of
    time."""
    ticks, newest = words[shape.cursors + 2 * number :][:2].tolist()
    first, last = shape.stamps(number)
    rows = np.frombuffer(copy[first:last], np.int64).reshape(STAMPED_TICKS, -1)
    rows = rows[:, shape.orders[number]]
    return np.concatenate([rows[newest:], rows[:newest]]) if ticks else rows[:newest]
