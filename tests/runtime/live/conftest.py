"""A graph that runs in real time, for tests that look at it from outside."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from aloft.runtime.live.parameter_endpoint import ParameterEndpoint
from aloft.runtime.loading import checked_file
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.run_result import RunResult

GRAPH = """\
rate: 200 Hz
clock: {kind: paced}
blocks:
  wave:
    use: blocks.SineWave
    with:
      n: 2
      frequency: 2 Hz
  inner: {use: part.yaml, in: {u: wave.y}}
  pid: {use: blocks.PID, with: {n: 2, kp: [1, 2]}, in: {setpoint: wave.y, measured: inner.y}}
"""
PART = """\
inputs: {u: required}
outputs: {y: twice.y}
blocks:
  twice: {use: blocks.Gain, with: {n: 2, gain: 2}, in: {u: inputs.u}}
"""


@dataclass
class Running:
    """A graph that runs in a thread of this process, and where it answers."""

    bound: BoundGraph
    path: Path
    file: Path
    thread: threading.Thread
    results: list[RunResult]

    def stop(self, reason: str = "the test is over") -> None:
        """End the run and wait for its end."""
        self.bound.clock.stop_reason = reason
        self.thread.join(60.0)
        assert not self.thread.is_alive()


def start(file: Path, path: Path, *, paused: bool = False) -> Running:
    """Run the graph in ``file``; it answers at ``path``, and may begin ``paused``."""
    bound = BoundGraph(checked_file(file))
    executor = Executor(
        bound, log=False, plain=True, sinks=[ParameterEndpoint(path, paused=paused)]
    )
    results: list[RunResult] = []
    thread = threading.Thread(target=lambda: results.append(executor.run()))
    thread.start()
    return Running(bound, path, file, thread, results)


def write_graph(folder: Path) -> Path:
    """The file of the graph, written there."""
    (folder / "part.yaml").write_text(PART)
    (folder / "waves.yaml").write_text(GRAPH)
    return folder / "waves.yaml"


@pytest.fixture
def graph_file(tmp_path: Path) -> Path:
    return write_graph(tmp_path)


@pytest.fixture
def socket_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A short path, as that of a socket must be."""
    return tmp_path_factory.mktemp("s") / "waves.sock"


@pytest.fixture
def running(graph_file: Path, socket_path: Path) -> Iterator[Running]:
    run = start(graph_file, socket_path)
    yield run
    run.stop()
