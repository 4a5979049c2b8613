"""A viewer that dies or hangs while it is fed: a warning, and the recording is whole."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

from aloft.logs.file.reader import read
from aloft.logs.recording.recorder import Recorder
from aloft.logs.viewing.viewer import start_viewer
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.running.executor import run
from aloft.runtime.running.sink import Sink
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Numbers(Signal):
    value = Field(60)


class Count(Block):
    """Counts, in sixty numbers."""

    numbers = Output(Numbers)

    def step(self) -> None:
        self.numbers.value.fill(self.tick)


class Strike(Sink):
    """A sink that sends the viewer a signal at a tick."""

    def __init__(self, tick: int, process: int, number: signal.Signals) -> None:
        self._at, self._process, self._number = tick, process, number

    def record(self, tick: int) -> None:
        if tick == self._at:
            os.kill(self._process, self._number)


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGSTOP])
def test_a_viewer_that_fails_is_a_warning(
    tmp_path: Path, number: signal.Signals, capfd: pytest.CaptureFixture[str]
) -> None:
    viewer = start_viewer("web")
    try:
        recorder = Recorder(tmp_path / "a.rrd", live=viewer.source)
        strike = Strike(300, viewer.process.pid, number)
        result = run(
            checked_graph({"count": BlockUse(Count)}, ticks=1000),
            sinks=[recorder, strike],
            clock=ClockSpec("paced"),
        )
        assert result.success and result.ticks == 1000 and recorder.dropped == 0
        said = capfd.readouterr()
        assert said.out == "" and said.err.count("\n") <= 1  # Rerun writes no lines of its own
        assert said.err.startswith("warning: nothing more is shown live: ") or not said.err
        recorded = read(tmp_path / "a.rrd")
        assert recorded.outcome is not None
        np.testing.assert_array_equal(recorded["count.numbers.value"][:, 0], np.arange(1000.0))
        if number is signal.SIGKILL:
            (warning,) = result.warnings
            assert warning.startswith("the viewer did not show all of the run: ")
            # On a loaded machine the run may end before a flush has told that the viewer is gone.
            reasons = ("the viewer has been closed", "the viewer did not take the end of the run")
            assert warning.endswith(reasons) or any(f"{reason};" in warning for reason in reasons)
    finally:
        os.kill(viewer.process.pid, signal.SIGCONT) if viewer.is_alive() else None
        viewer.stop()


@pytest.mark.long
def test_a_viewer_that_is_not_there_is_a_warning(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    recorder = Recorder(tmp_path / "a.rrd", live="rerun+http://127.0.0.1:9/proxy")
    result = run(checked_graph({"count": BlockUse(Count)}, ticks=100), sinks=[recorder])
    assert result.success
    (warning,) = result.warnings
    assert warning.startswith("the viewer did not show all of the run: ")
    said = capfd.readouterr()
    assert said.out == "" and said.err.count("\n") <= 1
    assert said.err.startswith("warning: nothing more is shown live: ") or not said.err
    assert len(read(tmp_path / "a.rrd").ticks) == 100
