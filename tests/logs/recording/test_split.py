"""A long run is recorded into several files, each of which can be read and replayed by itself."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from aloft.logs import RecordingError, read
from aloft.logs.recording.recorder import Recorder
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.replay import replay
from aloft.runtime.loading import checked_file
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.running.sink import Sink

GRAPH = """
rate: 100 Hz
duration: 12.5 s
blocks:
  noise: {use: blocks.WhiteNoise, with: {n: 3, seed: 4}}
  sum: {use: blocks.Integrator, with: {n: 3}, in: {u: noise.y}}
"""


def recorded(folder: Path, split: float, on_tick: int = -1) -> tuple[Recorder, RunResult]:
    """Run the graph; at ``on_tick`` the recorder's process is killed."""
    (folder / "graph.yaml").write_text(GRAPH)
    recorder = Recorder(folder / "run.rrd", split=split, flush_period=0.01)

    class Kill(Sink):
        def record(self, tick: int) -> None:
            if tick == on_tick:
                assert recorder.link is not None
                end = time.monotonic() + 60.0
                while not (folder / "run-part002.part.rrd").exists() and time.monotonic() < end:
                    time.sleep(0.01)
                os.kill(recorder.link.process_id, signal.SIGKILL)

    result = Executor(checked_file(folder / "graph.yaml"), sinks=[recorder, Kill()], log=True).run()
    return recorder, result


@pytest.mark.long
def test_every_tick_is_in_one_of_the_files(tmp_path: Path) -> None:
    recorder, result = recorded(tmp_path, split=5.0)
    names = ["run.rrd", "run-part002.rrd", "run-part003.rrd"]
    assert [file.name for file in recorder.files] == names
    assert (recorder.warnings, recorder.missing) == ([], 0)
    assert recorder.report is not None and recorder.report.rows == 1250
    assert sorted(path.name for path in tmp_path.glob("*.rrd")) == sorted(names)
    parts = [read(file) for file in recorder.files]
    assert [len(part.ticks) for part in parts] == [500, 500, 250]
    assert all(part.whole and part.missing_ticks == 0 for part in parts)
    assert result.log is not None
    assert np.array_equal(np.concatenate([part.ticks for part in parts]), result.log.ticks)
    assert np.array_equal(np.concatenate([part.rows for part in parts]), result.log.rows())
    reasons = [part.outcome["reason"] for part in parts if part.outcome]
    assert reasons[:2] == [
        "the run goes on in run-part002.rrd",
        "the run goes on in run-part003.rrd",
    ]
    assert parts[2].outcome is not None and parts[2].outcome["run_hash"] == result.run_hash


@pytest.mark.long
def test_each_file_can_be_replayed_by_itself(tmp_path: Path) -> None:
    recorder, _ = recorded(tmp_path, split=5.0)
    for file, first in zip(recorder.files, (0, 500, 1000), strict=True):
        done = replay(OpenedRun.of(file))
        assert (done.identical, done.first_tick) == (True, first)


@pytest.mark.long
def test_a_short_run_is_in_one_file(tmp_path: Path) -> None:
    recorder, _ = recorded(tmp_path, split=60.0)
    assert recorder.files == ()
    assert [path.name for path in tmp_path.glob("*.rrd")] == ["run.rrd"]


@pytest.mark.long
def test_the_recorder_is_killed_in_the_second_file(tmp_path: Path) -> None:
    recorder, _ = recorded(tmp_path, split=5.0, on_tick=800)
    assert read(tmp_path / "run.rrd").whole
    assert recorder.path == tmp_path / "run-part002.part.rrd"
    try:
        count = len(read(recorder.path, damaged=True).ticks)
    except RecordingError:  # it was killed before it wrote the beginning
        count = 0
    assert recorder.missing == 750 - count
    assert any("the recording is not whole" in text for text in recorder.warnings)


def test_several_files_need_keyframes(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="keyframe_period > 0"):
        Recorder(tmp_path / "run.rrd", split=5.0, keyframe_period=0.0)
