"""The recorder's process may be started ahead; it is used once, and never left behind."""

from __future__ import annotations

import os
import socket
import tempfile
from pathlib import Path

import pytest

from aloft.logs.file.reader import read
from aloft.logs.recording import process_ahead
from aloft.logs.recording.process_ahead import WriterProcess, recorder_ahead, writer_process
from aloft.logs.recording.recorder import Recorder
from aloft.logs.recording.recorder_task import Task, receive_task, send_task
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.running.executor import run
from aloft.runtime.testing.graphs import Use, checked_graph

TASK = Task(5, 4096, "/tmp/jump.rrd", 6, 0, 0.5, 5.0)


class Number(Signal):
    value = Field(unit="m")


class Count(Block):
    """Counts ticks."""

    y = Output(Number)

    def step(self) -> None:
        self.y.value[...] += 1.0


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[WriterProcess]:
    """The processes that are started in a test."""
    processes: list[WriterProcess] = []

    class Noted(WriterProcess):
        def __init__(self) -> None:
            super().__init__()
            processes.append(self)

    monkeypatch.setattr(process_ahead, "WriterProcess", Noted)
    return processes


def test_a_recorder_takes_the_process_that_was_started_ahead(
    tmp_path: Path, started: list[WriterProcess]
) -> None:
    with recorder_ahead():
        assert len(started) == 1
        for name in ("first", "second"):
            recorder = Recorder(tmp_path / f"{name}.rrd")
            graph = checked_graph({"count": Use(Count)}, ticks=10)
            result = run(graph, sinks=[recorder], log=False)
            assert (result.ticks, result.warnings, recorder.missing) == (10, (), 0)
    assert len(started) == 2
    for name in ("first", "second"):
        assert len(read(tmp_path / f"{name}.rrd").ticks) == 10


def test_a_process_that_was_not_needed_is_ended(started: list[WriterProcess]) -> None:
    with pytest.raises(ValueError, match="the graph is wrong"), recorder_ahead():
        raise ValueError("the graph is wrong")
    assert started[0].process.returncode is not None
    with recorder_ahead(wanted=False):
        pass
    assert len(started) == 1


def test_it_ends_by_itself_when_whoever_started_it_has_ended(
    started: list[WriterProcess],
) -> None:
    process = process_ahead.WriterProcess()
    process._connection.close()
    assert process.process.wait(60.0) == 0
    process.leave()


def test_a_process_that_has_died_is_replaced(started: list[WriterProcess]) -> None:
    with recorder_ahead():
        started[0].process.kill()
        started[0].process.wait()
        found = writer_process()
        assert found is started[1] and found.process.poll() is None
        found.leave()


def test_a_task_comes_with_its_files() -> None:
    own, other = socket.socketpair()
    with own, other, tempfile.TemporaryFile() as ring, tempfile.TemporaryFile() as file:
        ring.write(b"ring")
        ring.flush()
        file.write(b"file")
        file.flush()
        send_task(own, TASK, [ring.fileno(), file.fileno()])
        found = receive_task(other)
        assert found is not None and (found.path, found.capacity) == (TASK.path, TASK.capacity)
        for number, content in ((found.descriptor, b"ring"), (found.file, b"file")):
            assert os.pread(number, 4, 0) == content
            os.close(number)


def test_a_task_without_a_file_and_a_connection_without_a_task() -> None:
    own, other = socket.socketpair()
    with other, tempfile.TemporaryFile() as ring:
        with own:
            send_task(own, Task(5, 4096, "", -1, 0, 0.5, 5.0), [ring.fileno()])
        found = receive_task(other)
        assert found is not None and (found.path, found.file) == ("", -1)
        os.close(found.descriptor)
        assert receive_task(other) is None
