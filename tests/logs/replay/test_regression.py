"""A stretch of a run becomes a pytest file that passes, and fails when the block changes."""

import os
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from aloft.logs.recording.writer import write_recording
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.regression import capture, write_test
from aloft.logs.replay.replay import KeptRun, Keyframes, ReplayError
from aloft.runtime.loading import checked_file, checked_text
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.sink import Sink
from aloft.runtime.testing import StretchError

GRAPH = """
rate: 100 Hz
duration: 3 s
blocks:
  wave: {use: blocks.SineWave, with: {n: 2, frequency: 3.0}}
  total: {use: "adder:Adder", with: {n: 2}, in: {u: wave.y}, rate: 50 Hz}
"""
ADDER = """
import numpy as np
from aloft import Block, Input, Output, Parameters, State, live_parameter, parameter
from aloft.blocks.general.vectors import Vector


class Adder(Block):
    '''Adds up its input.'''

    class Params(Parameters):
        n: int = parameter(2, text="elements")
        share: float = live_parameter(0.5, text="of the input")

    params: Params
    u = Input(Vector, text="what is added")
    y = Output(Vector, text="the sum")
    x = State(Vector, text="the sum so far")

    def step(self) -> None:
        self.x.value += self.params.share * self.u.value
        self.y.value[...] = self.x.value
"""


class ChangeShare(Sink):
    """A sink that changes a parameter at tick 160."""

    def open(self, bound: BoundGraph) -> None:
        self.bound = bound

    def record(self, tick: int) -> None:
        if tick == 159:
            self.bound.parameters.requests.append(adjust(self.bound.blocks, ["total.share=0.25"]))


@pytest.fixture
def recorded(tmp_path: Path) -> KeptRun:
    (tmp_path / "adder.py").write_text(ADDER)
    (tmp_path / "sum.yaml").write_text(GRAPH)
    keyframes = Keyframes(100)
    result = Executor(checked_file(tmp_path / "sum.yaml"), sinks=[keyframes, ChangeShare()]).run()
    result.raise_if_failed()
    write_recording(tmp_path / "sum.rrd", result)
    return KeptRun.of(result, keyframes)


def run_pytest(path: Path) -> subprocess.CompletedProcess[str]:
    """Run one file, in a process of its own as a user would."""
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(path)],
        env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}, capture_output=True, text=True, timeout=240, check=False, cwd=path.parent,
    )  # fmt: skip


def test_the_test_passes_and_fails_when_the_block_changes(
    recorded: KeptRun, tmp_path: Path
) -> None:
    path = tmp_path / "tests" / "test_sum.py"
    written = write_test(recorded, "total", 130, 200, path, source="sum.rrd")
    assert (written.runs, written.difference) == (35, None)
    assert written.data.stat().st_size < 8000
    text = path.read_text()
    assert "def test_total_in_ticks_130_to_199() -> None:" in text
    assert 'find_block("adder:Adder", HERE / "..")' in text and '"share": 0.5,' in text
    done = run_pytest(path)
    assert done.returncode == 0, done.stdout
    changed = ADDER.replace("self.x.value += ", "self.x.value += 1e-9 + ")
    (tmp_path / "adder.py").write_text(changed)
    for name in [name for name in sys.modules if name.startswith("adder")]:
        del sys.modules[name]
    with pytest.raises(StretchError, match=r"tick 130: y\.value\[0\] is .* ULP apart \(and 1 more"):
        runpy.run_path(str(path))["test_total_in_ticks_130_to_199"]()
    path.write_text(text.replace("atol=0.0", "atol=1e-6"))
    runpy.run_path(str(path))["test_total_in_ticks_130_to_199"]()


def test_from_a_file_without_keyframes(recorded: KeptRun, tmp_path: Path) -> None:
    opened = OpenedRun.of(tmp_path / "sum.rrd")
    assert opened.folder == tmp_path
    stretch, parameters, difference = capture(opened, "total", 130, 200)
    other, *_ = capture(recorded, "total", 130, 200)
    assert parameters == {"n": 2, "share": 0.5} and difference is None
    assert stretch.setting == other.setting
    assert stretch.setting.changes == ((160, "share", 0.25),)
    for group in ("state", "before", "inputs", "outputs"):
        one, two = getattr(stretch, group), getattr(other, group)
        assert {k: v.tobytes() for k, v in one.items()} == {k: v.tobytes() for k, v in two.items()}
    np.testing.assert_array_equal(stretch.ticks, np.arange(130, 200, 2))


def test_a_changed_parameter_at_the_start_is_the_tests(recorded: KeptRun) -> None:
    stretch, parameters, _ = capture(recorded, "total", 160, 170)
    assert parameters["share"] == 0.25 and stretch.setting.changes == ()


def test_what_cannot_be_made_a_test(recorded: KeptRun) -> None:
    with pytest.raises(ReplayError, match="there is no block 'sum' to test; there is wave, total"):
        capture(recorded, "sum", 10, 20)
    with pytest.raises(ReplayError, match="there is no tick from 20 up to 20"):
        capture(recorded, "total", 20, 20)
    with pytest.raises(ReplayError, match="only 10 of the ticks 290 to 309"):
        capture(recorded, "total", 290, 310)
    with pytest.raises(ReplayError, match="block 'total' does not run in ticks 11 to 11"):
        capture(recorded, "total", 11, 12)
    broken = recorded.all_rows.copy()
    first, last = recorded.bus.byte_range("total.y.value")
    broken[5, first:last] = 1
    other = KeptRun(**{**vars(recorded), "all_rows": broken, "snapshots": {}})
    with pytest.raises(ReplayError, match="not the one that was recorded, so what it remembers"):
        capture(other, "total", 10, 20)
    *_, difference = capture(other, "total", 4, 20)
    assert difference is not None and difference.tick == 5


@pytest.mark.long
def test_a_block_in_the_background_is_refused() -> None:
    text = GRAPH.replace(
        'use: "adder:Adder", with: {n: 2}',
        "use: blocks.Gain, with: {n: 2}, background: {latency: 40 ms}",
    )
    graph = checked_text(text, "graph.yaml")
    keyframes = Keyframes(5)
    kept = KeptRun.of(Executor(graph, sinks=[keyframes]).run(10), keyframes)
    with pytest.raises(ReplayError, match="block 'total' works in the background"):
        capture(kept, "total", 2, 8)
