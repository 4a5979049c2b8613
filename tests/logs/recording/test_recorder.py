"""A run recorded by another process: nothing is lost, whoever dies; what is dropped is counted."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from aloft.logs import RecordedRun, RecordingError, read
from aloft.logs.recording.recorder import Recorder
from aloft.logs.recording.recorder_process import RecorderProcess
from aloft.logs.recording.recorder_protocol import RecorderTask
from aloft.runtime.language.block import Block, Output, State
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.language.stages import CheckedGraph, ClockSpec
from aloft.runtime.running.executor import run
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.running.sink import Sink
from aloft.runtime.testing.allocations import count_array_allocations
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Numbers(Signal):
    values = Field(16, unit="m")
    count = Field(dtype="int64")


class Walk(Block):
    """A random walk whose generator is state only when frozen."""

    y = Output(Numbers)
    memory = State(Numbers)

    def setup(self) -> None:
        self.rng = np.random.default_rng(1)
        self.frozen = 0

    def step(self) -> None:
        self.y.values[...] += self.rng.standard_normal(16)
        self.y.count[...] += 1

    def save_state(self) -> None:
        self.frozen += 1
        self.memory.count[...] = self.y.count


class At(Sink):
    """A sink that does something in one tick."""

    def __init__(self, tick: int, action: Callable[[], object]) -> None:
        self.tick, self.action = tick, action

    def record(self, tick: int) -> None:
        if tick == self.tick:
            self.action()


def graph(ticks: int) -> CheckedGraph:
    return checked_graph({"walk": BlockUse(Walk)}, ticks=ticks)


def process_of(recorder: Recorder) -> int:
    assert recorder.link is not None
    return recorder.link.process_id


def until(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)


def ticks_in(path: Path) -> list[int]:
    """What a file that is being written has by now."""
    try:
        return read(path).ticks.tolist()
    except (RecordingError, FileNotFoundError):
        return []


def assert_whole(recorded: RecordedRun, result: RunResult) -> None:
    assert result.log is not None
    assert recorded.ticks.tolist() == result.log.ticks
    assert recorded.rows.tobytes() == result.log.rows().tobytes()


def test_a_run_is_recorded_exactly_and_stays_the_same(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "folder" / "walk.rrd", keyframe_period=0.5)
    result = run(graph(1200), sinks=[recorder])
    assert result.warnings == ()
    assert recorder.dropped == 0
    assert recorder.report is not None and recorder.report.rows == 1200
    assert result.run_hash == run(graph(1200)).run_hash
    recorded = read(tmp_path / "folder" / "walk.rrd")
    assert_whole(recorded, result)
    assert recorded.outcome == json.loads(json.dumps(result.to_json() | {"warnings": []}))
    assert recorded.header.name == result.graph.name  # type: ignore[union-attr]
    assert [note.text for note in recorded.notes] == [
        "ready: every block has started", "running", "stopping: the end", "stopped",
    ]  # fmt: skip
    assert [note.tick for note in recorded.notes] == [0, 0, 1200, 1200]
    assert recorded.keyframes == (250, 500, 750, 1000)
    bound = BoundGraph(graph(1200))
    bound.restore(recorded.snapshot(500))
    assert bound.memory.state.field("walk.memory.count") == 500
    assert bound.memory.bus.buffer.tobytes() == recorded.rows[499].tobytes()


def test_no_tick_allocates(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.rrd", keyframe_period=0.0)
    bound = BoundGraph(graph(10))
    recorder.open(bound)
    with count_array_allocations() as allocations:
        for tick in range(5):
            recorder.record(tick)
    assert allocations.count == 0 and allocations.boxed == 0
    recorder.finish(run(graph(1)))


@pytest.mark.long
def test_virtual_time_waits_for_room(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.rrd", ring_time=0.01, keyframe_period=0.1)
    result = run(graph(20_000), sinks=[recorder])
    assert recorder.dropped == 0 and result.warnings == ()
    recorded = read(tmp_path / "a.rrd")
    assert_whole(recorded, result)
    assert recorded.keyframes == tuple(range(50, 20_001, 50))
    assert len(recorded.notes) == 4


@pytest.mark.long
def test_what_finds_no_room_is_counted_and_noted(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.rrd", ring_time=0.01, when_full="drop")
    freeze = At(1000, lambda: os.kill(process_of(recorder), signal.SIGSTOP))
    thaw = At(15_000, lambda: os.kill(process_of(recorder), signal.SIGCONT))
    pause = At(16_000, lambda: until(lambda: _is_empty(recorder)))
    result = run(graph(20_000), sinks=[recorder, freeze, thaw, pause])
    assert result.success
    assert result.warnings == (f"{recorder.dropped} ticks were run but not recorded",)
    recorded = read(tmp_path / "a.rrd")
    assert recorder.dropped == recorded.dropped_ticks > 10_000
    assert len(recorded.ticks) == 20_000 - recorder.dropped
    gaps = [note for note in recorded.notes if note.kind == "dropped"]
    missing = [k for note in gaps for k in range(note.data["first"], note.data["last"] + 1)]
    assert sorted([*recorded.ticks.tolist(), *missing]) == list(range(20_000))
    assert result.log is not None
    assert recorded.rows.tobytes() == result.log.rows()[recorded.ticks].tobytes()


@pytest.mark.long
def test_the_run_goes_on_when_the_recorder_is_killed(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.rrd", flush_period=0.05)
    wait = At(999, lambda: until(lambda: len(ticks_in(tmp_path / "a.part.rrd")) >= 1000))
    kill = At(2000, lambda: os.kill(process_of(recorder), signal.SIGKILL))
    result = run(graph(5000), sinks=[recorder, wait, kill])
    assert result.success and result.ticks == 5000
    recorded = read(tmp_path / "a.part.rrd")
    count = len(recorded.ticks)
    warning = result.warnings[-1]
    assert "is not whole: the recorder was killed by SIGKILL" in warning
    # every tick is accounted for, also those that waited in the ring
    assert f"{count} ticks are in" in warning
    assert f"{5000 - count} were run but are not recorded" in warning
    assert recorder.missing == 5000 - count
    assert recorder.recording == tmp_path / "a.part.rrd"
    assert count >= 1000  # what was flushed
    assert result.log is not None
    assert recorded.rows.tobytes() == result.log.rows()[:count].tobytes()
    assert recorded.outcome is None


@pytest.mark.long
def test_a_full_disk_is_a_warning(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    told: list[str] = []
    recorder = Recorder(tmp_path / "a.rrd", on_warning=told.append)

    def fill() -> None:
        limit = 500_000
        resource.prlimit(process_of(recorder), resource.RLIMIT_FSIZE, (limit, limit))

    result = run(graph(20_000), sinks=[recorder, At(10, fill)])
    assert result.success and result.ticks == 20_000
    assert told == []  # who runs it says so at the end
    (warning,) = result.warnings
    assert warning == recorder.problem
    assert "a.rrd cannot be written any further" in warning and "`ulimit -f`" in warning
    said = capfd.readouterr()  # one line of the recorder's process at once, and none of Rerun's
    assert said.out == "" and said.err.count("\n") == 1
    assert said.err.startswith("warning: nothing more is recorded: ")
    assert recorder.report is not None
    assert recorder.report.rows + recorder.report.lost == 20_000 and recorder.report.lost > 0
    recorded = read(tmp_path / "a.rrd")
    assert result.log is not None
    count = len(recorded.ticks)
    assert recorder.report.rows <= count < 20_000 and count > 0
    assert recorded.rows.tobytes() == result.log.rows()[:count].tobytes()


def test_a_place_that_cannot_be_written_is_a_warning(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    recorder = Recorder(tmp_path / "file" / "a.rrd")
    result = run(graph(10), sinks=[recorder])
    assert result.success
    assert recorder.recording is None
    (warning,) = result.warnings
    assert warning.startswith("no recording: ") and "a.rrd cannot be written" in warning
    assert recorder.problem.startswith(f"{warning}; --record FILE writes elsewhere")


SCRIPT = """
import sys
from aloft.logs.recording.recorder import Recorder
from aloft.runtime.running.executor import Executor
from aloft.runtime.language.stages import ClockSpec
sys.path.insert(0, {folder!r})
from test_recorder import At, graph
recorder = Recorder({path!r})
tell = At(300, lambda: print(recorder.link.process_id, flush=True))
Executor(graph(1_000_000), sinks=[recorder, tell], clock=ClockSpec("paced"), log=False).run()
"""


@pytest.mark.long
def test_the_recorder_finishes_when_the_run_is_killed(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    script = SCRIPT.format(folder=str(Path(__file__).parent), path=str(path))
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    recorder = int(process.stdout.readline())  # tick 300 has run
    process.kill()
    process.wait(240)
    end = time.monotonic() + 240.0
    while time.monotonic() < end and _lives(recorder):
        time.sleep(0.02)
    assert not _lives(recorder)
    recorded = read(path)
    assert recorded.ticks.tolist() == list(range(len(recorded.ticks)))
    assert len(recorded.ticks) > 300  # not even the last flush is lost: the ring outlived the run
    assert recorded.notes[-1].kind == "fault"
    assert recorded.notes[-1].text == "the process that ran the graph ended without a word"
    assert recorded.notes[-1].tick == len(recorded.ticks)
    assert recorded.outcome is None
    assert recorded.header.clock == "paced"


def _is_empty(recorder: Recorder) -> bool:
    assert recorder.link is not None
    return recorder.link.ring.read_back == recorder.link.ring.written


def _lives(number: int) -> bool:
    try:
        state = Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return False
    return state != "Z"


@pytest.mark.long
def test_overruns_and_faults_are_noted(tmp_path: Path) -> None:
    class Slow(Walk):
        def step(self) -> None:
            if self.tick == 20:
                time.sleep(0.05)
            if self.tick == 40:
                raise ValueError("the spring broke")

    recorder = Recorder(tmp_path / "a.rrd")
    slow = checked_graph({"walk": BlockUse(Slow)}, ticks=100)
    result = run(slow, sinks=[recorder], clock=ClockSpec("paced"))
    assert not result.success
    recorded = read(tmp_path / "a.rrd")
    assert recorded.outcome is not None and recorded.outcome["success"] is False
    overruns = [note for note in recorded.notes if note.kind == "overrun"]
    assert any(note.tick == 21 and note.data["block"] == "walk" for note in overruns)
    assert len(overruns) == result.overruns
    (fault,) = [note for note in recorded.notes if note.kind == "fault"]
    assert fault.level == "ERROR" and "the spring broke" in fault.text and fault.tick == 40


@pytest.mark.long
def test_two_runs_into_one_file_spoil_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    second = Recorder(path)
    results: list[RunResult] = []
    other = At(50, lambda: results.append(run(graph(300), sinks=[second])))
    first = Recorder(path)
    result = run(graph(1000), sinks=[first, other])
    assert result.warnings == ()
    (warning,) = results[0].warnings
    assert (
        warning
        == f"another run is being recorded in {path}; this one goes to {path.parent}/a-2.rrd"
    )
    assert first.recording == path and second.recording == tmp_path / "a-2.rrd"
    assert_whole(read(path), result)
    assert_whole(read(tmp_path / "a-2.rrd"), results[0])
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a-2.rrd", "a.rrd"]


@pytest.mark.long
def test_a_file_that_somebody_removes_is_written_again(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.rrd")
    remove = At(500, lambda: (tmp_path / "a.part.rrd").unlink())
    result = run(graph(1000), sinks=[recorder, remove])
    (warning,) = result.warnings
    assert "somebody removed" in warning and "a.part.rrd while the run went on" in warning
    run_again = read(tmp_path / "a.rrd")
    assert result.log is not None
    assert run_again.whole and run_again.rows.tobytes() == result.log.rows().tobytes()


@pytest.mark.long
def test_earlier_recordings_are_kept_if_that_is_wished(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    for ticks in (10, 20, 30):
        recorder = Recorder(path, keep=1)
        run(graph(ticks), sinks=[recorder])
    assert "is kept as" in recorder.before and "a.1.rrd" in recorder.before
    assert len(read(path).ticks) == 30
    assert len(read(tmp_path / "a.1.rrd").ticks) == 20
    recorder = Recorder(path)
    run(graph(5), sinks=[recorder])
    assert "it replaces the one of 20" in recorder.before
    assert len(read(path).ticks) == 5


@pytest.mark.long
def test_what_a_killed_recorder_left_is_kept(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.rrd", flush_period=0.05)
    wait = At(999, lambda: until(lambda: len(ticks_in(tmp_path / "a.part.rrd")) >= 1000))
    kill = At(1000, lambda: os.kill(process_of(recorder), signal.SIGKILL))
    run(graph(1100), sinks=[recorder, wait, kill])
    result = run(graph(10), sinks=[Recorder(tmp_path / "a.rrd")])
    (warning,) = result.warnings
    assert "a.part.rrd was left by a run whose recorder was killed; it is kept as" in warning
    assert len(read(tmp_path / "a-cut.rrd").ticks) >= 1000
    assert len(read(tmp_path / "a.rrd").ticks) == 10


@pytest.mark.parametrize(
    ("filled", "waited", "due"),
    [(250, 0.5, True), (250, 0.4, False), (40, 0.5, False), (40, 1.9, False), (40, 2.0, True)],
)
def test_a_slow_simulation_writes_larger_batches(filled: int, waited: float, due: bool) -> None:
    # half a second of the graph's time at 500 Hz is 250 ticks
    recorder = object.__new__(RecorderProcess)
    recorder._task = RecorderTask(0, "", 0, flush_period=0.5, sync_period=5.0)
    recorder._header = SimpleNamespace(base_rate=500.0)  # type: ignore[assignment]
    recorder._filled = filled
    assert recorder._flush_is_due(waited) is due


@pytest.mark.long
def test_a_symbolic_link_stays_and_its_file_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    link = tmp_path / "a.rrd"
    link.symlink_to(tmp_path / "there" / "b.rrd")
    for ticks in (10, 20):
        assert run(graph(ticks), sinks=[Recorder(link)]).success
        assert link.is_symlink() and len(read(link).ticks) == ticks
    assert sorted(path.name for path in tmp_path.rglob("*.rrd")) == ["a.rrd", "b.rrd"]


def test_what_is_no_file_is_not_replaced_by_one(tmp_path: Path) -> None:
    pipe = tmp_path / "a.rrd"
    os.mkfifo(pipe)
    (tmp_path / "null.rrd").symlink_to("/dev/null")
    for path, kind in (
        (pipe, "FIFO"),
        (tmp_path / "null.rrd", "device"),
        (Path("/dev/null"), "device"),
    ):
        recorder = Recorder(path)
        (warning,) = run(graph(10), sinks=[recorder]).warnings
        assert f"cannot be written (it is no file but a {kind})" in warning
        assert recorder.recording is None
    assert pipe.is_fifo() and Path("/dev/null").is_char_device()
