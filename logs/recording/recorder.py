"""Records a run while it goes on. The control thread only copies; another process writes.

::

    result = aloft.load("graphs/jump.yaml").run(sinks=[Recorder("jump.rrd")], log=False)

Each tick costs one copy of the bus into a ring of shared memory. The run goes on whatever happens
to the writing process or to the disk; ``warnings`` says what is missing then.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict
from os import PathLike
from pathlib import Path
from typing import Literal

from ...processes.child_process import ChildError
from ...robots.surfaces import missing_meshes
from ...runtime.language.errors import AloftError
from ...runtime.language.parameter_change import ParameterChange
from ...runtime.language.recording_cost import large_recording
from ...runtime.running.memory import BoundGraph
from ...runtime.running.run_result import RunResult
from ...runtime.running.sink import Note, Sink, parameter_note
from ..file.code import code_of, remember
from ..file.header import header_of
from ..file.held_fields import SplitBus, split_bus
from ..file.reader import read
from .output_file import cause_of, remedy, replaced, reserve_output, unfinished_name
from .recorder_link import RecorderLink, rerun_is_installed
from .recorder_protocol import KEYFRAME, NOTE, PART, REWIND, ROW, RecorderReport, RecorderTask
from .ring import space_of

STALL_TIME = 60.0
"""Seconds without any progress that are worth a warning, and more than a robot waits. A process
that is slow, as its disk is slow or the machine has too much to do, makes progress."""
GIVE_UP_TIME = 600.0
"""Seconds without any progress after which a simulation gives the process up, too."""

WhenFull = Literal["wait", "drop"]


class Recorder(Sink):
    """A sink that records into one file, replacing what was there when the run has ended.

    Args:
        path: the file; its folder is made. ``None`` writes none and only shows the run live. If
            another run is being recorded there, this one takes another name, with a warning.
        keep: how many earlier recordings of that name are kept; see ``output_file``.
        when_full: what to do when the process cannot keep up: ``wait``, which costs a simulation in
            virtual time nothing but a while, or ``drop`` ticks, which are counted. By default what
            suits the graph's clock: a run in real time never waits.
        keyframe_period: seconds of the graph's time between two keyframes; zero for none.
        flush_period: seconds after which what has come is handed to the operating system; a
            process that is killed loses no more than that.
        sync_period: seconds after which it is put on the disk; a power cut takes no more than that.
        ring_time: seconds of the run that fit into the ring, if they fit into its bytes.
        ring_bytes: bytes of the ring, at most, but that it always holds four keyframes; by default what the graph
            says in ``recording``.
        split: seconds of the graph's time after which the recording goes on in a new file, at the
            next keyframe: ``jump.rrd``, ``jump-part002.rrd`` ... Each can be read and replayed by
            itself. Zero for one file.
        live: where a viewer listens (``viewer.Viewer.source``) that is to show the run while it
            goes on; a viewer that dies or hangs is a warning.
        link: the process, if it was started early.
        on_warning: called with each warning at once, where ``warnings`` is looked at in the end;
            not with ``problem``, which is for whoever tells how the run ended.

    Attributes:
        warnings: what went wrong, one text each.
        problem: why there is no recording or why it is not whole, and what to do about it, when the
            run has ended; empty if it is whole. It is one of the warnings as well, there without
            what to do where that was known before the run.
        waits_for_others: true while a run in virtual time waits for the process, which is no hang;
            the link knows when the process has stood still for too long.
        path: the file in which the recording is found when the run has ended.
        dropped: how many ticks were run but found no room in the ring.
        before: what becomes of an earlier recording of that name, in words.
        missing: how many ticks were run but are not in the file.
        report: what the process said at its end.
    """

    def __init__(
        self,
        path: str | PathLike[str] | None,
        *,
        keep: int = 0,
        when_full: WhenFull | None = None,
        keyframe_period: float = 1.0,
        flush_period: float = 0.5,
        sync_period: float = 5.0,
        ring_time: float = 4.0,
        ring_bytes: int | None = None,
        split: float = 0.0,
        live: str = "",
        link: RecorderLink | None = None,
        on_warning: Callable[[str], object] | None = None,
    ) -> None:
        if split and keyframe_period <= 0:
            raise ValueError("a recording in several files needs keyframes: keyframe_period > 0")
        self.path = Path(path) if path is not None else None
        self.warnings: list[str] = []
        self.problem = ""
        self.waits_for_others = False
        self.dropped = 0
        self.missing = 0
        self.before = ""
        self._keep = keep
        self._seen = 0
        self.report: RecorderReport | None = None
        self.link: RecorderLink | None = None
        self._started = link
        self._when_full = when_full
        self._keyframe_period = keyframe_period
        self._periods = flush_period, sync_period
        self._ring, self._split = (ring_time, ring_bytes), split
        self._parts: HeldGroups | None = None
        self._begins = True
        self._live = live
        self._on_warning = on_warning
        self._gap: tuple[int, int, int] | None = None
        self._told_of_stall = False

    @property
    def files(self) -> tuple[Path, ...]:
        """The files of a recording in several, when the run has ended; none if it is in one."""
        return tuple(map(Path, self.report.files)) if self.report is not None else ()

    @property
    def recording(self) -> Path | None:
        """The file that is recorded; ``None`` if there is none, or if the run is only shown."""
        nothing = self.report is not None and self.problem and not self.report.rows
        return self.path if self.link is not None and not nothing else None

    def open(self, bound: BoundGraph) -> None:
        """Start the process; in a run in real time, wait until it is ready."""
        self._bound = bound
        self._bus = bound.memory.bus.buffer.data
        self._frame = bytearray(len(self._bus) + bound.memory.state.buffer.size)
        self._every = round(self._keyframe_period * bound.graph.base_rate)
        free = bound.clock.kind == "free"
        self._waits = (self._when_full or ("wait" if free else "drop")) == "wait"
        problem, fix = self._start()
        if self.link is None:
            self._warn(f"no recording: {problem}")
            self.problem = f"no recording: {problem}; {fix}"
            return
        if bound.graph.robot is not None:
            for missing in missing_meshes(bound.graph.robot):
                self._warn(missing)
        self._write = self.link.ring.write
        bound.parameters.listeners.append(self._note_change)
        if not free:
            try:
                self.link.wait_until_ready()
            except ChildError as error:
                self._warn(f"the run began without a recorder: {error}")
        if self._every and bound.clock.tick:
            self._keep_keyframe(bound.clock.tick)  # a run that goes on from a snapshot

    def _warn(self, text: str) -> None:
        self.warnings.append(text)
        if self._on_warning is not None:
            self._on_warning(text)

    def _fail(self, text: str) -> None:
        self.problem = text
        self.warnings.append(text)

    def _start(self) -> tuple[str, str]:
        """Start the process, or say why it cannot be and what to do, before anything moves."""
        if not rerun_is_installed():
            return "Rerun cannot be imported", "pip install rerun-sdk, or --no-record writes none"
        rate, frame = self._bound.graph.base_rate, 4 * space_of(len(self._frame))
        graph = self._bound.graph
        if self.path is not None and (large := large_recording(graph)):
            self._warn(large)
        if graph.resolved is not None:
            remember(code_of(graph.resolved, graph.robot))  # what the user runs he may run again
        about = header_of(self._bound)
        split, (ring_time, ring_bytes) = split_bus(about), self._ring
        self._parts = HeldGroups(split, self._bus) if split.held else None
        row = space_of(split.base.layout.size)
        row += sum(space_of(part.layout.size) // part.period for part in split.held)
        if ring_bytes is None:
            ring_bytes = graph.recording.ring_bytes
        capacity = min(round(ring_time * rate) * row, ring_bytes) + frame
        header = about.to_json()
        try:
            output = None
            if self.path is not None:
                output = reserve_output(self.path, self._keep)
                self.path = output.target
                self.before = replaced(self.path, self._keep)
                for text in output.said:
                    self._warn(text)
            path = str(self.path.absolute()) if self.path is not None else ""
            task = RecorderTask(
                capacity, path, self._keep, *self._periods, self._live, round(self._split * rate)
            )
            link = self._started or RecorderLink()
            link.begin(task, output, header, least=frame)
            self.link = link
        except OSError as error:
            what = f"{self.path} cannot be written" if self.path else "the recorder cannot start"
            fix = remedy(cause_of(error), self.path)
            return f"{what} ({error.strerror or error})", fix
        return "", ""

    def record(self, tick: int) -> None:
        """Copy the bus into the ring, and now and then the graph's whole memory as a keyframe."""
        if self.link is None:
            return
        self._seen += 1
        if self._parts is not None and self._gap is None and not self._begins:
            written = self._write(PART, tick, self._parts.at(tick))
        else:
            written = self._gap is None and self._write(ROW, tick, self._bus)
        self._begins = False
        if not written:
            self._find_room(tick)
        if self._every and (tick + 1) % self._every == 0:
            self._keep_keyframe(tick + 1)

    def _find_room(self, tick: int) -> None:
        """Wait for room in the ring if that is the policy; otherwise count the tick as dropped."""
        if self._wait_for_room(ROW, tick, self._bus):
            return
        if self._gap is not None and self._note_gap(tick) and self._write(ROW, tick, self._bus):
            return
        first, _, count = self._gap or (tick, tick, 0)
        self._gap = (first, tick, count + 1)
        self.dropped += 1

    def _wait_for_room(self, kind: int, tick: int, data: memoryview | bytes | bytearray) -> bool:
        """Wait for room in the ring, if that is the policy, and write. Returns whether that was done."""
        if not self._waits or self._gap is not None:
            return False
        assert self.link is not None
        self.link.reset_stall_timer()
        self.waits_for_others = True
        try:
            while self._waiting_helps():
                if self._write(kind, tick, data):
                    return True
                time.sleep(1e-3)
        finally:
            self.waits_for_others = False
        self._waits = False  # it has ended or hangs, but the run does not
        return False

    def _waiting_helps(self) -> bool:
        """Tell whether to go on waiting for the process. It warns once that the process is slow."""
        assert self.link is not None
        stalled = self.link.stalled_for()
        if not self.link.is_alive() or stalled > GIVE_UP_TIME:
            return False
        if stalled > STALL_TIME:
            if not self._waits:
                return False
            if not self._told_of_stall:
                self._told_of_stall = True
                self._warn(
                    f"the recorder has not gone on for {stalled:.0f} s; the run waits for it, "
                    f"until that has been {GIVE_UP_TIME:.0f} s"
                )
        return True

    def _note_gap(self, tick: int) -> bool:
        """Write a note of the dropped ticks. Returns whether there was room for it."""
        assert self._gap is not None
        first, last, count = self._gap
        text = f"{count} ticks were not recorded: {first} to {last}"
        data = {"first": first, "last": last, "count": count}
        if not self._write(NOTE, tick, _encoded(Note(tick, "dropped", text, "WARN", data))):
            return False
        self._gap = None
        return True

    def _keep_keyframe(self, tick: int) -> None:
        """Copy the graph's whole memory before ``tick``, if there is room for it."""
        if self._gap is not None:
            return
        try:
            for block in self._bound.blocks.values():
                block.save_state()
        except Exception as error:  # noqa: BLE001  # a recorder must not end the run
            self._warn(f"no keyframes from tick {tick} on: saving a state failed ({error})")
            self._every = 0
            return
        size = len(self._bus)
        self._frame[:size] = self._bus
        self._frame[size:] = self._bound.memory.state.buffer.data
        if not self._write(KEYFRAME, tick, self._frame):
            self._wait_for_room(KEYFRAME, tick, self._frame)

    def rewind(self, tick: int) -> None:
        """Go on in a new file, which begins with the graph's whole memory before ``tick``.

        The run stands still meanwhile, so this waits for room in every run. Where the process takes
        nothing any more, nothing more is recorded: in one file a tick is never there twice.
        """
        if self.link is None:
            return
        self.link.reset_stall_timer()
        while not ((self._gap is None or self._note_gap(tick)) and self._write(REWIND, tick, b"")):
            if not self._waiting_helps():
                self._write, self._waits, self._every = _no_room, False, 0
                self._warn(f"nothing is recorded after the run has gone back to tick {tick}")
                return
            time.sleep(1e-3)
        self._begins = True
        self._keep_keyframe(tick)

    def _note_change(self, change: ParameterChange) -> None:
        self.note(parameter_note(change))

    def note(self, note: Note) -> None:
        """Put a note into the ring; there is nearly always room."""
        if self.link is not None and not self._write(NOTE, note.tick, _encoded(note)):
            self._wait_for_room(NOTE, note.tick, _encoded(note))

    def finish(self, result: RunResult) -> list[str]:
        """Have the outcome written, and wait for the process to end. Returns what went wrong."""
        if self.link is None:
            return self.warnings
        if self._gap is not None and self._write is not _no_room:
            self.link.reset_stall_timer()
            while not self._note_gap(self._gap[1]) and self._waiting_helps():
                time.sleep(1e-3)
        self.report, problem = self.link.finish(result.to_json(), self._waiting_helps)
        self.missing = self.dropped
        if self.report is None:
            self._tell_of_a_cut(problem)
        else:
            self.missing += self.report.lost
            if self.dropped:
                self._warn(f"{self.dropped} ticks were run but not recorded")
            if self.report.odd:
                self._warn(self.report.odd)
        if self.report is not None and self.report.live_problem:
            self._warn(f"the viewer did not show all of the run: {self.report.live_problem}")
        if self.report is not None and self.report.problem:
            self._tell_of_a_problem(self.report)
        return self.warnings

    def _tell_of_a_problem(self, report: RecorderReport) -> None:
        """Say that nothing, or not all, could be written."""
        fix = remedy(report.error_number, self.path)
        if report.rows:
            self._fail(
                f"the recording {self.path} is not whole: {report.problem}; {report.rows} ticks are "
                f"in it, {self.missing} are not; {fix}"
            )
        else:
            self._fail(f"no recording: {report.problem}; none of {self._seen} ticks is kept; {fix}")

    def _tell_of_a_cut(self, problem: str) -> None:
        """Warn that the process has not ended the file, and count what is in it."""
        if self.path is None:
            self._warn(f"the run was not shown to its end: {problem}")
            return
        count, self.path = self._ticks_found(self.path)
        self.missing = self._seen - count
        what = f"'aloft log repair {self.path}' completes it" if count else "nothing can be saved"
        self._fail(
            f"the recording is not whole: {problem}; {count} ticks are in {self.path}, "
            f"{self.missing} were run but are not recorded; {what}"
        )

    def _ticks_found(self, path: Path) -> tuple[int, Path]:
        """Count the ticks in the files that the process left, and return the name of the last of
        them."""
        count = 0
        while self._split:
            try:
                closed = read(path)
            except (AloftError, OSError):
                break
            following = (closed.outcome or {}).get("goes_on_in")
            if following is None:
                break
            count, path = count + len(closed.ticks), path.with_name(following)
        with suppress(AloftError, OSError):
            count += len(read(unfinished_name(path), damaged=True).ticks)
        return count, unfinished_name(path)


class HeldGroups:
    """Gathers the bytes of a row that are put into the ring where some fields are held.

    Args:
        split: the parts of the bus.
        bus: its bytes.
    """

    def __init__(self, split: SplitBus, bus: memoryview) -> None:
        self._split, self._from = split, bus
        self._records: dict[tuple[bool, ...], tuple[bytearray, list[tuple[slice, slice]]]] = {}

    def at(self, tick: int) -> bytearray:
        """Return the base and the held groups that are due in ``tick``; valid until the next call."""
        due = tuple(part.is_due(tick) for part in self._split.held)
        if due not in self._records:
            self._records[due] = self._made(due)
        record, copies = self._records[due]
        for to, begin in copies:
            record[to] = self._from[begin]
        return record

    def _made(self, due: tuple[bool, ...]) -> tuple[bytearray, list[tuple[slice, slice]]]:
        parts = [p for p, is_due in zip(self._split.held, due, strict=True) if is_due]
        copies, place = [], 0
        for part in (self._split.base, *parts):
            for begin, end, to, until in part.copies:
                copies.append((slice(place + to, place + until), slice(begin, end)))
            place += part.layout.size
        return bytearray(place), copies


def _no_room(kind: int, tick: int, data: memoryview | bytes | bytearray) -> bool:
    """Stand in for the ring of a recorder that is given up."""
    return False


def _encoded(note: Note) -> bytes:
    return json.dumps(asdict(note)).encode()
