"""In real time: what the outputs are while a result is late. Results are late because the block sleeps.

Latencies are long beside what a busy machine takes, so that all other results are in time.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.logs.replay.replay import KeptRun, Keyframes, replay
from aloft.runtime.language.errors import ExitCode
from aloft.runtime.language.stages import CheckedGraph, ClockSpec
from aloft.runtime.running.executor import run
from aloft.runtime.running.run_result import RunResult

from .graphs import both

PACED = {"kind": "paced"}
LATENCY = 40
DUE = 10 + LATENCY
"""The tick in which the outputs of the run that sleeps are due."""


def late_graph(late: str, ticks: int = DUE + 40, **more: Any) -> CheckedGraph:
    """The run of tick 10 sleeps until the end, or does what ``more`` says."""
    clock = {**PACED, **{k: v for k, v in more.items() if k == "hangs_after"}}
    params = {"sleep_at": 10, **{k: v for k, v in more.items() if k != "hangs_after"}}
    background, _ = both(
        "Slow", LATENCY, params=params, ticks=ticks, background={"late": late}, clock=clock
    )
    return background


def late_notes(result: RunResult) -> list[int]:
    assert result.log is not None
    return [note.tick for note in result.log.notes if note.kind == "late"]


def test_hold_keeps_the_last_values() -> None:
    result = run(late_graph("hold"))
    assert result.success, result.reason
    counts = result.signal("block.pair.count")
    assert counts[DUE - 1] == counts[-1] == 10
    assert result.metrics["late_results"] == result.blocks["block"].overruns == 40
    assert late_notes(result) == list(range(DUE, DUE + 40))
    assert result.block_warnings == (
        "block: its worker was still computing when the run had ended; it has no metrics",
    )


def test_safe_writes_zeros() -> None:
    result = run(late_graph("safe"))
    assert result.success, result.reason
    assert result.signal("block.pair.count")[DUE - 1] == 10
    assert not result.signal("block.pair.count")[DUE:].any()
    assert not result.signal("block.pair.vector")[DUE:].any()


def test_stop_ends_the_run() -> None:
    result = run(late_graph("stop"))
    assert result.exit_code is ExitCode.RUN_FAILED
    assert result.reason == (
        f"block 'block' is late at tick {DUE}: the result of tick 10 is not there, and "
        "background.late is 'stop'"
    )


def test_stop_is_the_default() -> None:
    background, _ = both("Slow", 1, params={"sleep_at": 0}, ticks=20, clock=PACED)
    assert run(background).reason.endswith("background.late is 'stop'")


@pytest.mark.long
def test_what_was_late_appears_when_it_comes_and_later_runs_are_in_time_again() -> None:
    result = run(late_graph("hold", ticks=350, sleep="1600 ms"))
    assert result.success, result.reason
    counts = result.signal("block.pair.count")
    assert counts[DUE - 1] == counts[DUE + 20] == 10
    assert np.all(np.diff(counts) >= 0)
    # what could not be sampled, because the run that slept held its slot, was never computed
    assert 100 < counts[-1] < 350 - LATENCY - 20


def test_early_results_wait() -> None:
    background, loop = both("Slow", 100, ticks=130, clock=PACED)
    result = run(background)
    assert result.success, result.reason
    assert result.metrics["late_results"] == 0
    virtual = run(loop, clock=ClockSpec())
    np.testing.assert_array_equal(result.signal("motor.y.value"), virtual.signal("motor.y.value"))


@pytest.mark.parametrize("late", ["hold", "safe"])
def test_a_worker_that_hangs_ends_the_run(late: str) -> None:
    result = run(late_graph(late, ticks=200, hangs_after="900 ms"))
    assert result.exit_code is ExitCode.RUN_FAILED
    assert re.search(
        r"its worker \(process \d+\) hangs in the run of tick 10: it did not finish it within "
        r"0.9 s \(clock.hangs_after allows longer\)",
        result.reason,
    )


def test_a_crash_is_noticed_when_its_result_is_late(tmp_path: Path) -> None:
    file = tmp_path / "motor"
    background, _ = both(
        "Slow", LATENCY, params={"die_at": 10}, ticks=200, background={"late": "hold"},
        clock=PACED, motor=str(file),
    )  # fmt: skip
    result = run(background)
    assert result.exit_code is ExitCode.RUN_FAILED
    assert re.fullmatch(
        rf"block 'block' failed at tick {DUE} \(0.500 s\): its worker \(process \d+\) was killed by "
        "SIGKILL, in the run of tick 10",
        result.reason,
    )
    assert file.read_text().splitlines() == ["rests"] * 5


@pytest.mark.long
def test_a_replay_takes_late_outputs_from_the_recording() -> None:
    keyframes = Keyframes(20)
    result = run(late_graph("hold", ticks=250, sleep="1600 ms"), sinks=[keyframes])
    kept = KeptRun.of(result, keyframes)
    assert kept.late == ("block",)
    replayed = replay(kept, first_tick=20)
    assert replayed.identical, (replayed.first, replayed.notes)
    assert replayed.ran == ("wave", "sum", "motor")
