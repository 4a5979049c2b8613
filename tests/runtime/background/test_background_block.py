"""A block in the background has the bytes of that block in the loop with a delay, whatever happens."""

import re
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from aloft import load
from aloft.logs.replay.replay import KeptRun, Keyframes, replay
from aloft.runtime.language.errors import ExitCode
from aloft.runtime.language.stages import CheckedGraph
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.placement.placed import spread
from aloft.runtime.running.executor import run
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.running.sink import Sink
from aloft.runtime.running.stepping import SteppedRun
from aloft.runtime.testing.allocations import count_array_allocations
from aloft.runtime.testing.spread import run_spread
from aloft.studies.batch.jobs import job_results

from ..links.example_graphs import endpoints
from .graphs import PLACE, both, run_hash_of

COMMON = ("wave.y.value", "sum.y.value", "motor.y.value")


def assert_equal(result: RunResult, expected: RunResult) -> None:
    assert result.success and expected.success, (result.reason, expected.reason)
    for name in COMMON:
        np.testing.assert_array_equal(result.signal(name), expected.signal(name), name)


@pytest.mark.parametrize(
    ("use", "latency", "every", "offset"),
    [  # every run starts a process
        ("Slow", 1, 1, 0), ("Slow", 7, 1, 0), ("Slow", 1, 4, 3), ("Slow", 3, 2, 1),
        ("Follower", 7, 1, 0), ("Filter", 3, 2, 1),
    ],
)  # fmt: skip
def test_bytes_are_those_of_a_delay(use: str, latency: int, every: int, offset: int) -> None:
    background, loop = both(use, latency, every=every, offset=offset)
    result = run(background)
    assert_equal(result, run(loop))
    assert np.unique(result.signal("motor.y.value")).size > 5
    if latency == 7:
        assert run(background).run_hash == result.run_hash
    assert not result.block_warnings and not result.stop_problems


def test_before_the_first_result_outputs_have_their_initial_values() -> None:
    background, loop = both("Slow", 5, initial={"value": 0.5})
    result = run(background)
    assert_equal(result, run(loop))
    assert result.signal("block.y.value")[:5].tolist() == [0.5] * 5


def test_a_solver_of_a_users_own() -> None:
    pytest.importorskip("casadi")
    background, loop = both("Solver", 3, ticks=30)
    assert_equal(run(background), run(loop))


def test_metrics_are_those_of_the_whole_run_and_times_those_of_the_worker() -> None:
    background, loop = both("Slow", 6, params={"sleep_at": 20, "sleep": "80 ms"})
    result, expected = run(background), run(loop)
    assert_equal(result, expected)
    assert result.metrics == expected.metrics
    times = result.blocks["block"]
    assert times.calls == 54  # of 60 results 6 are not due
    assert times.max_us >= 80_000 > times.p50_us
    assert times.overruns == 0


def test_a_reason_to_stop_appears_with_its_outputs() -> None:
    background, _ = both("Slow", 4, params={"stop_at": 20})
    result = run(background)
    assert (result.success, result.reason, result.ticks) == (True, "counted enough", 25)


class ChangeAt(Sink):
    """A sink that changes parameters after some ticks."""

    def __init__(self, **changes: tuple[int, float]) -> None:
        self.changes = changes

    def open(self, bound: BoundGraph) -> None:
        self.bound = bound

    def record(self, tick: int) -> None:
        for name, (after, value) in self.changes.items():
            if tick == after:
                adjustment = adjust(self.bound.blocks, {f"block.{name}": value})
                self.bound.parameters.requests.append(adjustment)


@pytest.mark.parametrize(("use", "name"), [("Slow", "gain"), ("Filter", "share")])
def test_live_parameters_hold_from_the_runs_that_are_sampled_then(use: str, name: str) -> None:
    background, loop = both(use, 6)
    result = run(background, sinks=[ChangeAt(**{name: (17, 0.5)})])
    assert_equal(result, run(loop, sinks=[ChangeAt(**{name: (17, 0.5)})]))
    # what it is without the change the loop tells, too, and needs no process for that
    assert not np.array_equal(result.signal("motor.y.value"), run(loop).signal("motor.y.value"))


@pytest.mark.long
def test_parameters_that_the_block_refuses_leave_the_old_ones() -> None:
    background, _ = both("Slow", 6)
    result = run(background, sinks=[ChangeAt(gain=(17, 7.0))])
    assert result.run_hash == run(background).run_hash
    assert result.block_warnings == ("block: block 'block' refuses the change: seven is refused",)


@pytest.mark.parametrize(("use", "at"), [("Slow", 0), ("Follower", 3), ("Filter", 23)])
def test_what_is_under_way_is_computed_again(use: str, at: int) -> None:
    background, _ = both(use, 6)
    with SteppedRun(background) as stepped:
        if at:
            stepped.step(at)
        kept = stepped.snapshot()

        def rest() -> list[float]:
            found = []
            while stepped.step():
                found.append(float(stepped["motor.y.value"]))
            return found

        first = rest()
        assert len(first) == 60 - at
        for _ in range(2):
            stepped.restore(kept)
            assert rest() == first


@pytest.mark.long
def test_another_run_goes_on_from_a_snapshot() -> None:
    background, _ = both("Follower", 6)
    with SteppedRun(background) as stepped:
        stepped.step(31)
        kept = stepped.snapshot()
    whole = run(background)
    bound = BoundGraph(background)
    bound.restore(kept)
    result = run(bound)
    expected = whole.signal("motor.y.value")[31:]
    np.testing.assert_array_equal(result.signal("motor.y.value"), expected)


def test_a_reset_is_a_new_beginning() -> None:
    background, _ = both("Slow", 4)
    with SteppedRun(background) as stepped:
        found = []
        for _ in range(2):
            stepped.step(40)
            found.append((float(stepped["block.y.value"]), stepped["block.pair.vector"].tolist()))
            stepped.reset()
    assert found[0] == found[1]


def test_the_control_thread_allocates_nothing() -> None:
    background, _ = both("Slow", 6)
    with SteppedRun(background) as stepped:
        stepped.step(20)
        with count_array_allocations() as counted:
            stepped.step(20)
    assert counted.places == [] and counted.count == 0


def failure(background: CheckedGraph, file: Path) -> str:
    """The reason of a run that must fail, and end with the motor at rest."""
    result = run(background)
    assert result.exit_code is ExitCode.RUN_FAILED
    assert result.error is not None and result.error.block == "block"
    assert file.read_text().splitlines() == ["rests"] * 5
    assert not result.stop_problems
    return re.sub(r"process \d+", "process 1", result.reason)


def test_an_error_of_the_block_is_named_when_its_outputs_are_due(tmp_path: Path) -> None:
    file = tmp_path / "motor"
    background, _ = both("Slow", 4, params={"fail_at": 20}, motor=str(file))
    assert failure(background, file) == (
        "block 'block' failed at tick 24 (0.240 s): its worker (process 1) failed with "
        "ValueError: the spring broke, in the run of tick 20"
    )


def test_a_block_that_cannot_be_set_up_ends_the_run_before_its_first_tick() -> None:
    background, _ = both("Slow", 4, params={"broken": True})
    result = run(background)
    assert (result.exit_code, result.ticks) == (ExitCode.RUN_FAILED, 0)
    assert re.fullmatch(
        r"block 'block' failed in start: its worker \(process \d+\) failed with RunError: "
        "block 'block' failed in setup: the spring is missing", result.reason,
    )  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such signal")
def test_a_crash_of_the_worker_ends_the_run_in_good_order(tmp_path: Path) -> None:
    file = tmp_path / "motor"
    background, _ = both("Slow", 4, params={"die_at": 20}, motor=str(file))
    assert failure(background, file) == (
        "block 'block' failed at tick 24 (0.240 s): its worker (process 1) was killed by SIGKILL, "
        "in the run of tick 20"
    )


def test_a_worker_that_hangs_ends_the_run_in_good_order(tmp_path: Path) -> None:
    file = tmp_path / "motor"
    background, _ = both(
        "Slow", 4, params={"sleep_at": 20}, motor=str(file), clock={"hangs_after": "1 s"}
    )
    assert failure(background, file) == (
        "block 'block' failed at tick 24 (0.240 s): its worker (process 1) hangs in the run of "
        "tick 20: it did not finish it within 1 s (clock.hangs_after allows longer)"
    )


def test_a_replay_repeats_the_run_from_any_keyframe() -> None:
    background, _ = both("Slow", 6)
    keyframes = Keyframes(20)
    # it changes while runs before the keyframe are under way
    result = run(background, sinks=[keyframes, ChangeAt(gain=(17, 0.5))])
    kept = KeptRun.of(result, keyframes)
    for first in (None, 20, 40):
        replayed = replay(kept, first_tick=first)
        assert replayed.identical, (replayed.first, replayed.notes)
        assert "block" in replayed.ran and replayed.first_tick == (first or 0)
    # and it may take the block's outputs from the recording
    replayed = replay(kept, run=["wave", "sum", "motor"])
    assert replayed.identical and replayed.ran == ("wave", "sum", "motor")


@pytest.mark.long
@pytest.mark.parametrize("places", [{"motor": "b"}, {"block": "b", "sum": "c"}])
def test_machines_in_lockstep_give_the_bytes_of_one_process(places: dict[str, str]) -> None:
    background, _ = both("Slow", 6)
    alone = run(background)
    spread_out = run_spread(spread(background, endpoints("a", "b", "c"), places), timeout=30.0)
    assert all(result.success for result in spread_out.results.values())
    assert spread_out.run_hash == alone.run_hash


def test_an_error_ends_all_machines() -> None:
    background, _ = both("Slow", 6, params={"fail_at": 20})
    placed = spread(background, endpoints("a", "b"), {"block": "b"})
    for name, result in run_spread(placed, timeout=30.0).results.items():
        assert result.exit_code is ExitCode.RUN_FAILED, name
        assert "block 'block' failed at tick 26" in result.reason


def test_episodes_of_an_environment_are_equal() -> None:
    gym = pytest.importorskip("aloft.environments")
    text = """
rate: 100 Hz
duration: 1 s
blocks:
  push: {use: blocks.External, with: {n: 1}}
  block: {use: slow_blocks:Slow, in: {u: push.y.value[0]}, background: {latency: 60 ms}}
"""
    graph = load(text, path=PLACE)
    environment = gym.make(
        graph, action="push", observation="block.y.value", reward="block.y.value"
    )
    episodes = []
    for _ in range(2):
        environment.reset(seed=1)
        steps = [environment.step(np.array([0.05 * k]))[0].tolist() for k in range(20)]
        episodes.append(steps)
    environment.close()
    assert episodes[0] == episodes[1] and episodes[0][-1] != episodes[0][0] == [0.0]


@pytest.mark.long
def test_processes_of_a_study_give_the_same_bytes() -> None:
    expected = [run_hash_of(share) for share in (1, 2, 3)]
    with closing(job_results(run_hash_of, [1, 2, 3], workers=2)) as results:
        found = {result.index: result.value or result.error for result in results}
    assert [found[k] for k in range(3)] == expected
    assert len(set(expected)) == 3
