"""In real time: what the outputs are while a result is late. Results are late because the block sleeps."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.logs.replay.replay import KeptRun, Keyframes, replay
from aloft.runtime.language.errors import ExitCode
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.running.executor import run
from aloft.runtime.running.run_result import RunResult

from .graphs import both

PACED = {"kind": "paced"}


def late_graph(late: str, sleep: str = "60 s", **more: Any) -> CheckedGraph:
    """The run of tick 10 sleeps; its outputs are due at tick 13."""
    params = {"sleep_at": 10, "sleep": sleep}
    clock = {**PACED, **more}
    background, _ = both("Slow", 3, params=params, ticks=40, background={"late": late}, clock=clock)
    return background


def late_notes(result: RunResult) -> list[int]:
    assert result.log is not None
    return [note.tick for note in result.log.notes if note.kind == "late"]


def test_hold_keeps_the_last_values() -> None:
    result = run(late_graph("hold"))
    assert result.success, result.reason
    shown = result.signal("block.pair.count")
    assert shown.max() == shown[-1] == 10  # the runs of ticks 0 to 9, whenever they came
    assert result.metrics["late_results"] >= 27
    assert late_notes(result)[-27:] == list(range(13, 40))
    assert result.blocks["block"].overruns == result.metrics["late_results"]


def test_safe_writes_zeros() -> None:
    result = run(late_graph("safe"))
    assert result.success, result.reason
    assert result.signal("block.pair.count")[-1] == 0
    assert not result.signal("block.pair.vector")[-1].any()


def test_stop_ends_the_run() -> None:
    result = run(late_graph("stop"))
    assert result.exit_code is ExitCode.RUN_FAILED
    found = re.fullmatch(
        r"block 'block' is late at tick (\d+): the result of tick (\d+) is not there, and "
        "background.late is 'stop'", result.reason,
    )  # fmt: skip
    assert found and int(found[1]) == int(found[2]) + 3 <= 13


def test_stop_is_the_default() -> None:
    background, _ = both("Slow", 1, params={"sleep_at": 2}, ticks=20, clock=PACED)
    assert run(background).exit_code is ExitCode.RUN_FAILED


def test_what_was_late_appears_when_it_comes_and_later_runs_are_in_time_again() -> None:
    background, _ = both(
        "Slow", 3, params={"sleep_at": 10, "sleep": "150 ms"}, ticks=200,
        background={"late": "hold"}, clock=PACED,
    )  # fmt: skip
    result = run(background)
    assert result.success, result.reason
    counts = result.signal("block.pair.count")
    assert np.all(np.diff(counts) >= 0)
    assert result.metrics["late_results"] >= 10
    skipped = 200 - 3 - counts[-1]
    assert 10 <= skipped < 190  # what could not be sampled while the worker slept


def test_early_results_wait() -> None:
    background, loop = both("Slow", 100, ticks=130, clock=PACED)
    result = run(background)
    assert result.success, result.reason
    assert result.metrics["late_results"] == 0
    virtual = run(loop, clock=background.clock.__class__())
    np.testing.assert_array_equal(result.signal("motor.y.value"), virtual.signal("motor.y.value"))


@pytest.mark.parametrize("late", ["hold", "safe"])
def test_a_worker_that_hangs_ends_the_run(late: str) -> None:
    result = run(late_graph(late, hangs_after="150 ms"))
    assert result.exit_code is ExitCode.RUN_FAILED
    assert re.search(
        r"its worker \(process \d+\) hangs in the run of tick \d+: it did not finish it within "
        r"0.15 s \(clock.hangs_after allows longer\)", result.reason,
    )  # fmt: skip


def test_a_crash_is_noticed_when_its_result_is_late(tmp_path: Path) -> None:
    file = tmp_path / "motor"
    background, _ = both(
        "Slow", 3, params={"die_at": 10}, ticks=200, background={"late": "hold"}, clock=PACED,
        motor=str(file),
    )  # fmt: skip
    result = run(background)
    assert result.exit_code is ExitCode.RUN_FAILED
    assert re.search(
        r"its worker \(process \d+\) was killed by SIGKILL, in the run of", result.reason
    )
    assert file.read_text().splitlines() == ["rests"] * 5


def test_a_replay_takes_late_outputs_from_the_recording() -> None:
    background, _ = both(
        "Slow", 3, params={"sleep_at": 10, "sleep": "80 ms"}, ticks=60,
        background={"late": "hold"}, clock=PACED,
    )  # fmt: skip
    keyframes = Keyframes(20)
    kept = KeptRun.of(run(background, sinks=[keyframes]), keyframes)
    assert kept.late == ("block",)
    replayed = replay(kept, first_tick=20)
    assert replayed.identical, (replayed.first, replayed.notes)
    assert replayed.ran == ("wave", "sum", "motor")
