"""When the process of a recorder has stood still for too long, and when it is only slow."""

import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from threading import Timer
from types import SimpleNamespace
from typing import Any

import pytest

from aloft.logs import read
from aloft.logs.recording import recorder as recorder_module
from aloft.logs.recording.recorder import GIVE_UP_TIME, STALL_TIME, Recorder
from aloft.logs.recording.recorder_link import RecorderLink
from aloft.logs.recording.recorder_protocol import ROW
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.running.executor import run

from .test_recorder import At, assert_whole, graph, process_of


class SlowProcess:
    """A process in an hour that passes as fast as it is asked for; what it does is for the test."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 0.0
        self.moved = 0
        clock = SimpleNamespace(monotonic=lambda: self.now, sleep=self.sleep)
        monkeypatch.setattr(recorder_module, "time", clock)
        monkeypatch.setattr("aloft.logs.recording.recorder_link.time", clock)
        self.link: Any = object.__new__(RecorderLink)
        self.link.ring = SimpleNamespace(read_back=0)
        self.link._seen, self.link._since = (0, 0), 0.0
        monkeypatch.setattr(self.link, "_bytes_moved", lambda: self.moved)
        monkeypatch.setattr(self.link, "is_alive", lambda: True)
        self.told: list[str] = []
        self.recorder: Any = Recorder(None, on_warning=self.told.append)
        self.recorder.link, self.recorder._waits = self.link, True
        self.recorder._write = self.write
        self.waited: list[bool] = []

    def sleep(self, seconds: float) -> None:
        self.now += 10.0
        self.go_on()

    def go_on(self) -> None:
        """Nothing."""

    def write(self, *_: object) -> bool:
        """Whether there is room: after an hour."""
        self.waited.append(self.recorder.waits_for_others)
        return self.now >= 3600.0


def test_a_process_that_reads_a_little_now_and_then_is_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    slow = SlowProcess(monkeypatch)

    def read() -> None:
        slow.link.ring.read_back += 64

    monkeypatch.setattr(slow, "go_on", read)
    assert slow.recorder._wait_for_room(ROW, 7, b"")
    assert slow.told == [] and slow.now == 3600.0
    assert all(slow.waited) and not slow.recorder.waits_for_others


def test_a_process_that_reads_and_writes_files_goes_on_too(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = SlowProcess(monkeypatch)

    def write() -> None:
        slow.moved += 4096

    monkeypatch.setattr(slow, "go_on", write)
    assert slow.recorder._wait_for_room(ROW, 7, b"")
    assert slow.told == []


def test_a_process_that_does_nothing_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = SlowProcess(monkeypatch)
    assert not slow.recorder._wait_for_room(ROW, 7, b"")
    assert slow.now == GIVE_UP_TIME + 10.0
    (told,) = slow.told
    assert told == (
        f"the recorder has not gone on for {STALL_TIME + 10.0:.0f} s; the run waits for it, until "
        f"that has been {GIVE_UP_TIME:.0f} s"
    )
    assert not slow.recorder.waits_for_others


def test_a_robot_waits_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    slow = SlowProcess(monkeypatch)
    slow.recorder._waits = False
    slow.now = STALL_TIME + 1.0
    assert not slow.recorder._waiting_helps()


@pytest.mark.skipif(not Path("/proc/self/io").exists(), reason="only Linux tells it")
def test_the_bytes_of_a_process_are_counted() -> None:
    link: Any = object.__new__(RecorderLink)
    link._process = SimpleNamespace(pid=os.getpid())
    before = link._bytes_moved()
    with Path("/dev/null").open("wb", buffering=0) as file:
        file.write(bytes(100_000))
    assert link._bytes_moved() - before >= 100_000
    link._process = SimpleNamespace(pid=2**30)
    assert link._bytes_moved() == 0


@pytest.mark.long
def test_virtual_time_waits_for_a_recorder_that_is_stuck(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "STALL_TIME", 0.2)
    told: list[str] = []
    recorder = Recorder(tmp_path / "a.rrd", ring_time=0.01, on_warning=told.append)

    def stop(tick: int) -> None:
        os.kill(process_of(recorder), signal.SIGSTOP)
        go_on = partial(os.kill, process_of(recorder), signal.SIGCONT)
        Timer(1.0, go_on).start()

    stops = [At(tick, partial(stop, tick)) for tick in (1000, 10_000)]
    result = run(graph(20_000), sinks=[recorder, *stops])
    assert recorder.dropped == 0
    assert result.warnings == tuple(told) and len(told) == 1  # not one for every stop
    wanted = (
        r"the recorder has not gone on for \d+ s; the run waits for it, until that has been 600 s"
    )
    assert re.fullmatch(wanted, told[0])
    assert_whole(read(tmp_path / "a.rrd"), result)


@pytest.mark.long
def test_a_recorder_that_is_stuck_for_very_long_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "STALL_TIME", 0.1)
    monkeypatch.setattr(recorder_module, "GIVE_UP_TIME", 0.3)
    recorder = Recorder(tmp_path / "a.rrd", ring_time=0.01)
    stop = At(1000, lambda: os.kill(process_of(recorder), signal.SIGSTOP))
    try:
        result = run(graph(20_000), sinks=[recorder, stop])
    finally:
        os.kill(process_of(recorder), signal.SIGKILL)
    assert result.success and result.ticks == 20_000
    assert recorder.dropped > 10_000
    waits, stuck = result.warnings
    assert "the run waits for it, until" in waits
    assert recorder.problem == stuck
    assert "the recording is not whole: the recorder has been stuck for" in stuck
    assert f"{recorder.missing} were run but are not recorded" in stuck


@pytest.mark.long
def test_a_recorder_that_is_slow_is_no_hang(tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "a.rrd", ring_time=0.01)
    go_on = Timer(1.5, lambda: os.kill(process_of(recorder), signal.SIGCONT))

    def stop() -> None:
        os.kill(process_of(recorder), signal.SIGSTOP)
        go_on.start()

    clock = ClockSpec(hangs_after=0.3)
    result = run(graph(20_000), sinks=[recorder, At(1000, stop)], clock=clock)
    assert result.success, result.reason
    assert recorder.dropped == 0 and recorder.problem == ""
    assert not recorder.waits_for_others
    assert_whole(read(tmp_path / "a.rrd"), result)


def test_a_sink_that_hangs_without_waiting_ends_the_run() -> None:
    hang = At(5, lambda: time.sleep(120.0))
    result = run(graph(20), sinks=[hang], clock=ClockSpec(hangs_after=0.3))
    assert not result.success
    assert (
        "the runtime (At) hung at tick 5 (0.010 s): it did not return within 0.3 s" in result.reason
    )


@pytest.mark.long
def test_a_recorder_that_ends_between_two_looks_is_not_stuck(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    is_alive, finish = RecorderLink.is_alive, RecorderLink.finish

    def ends_then(link: RecorderLink) -> bool:
        alive = is_alive(link)
        link._process.wait(60.0)
        return alive

    def finish_so(link: RecorderLink, *arguments: Any) -> Any:
        monkeypatch.setattr(RecorderLink, "is_alive", ends_then)
        return finish(link, *arguments)

    monkeypatch.setattr(RecorderLink, "finish", finish_so)
    recorder = Recorder(tmp_path / "a.rrd")
    result = run(graph(5), sinks=[recorder])
    assert result.warnings == ()
    assert recorder.report is not None and recorder.report.rows == 5


@pytest.mark.long
def test_a_process_that_was_started_early_records_the_run(tmp_path: Path) -> None:
    link = RecorderLink()
    recorder = Recorder(tmp_path / "a.rrd", link=link)
    result = run(graph(50), sinks=[recorder])
    assert recorder.link is link
    assert_whole(read(tmp_path / "a.rrd"), result)
    link.close()  # which has nothing to end any more


def test_a_process_that_was_started_early_for_nothing_ends() -> None:
    link = RecorderLink()
    assert link.is_alive()
    link.close()
    assert not link.is_alive()


@pytest.mark.long
def test_a_process_ends_with_one_that_died_before_it_had_a_task() -> None:
    code = "from aloft.logs.recording.recorder_link import RecorderLink; import os; "
    code += "link = RecorderLink(); os._exit(0)"
    command = [sys.executable, "-c", code]
    # which returns when the standard error, that of the recorder too, is closed
    done = subprocess.run(command, stderr=subprocess.PIPE, check=True, timeout=60.0)
    assert done.stderr == b""


@pytest.mark.long
def test_the_process_imports_no_pandas_and_arrow_does_without() -> None:
    code = (
        "import sys\n"
        "from aloft.logs.recording.recorder_process import block_pandas_import\n"
        "block_pandas_import()\n"
        "import pyarrow\n"
        "import rerun\n"
        "rerun.AnyValues(text='a', number=1.0).as_component_batches()\n"
        "print(pyarrow.array(['a', 'b']).to_pylist(), 'pandas' in sys.modules)"
    )
    command = [sys.executable, "-W", "error", "-c", code]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert done.stdout == "['a', 'b'] False\n"
