"""Run or recorder killed at random moments: every tick in the file is right, and the counts are exact."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from aloft.logs import RecordingError, read
from aloft.logs.recording.recorder import Recorder
from aloft.logs.recording.repair import repair
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading import checked_file
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.sink import Sink

pytestmark = pytest.mark.long

GRAPH = """
rate: 1 kHz
duration: {seconds} s
blocks:
  noise: {{use: blocks.WhiteNoise, with: {{n: 8, seed: 4}}}}
  sum: {{use: blocks.Integrator, with: {{n: 8}}, in: {{u: noise.y}}}}
"""
TICKS = 6000


def graph(folder: Path, seconds: float = TICKS / 1000) -> CheckedGraph:
    (folder / "graph.yaml").write_text(GRAPH.format(seconds=seconds))
    return checked_file(folder / "graph.yaml")


class KillLater(Sink):
    """A sink that kills the recorder a random time after a random tick."""

    def __init__(self, recorder: Recorder, moment: random.Random) -> None:
        self.recorder, self.tick = recorder, moment.randrange(TICKS)
        self.wait = moment.uniform(0.0, 0.6)

    def record(self, tick: int) -> None:
        if tick == self.tick:
            time.sleep(self.wait)
            assert self.recorder.link is not None
            os.kill(self.recorder.link.process_id, signal.SIGKILL)


@pytest.mark.parametrize("number", range(4))
def test_the_recorder_is_killed(number: int, tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    recorder = Recorder(path, flush_period=0.02, keyframe_period=0.5)
    kill = KillLater(recorder, random.Random(number))
    result = Executor(graph(tmp_path), sinks=[recorder, kill], log=True).run()
    assert result.success and result.ticks == TICKS and result.log is not None
    part = tmp_path / "run.part.rrd"
    try:
        kept = read(part)
    except RecordingError:
        assert recorder.missing == TICKS
        return
    assert recorder.missing == TICKS - len(kept.ticks)
    assert np.array_equal(kept.ticks, np.arange(len(kept.ticks)))
    assert kept.rows.tobytes() == result.log.rows()[: len(kept.ticks)].tobytes()
    before = kept.ticks.tolist()
    if not kept.whole or kept.outcome is None:
        repair(part)
        assert read(part).ticks.tolist() == before


@pytest.mark.parametrize("number", range(3))
def test_the_run_is_killed(number: int, tmp_path: Path) -> None:
    graph(tmp_path, seconds=600.0)
    path, moment = tmp_path / "run.rrd", random.Random(100 + number)
    script = (
        "from aloft.logs.recording.recorder import Recorder\n"
        "from aloft.runtime.loading import checked_file\n"
        "from aloft.runtime.running.executor import Executor\n"
        f"recorder = Recorder({str(path)!r}, flush_period=0.05)\n"
        f"Executor(checked_file({str(tmp_path / 'graph.yaml')!r}), sinks=[recorder], log=False).run()\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script])
    try:
        end = time.monotonic() + 120.0
        while not _begun(tmp_path / "run.part.rrd") and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(moment.uniform(0.0, 1.5))
    finally:
        process.kill()
        process.wait(60)
    while not path.exists() and time.monotonic() < end:
        time.sleep(0.02)
    kept = read(path)
    assert len(kept.ticks) and np.array_equal(kept.ticks, np.arange(len(kept.ticks)))
    assert kept.missing_ticks == 0 and kept.outcome is None
    assert kept.notes[-1].text == "the process that ran the graph ended without a word"
    assert kept.notes[-1].tick == len(kept.ticks)
    again = Executor(graph(tmp_path, len(kept.ticks) / 1000), log=True).run()
    assert again.log is not None and kept.rows.tobytes() == again.log.rows().tobytes()


def _begun(part: Path) -> bool:
    """Whether some ticks are in the file."""
    try:
        return len(read(part, damaged=True).ticks) > 0
    except (RecordingError, FileNotFoundError):
        return False
