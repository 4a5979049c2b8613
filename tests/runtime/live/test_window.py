"""The window in shared memory: what is written is what is read, and never half of it."""

import os
import threading
import time
from pathlib import Path

import numpy as np

from aloft.runtime.live.window import (
    ENDED,
    RATE,
    RUNNING,
    SEQUENCE,
    Window,
    WindowLayout,
    WindowReader,
)
from aloft.runtime.loading import checked_file
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.snapshot import nameless_memory
from aloft.runtime.running.timing import STAMPED_TICKS


class Kept(Window):
    """A window whose reader opens before the run has ended; counts how often it is renewed."""

    def __init__(self) -> None:
        super().__init__()
        self.renewed = 0
        self.reader: WindowReader | None = None

    def record(self, tick: int) -> None:
        super().record(tick)
        if self.reader is None:
            assert self.shape is not None
            self.reader = WindowReader(os.dup(self.descriptor), self.shape)

    def _renew(self, state: int) -> None:
        self.renewed += 1
        super()._renew(state)


def test_the_last_tick_its_bus_and_its_times_are_read(graph_file: Path) -> None:
    bound = BoundGraph(checked_file(graph_file, ["clock.kind=free"]))
    window = Kept()
    result = Executor(bound, log=False, plain=True, sinks=[window]).run(200)
    assert result.success and window.reader is not None
    # eight ticks are 1/25 s; the last tick is shown in the end
    assert window.renewed == 200 / (200 / RATE) + 1
    look = window.reader.look()
    assert look is not None
    assert (look.tick, look.state, look.said) == (199, ENDED, "ran to its end")
    assert look.bus.tobytes() == bound.memory.bus.buffer.tobytes()
    assert look.late == dict.fromkeys(("wave", "inner/twice", "pid"), 0)
    (stamps,) = look.stamps
    assert stamps.shape == (STAMPED_TICKS, len(window.reader.shape.programs[0]) + 1)
    assert (np.diff(stamps, axis=1) >= 0).all() and (np.diff(stamps[:, 0]) > 0).all()
    window.reader.close()


def test_before_a_round_of_stamps_is_full_only_those_there_are_read(graph_file: Path) -> None:
    bound = BoundGraph(checked_file(graph_file, ["clock.kind=free"]))
    window = Kept()
    Executor(bound, log=False, plain=True, sinks=[window]).run(5)
    assert window.reader is not None
    look = window.reader.look()
    assert look is not None and len(look.stamps[0]) == 5
    window.reader.close()


def test_a_writer_that_stopped_within_a_tick_is_noticed() -> None:
    shape = WindowLayout(("a",), (), (), 64)
    descriptor = nameless_memory(shape.size, "half")
    os.pwrite(descriptor, (7).to_bytes(8, "little"), 8 * SEQUENCE)
    reader = WindowReader(descriptor, shape)
    assert reader.look() is None
    reader.close()


def test_rows_are_never_mixed(graph_file: Path) -> None:
    """The gain doubles the wave in every tick, and so it does in every look."""
    window = Window()
    bound = BoundGraph(checked_file(graph_file, ["clock.kind=free"]))
    executor = Executor(bound, log=False, plain=True, sinks=[window])
    thread = threading.Thread(target=executor.run)
    thread.start()
    while window.shape is None:
        time.sleep(1e-3)
    reader = WindowReader(os.dup(window.descriptor), window.shape)
    layout, seen = bound.memory.bus.layout, []
    end = time.monotonic() + 60.0
    while len(dict.fromkeys(seen)) < 20 and time.monotonic() < end:
        look = reader.look()
        time.sleep(1e-3)
        if look is not None and look.state == RUNNING:
            wave = layout.view(look.bus, "wave.y.value")
            twice = layout.view(look.bus, "inner/twice.y.value")
            assert (twice == 2.0 * wave).all()
            seen.append(look.tick)
    bound.clock.stop_reason = "seen"
    thread.join(60.0)
    reader.close()
    assert seen == sorted(seen) and len(dict.fromkeys(seen)) == 20
