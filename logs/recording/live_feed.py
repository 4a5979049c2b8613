"""Shows a run to a viewer while it goes on, in a thread of the recorder's process.

The viewer may be slow, hang or die. Then only this thread waits for it. What the viewer is too slow
for is not shown, but it is in the recording. ``WatchedPart`` shows a part of a graph that runs on
another machine.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from queue import Empty, Full, Queue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...runtime.links.observer import Observer
from ...runtime.links.part import part_graph
from ...runtime.running.failures import describe
from ...runtime.running.memory import Memory
from ...runtime.running.sink import Note
from ..file.format import Header
from ..file.header import make_header
from ..viewing.blueprint import recording_blueprint
from ..viewing.drawing import LIVE
from .run_stream import RunStream

WAITING = 64
"""Pieces of work that may wait for the viewer."""
TIMEOUT = 10.0
"""Seconds without any progress, though there is work, after which the viewer is given up."""
LAST_WAIT = 3.0
"""Seconds without progress after which the end of the run no longer waits for the viewer."""
LONGEST_WAIT = 20.0
"""Seconds that the end of the run waits for the viewer in all."""
STARTING = 15.0
"""Seconds that the viewer library may take to load and to send the scene."""


class LiveFeed:
    """Sends one run to the viewer that listens at ``source``, under ``name``, by default the graph's.

    Attributes:
        problem: why nothing is shown any more; empty while all is well.
        left_out: pieces of work the viewer was too slow for.
    """

    def __init__(self, source: str, header: Header, name: str = "") -> None:
        self._name = name or header.name
        self.problem = ""
        self.left_out = 0
        self._source, self._header = source, header
        self._work: Queue[Callable[[RunStream], None] | None] = Queue(WAITING)
        self._awake = self._progressed = time.monotonic()
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def rows(self, ticks: NDArray[np.int64], rows: NDArray[np.uint8]) -> None:
        """Show the bus after each of these ticks. The arrays must not be changed afterwards."""
        self._put(lambda run: run.write_rows(ticks, rows))

    def note(self, note: Note) -> None:
        """Show a note."""
        self._put(lambda run: run.write_notes([note]))

    def finish(self, outcome: dict[str, Any] | None) -> None:
        """Show how the run ended, and wait a little until the viewer has everything."""
        if outcome is not None:
            self._put(lambda run: run.write_times(outcome))
        self._put(None)
        begun = time.monotonic()
        while self._thread.is_alive() and time.monotonic() < begun + LONGEST_WAIT:
            timeout = LAST_WAIT if self._started.is_set() else STARTING
            if time.monotonic() - max(self._progressed, begun) > timeout:
                break
            self._thread.join(0.05)
        if self._thread.is_alive() and not self.problem:
            self.problem = "the viewer did not take the end of the run"

    def _put(self, work: Callable[[RunStream], None] | None) -> None:
        if self.problem:
            return
        try:
            self._work.put_nowait(work)
        except Full:
            self.left_out += 1
            if time.monotonic() - self._awake > TIMEOUT:
                self.problem = f"the viewer has taken nothing for {TIMEOUT:g} s"

    def _run(self) -> None:
        import rerun as rr

        header = self._header
        try:
            stream = rr.RecordingStream("aloft", recording_id=self._name, send_properties=False)
            rr.set_log_time_enabled(False, recording=stream)
            layout = recording_blueprint(header, live=True)
            stream.connect_grpc(self._source, default_blueprint=layout)
            run = RunStream(stream, header, detail=LIVE)
            run.write_start()
            self._progressed = time.monotonic()
            self._started.set()
            while not self.problem:
                self._awake = time.monotonic()
                try:
                    work = self._work.get(timeout=1.0)
                except Empty:
                    continue
                if work is None:
                    break
                work(run)
                if _has_taken(stream):
                    self._progressed = time.monotonic()
            stream.flush(timeout_sec=LAST_WAIT)
        except Exception as error:  # noqa: BLE001  # whatever it is, the recording goes on
            self.problem = describe(error)


def _has_taken(stream: Any) -> bool:
    """Tell whether the viewer takes its data within a second.

    Sending does not fail when the viewer has gone, so only a flush can tell.

    Raises:
        ViewerGoneError: the viewer has gone.
    """
    try:
        stream.flush(timeout_sec=1.0)
    except RuntimeError as error:
        if "severed" in str(error):
            raise ViewerGoneError("the viewer has been closed") from error
        return False
    return True


class ViewerGoneError(Exception):
    """Raised when the viewer was closed or has died."""


class WatchedPart:
    """Feeds a viewer with the bus of another machine's part.

    The layout of the bus follows from the graph, so only the numbers travel. A row that comes after
    a later one, as from a part that was started again, begins the time anew.

    Args:
        observer: connected.
        machine: whose part it is.
        source: where the viewer listens.
    """

    def __init__(self, observer: Observer, machine: str, source: str) -> None:
        graph = part_graph(observer.placed, machine)
        bus = Memory(graph.blocks, graph.robot).bus
        header = make_header(graph, bus.layout, bus.buffer.tobytes())
        self.taken = 0
        self._feed = LiveFeed(source, header)
        observer.rows(machine, header.bus.size, self._take)

    @property
    def problem(self) -> str:
        """The reason why nothing is shown any more; empty while the viewer works."""
        return self._feed.problem

    def close(self) -> None:
        """Let the viewer have what has come."""
        self._feed.finish(None)

    def _take(self, tick: int, row: bytes) -> None:
        self.taken += 1
        rows = np.frombuffer(row, np.uint8)[None]
        self._feed.rows(np.array([tick], np.int64), rows)
