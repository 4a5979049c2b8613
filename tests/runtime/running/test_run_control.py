"""A run that is paused, goes back and goes on: the bytes, the parameters, the recording, the refusals."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aloft.logs import read
from aloft.logs.recording.recorder import Recorder
from aloft.logs.replay.opened_run import OpenedRun
from aloft.logs.replay.replay import replay
from aloft.runtime.language.block import Block
from aloft.runtime.language.errors import AloftError
from aloft.runtime.loading import checked_text
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.run_control import RunControl, refusal_of
from aloft.runtime.running.run_result import RunResult

GRAPH = """
rate: 100 Hz
duration: 3 s
blocks:
  noise: {use: blocks.WhiteNoise, with: {n: 3, seed: 4}}
  gain: {use: blocks.Gain, with: {n: 3, gain: 2}, in: {u: noise.y}}
  sum: {use: blocks.Integrator, with: {n: 3}, in: {u: gain.y}}
"""


class Running:
    """A run in a thread, which begins paused and waits at its end."""

    def __init__(self, text: str = GRAPH, sinks: Any = (), **options: Any) -> None:
        self.control = RunControl(**{"paused": True, **options})
        self.bound = BoundGraph(checked_text(text, "graph.yaml"))
        self._executor = Executor(self.bound, sinks=[*sinks, self.control], plain=True)
        self._results: list[RunResult] = []
        self._thread = threading.Thread(target=lambda: self._results.append(self._executor.run()))
        self._thread.start()

    def wait(self, holds: Callable[[dict[str, Any]], Any] = lambda about: about["paused"]) -> Any:
        """What the control says once it is so; by default once the run stands still."""
        end = time.monotonic() + 60.0
        while True:
            if not self.control.refusal and holds(about := self.control.about()):
                return about
            assert time.monotonic() < end
            time.sleep(0.005)

    def go(self, ticks: int | None = None) -> Any:
        """Go on, and wait until it is paused again or waits at its end."""
        self.wait()
        self.control.go_on(ticks)
        return self.wait()

    def set(self, *settings: str) -> None:
        """Change parameters."""
        self.bound.parameters.submit(adjust(self.bound.blocks, settings))

    def end(self) -> RunResult:
        """Let the run end, from its end or before."""
        about = {} if self.control.refusal else self.control.about()
        if about.get("over") and about["paused"]:
            self.control.go_on()
        elif not about.get("over"):
            self.bound.clock.stop_reason = "the test is over"
        self._thread.join(60.0)
        assert not self._thread.is_alive()
        return self._results[0]


@contextmanager
def running(
    text: str = GRAPH, sinks: Any = (), *, stands: bool = True, **options: Any
) -> Iterator[Running]:
    run = Running(text, sinks, **options)
    try:
        run.wait(lambda about: about["paused"] or not stands)
        yield run
    finally:
        run.end()


def uninterrupted(text: str = GRAPH) -> RunResult:
    return Executor(checked_text(text, "graph.yaml"), plain=True).run()


def test_a_run_that_goes_back_and_changes_nothing_has_the_same_bytes() -> None:
    whole = uninterrupted()
    with running() as run:
        assert run.wait()["tick"] == 0, "it begins paused"
        assert run.go(130)["tick"] == 130
        assert run.wait()["kept"] == [0, 50, 100, 130]
        assert run.control.go_back(120) == 100
        assert run.wait()["kept"] == [0, 50, 100], "what came later never was"
        assert run.go()["over"] == "the duration is over", "it waits at its end"
        assert run.control.go_back(10) == 0
        run.go()
        result = run.end()
    assert result.run_hash == whole.run_hash
    assert result.log is not None and whole.log is not None
    assert result.log.ticks == whole.log.ticks
    assert np.array_equal(result.log.rows(), whole.log.rows())
    assert (result.ticks, result.success, result.reason) == (300, True, "ran to its end")
    lives = [note.text for note in result.log.notes if note.kind == "life"]
    assert "goes back to tick 100 (1.000 s)" in lives and lives.count("paused") == 4


def test_parameters_go_back_too_and_a_change_makes_another_course() -> None:
    whole = uninterrupted()
    with running() as run:
        run.go(60)
        run.set("gain.gain=5")
        run.go(60)
        assert run.bound.blocks["gain"].params.gain == 5.0  # type: ignore[attr-defined]
        run.control.go_back(70)
        assert run.bound.blocks["gain"].params.gain == 2.0, "it was changed at tick 60"  # type: ignore[attr-defined]
        assert run.control.about()["tick"] == 60, "where it was paused a snapshot was kept"
        assert run.bound.parameters.changes == []
        run.set("gain.gain=3")
        run.go()
        result = run.end()
    assert [(c.tick, c.path, c.new) for c in result.parameter_changes] == [(60, "gain.gain", 3.0)]
    assert result.run_hash != whole.run_hash
    assert np.array_equal(result.signal("sum.y.value")[:60], whole.signal("sum.y.value")[:60])
    assert np.array_equal(
        result.signal("gain.y.value")[60:], 1.5 * whole.signal("gain.y.value")[60:]
    )


PACED = GRAPH.replace("duration: 3 s\n", "clock: {kind: paced}\n")


def test_a_run_that_goes_on_is_paused_by_going_back() -> None:
    with running(PACED, paused=False, interval=0.05, stands=False) as run:
        assert not run.control.about()["paused"]
        run.wait(lambda about: about["tick"] > 12)
        assert run.control.go_back(11) == 10
        about = run.wait()
        assert (about["tick"], about["kept"]) == (10, [0, 5, 10])
        time.sleep(0.05)
        assert run.control.about()["tick"] == 10, "it stands still"
        run.control.go_on()
        run.wait(lambda about: about["tick"] > 12 and not about["paused"])
        run.control.pause()
        run.wait()
        result = run.end()
    assert result.reason == "the test is over", "also where it is paused"


def test_the_oldest_snapshots_make_room() -> None:
    with running(interval=0.1, most=3) as run:
        run.go(75)
        assert run.wait() == {
            "paused": True, "tick": 75, "kept": [0, 60, 70, 75], "room": 4, "interval": 10,
            "over": "", "problem": "", "percent": 100,
        }  # fmt: skip
        assert run.control.go_back(59) == 0, "the start is always there"
        run.go(25)
        assert run.wait()["kept"] == [0, 10, 20, 25]
        run.go()
        assert run.end().run_hash == uninterrupted().run_hash


class Stops(Block):
    """Asks for the end at tick 80."""

    def step(self) -> None:
        if self.tick == 80:
            self.request_stop("the robot fell")


STOPS = GRAPH + f"  stops: {{use: {__name__}:Stops}}\n"


def test_a_run_that_a_block_ends_waits_and_goes_back() -> None:
    with running(STOPS) as run:
        assert run.go()["over"] == "the robot fell"
        run.control.go_back(50)
        assert run.wait()["over"] == ""
        assert run.go()["over"] == "the robot fell"
        run.control.go_on()
        result = run.end()
    assert (result.ticks, result.reason) == (81, "the robot fell")
    assert result.run_hash == uninterrupted(STOPS).run_hash


def test_without_pauses_the_run_is_what_it_was() -> None:
    control = RunControl()
    graph = checked_text(GRAPH, "graph.yaml")
    result = Executor(graph, sinks=[control], plain=True).run()
    assert result.run_hash == uninterrupted().run_hash
    with pytest.raises(AloftError, match="the run has ended"):
        control.pause()


def test_a_playback_rate_changes_no_byte() -> None:
    whole = uninterrupted()
    with running(GRAPH.replace("duration: 3 s", "duration: 3 s\nclock: {kind: paced}")) as run:
        run.control.play(1000)
        assert run.control.about()["percent"] == 1000
        run.go()
        for percent in (0, 1001):
            with pytest.raises(AloftError, match=f"1 to 1000 % of real time, not {percent}"):
                run.control.play(percent)
        assert run.end().run_hash == whole.run_hash
    with running() as run, pytest.raises(AloftError, match=r"--set clock\.kind=paced"):
        run.control.play(50)


def test_what_is_refused() -> None:
    with pytest.raises(AloftError, match="the run has not started yet"):
        RunControl().about()
    with running() as run:
        with pytest.raises(AloftError, match="goes on for at least 1 tick, not 0"):
            run.control.go_on(0)
        with pytest.raises(AloftError, match=r"no snapshot of tick -1 or before is kept; the earliest "
                           r"is of tick 0 \(0\.000 s\)"):  # fmt: skip
            run.control.go_back(-1)
    with (
        running(PACED, paused=False, stands=False) as run,
        pytest.raises(AloftError, match="the run is not paused"),
    ):
        run.control.go_on()


class Outside(Block):
    """Meets the real world."""

    outside = "real"

    def step(self) -> None: ...


class Drives(Block):
    """Drives the clock."""

    def step(self) -> None: ...

    def wait(self) -> int:
        return 0


def test_runs_that_are_not_paused() -> None:
    def refusal(text: str, kind: str = "free", machine: str = "") -> str:
        bound = BoundGraph(checked_text(text, "graph.yaml"))
        bound.clock.kind = kind
        bound.machine = machine
        return refusal_of(bound)

    assert refusal(GRAPH) == refusal(GRAPH, "paced") == ""
    assert refusal(GRAPH, machine="onboard") == (
        "this run cannot be paused: it is the part on onboard of a graph on several machines; run the "
        "graph in one process"
    )
    assert refusal(GRAPH + f"  motors: {{use: {__name__}:Outside}}\n") == (
        f"this run cannot be paused: motors ({__name__}:Outside) meets the real world, which does not "
        "wait; only a simulation can be paused"
    )
    assert refusal(GRAPH, "robot") == (
        "this run cannot be paused: its clock is the robot's; only a run with clock.kind 'free' or "
        "'paced' can be"
    )


def test_a_real_robot_keeps_nothing_and_runs_as_before() -> None:
    text = f"rate: 10 Hz\nduration: 1 s\nblocks: {{motors: {{use: {__name__}:Outside}}}}\n"
    control = RunControl()
    assert Executor(checked_text(text, "graph.yaml"), sinks=[control], plain=True).run().ticks == 10
    with pytest.raises(AloftError, match="meets the real world"):
        control.pause()
    result = Executor(checked_text(text, "graph.yaml"), sinks=[RunControl(paused=True)]).run()
    assert not result.success and "motors" in result.reason and result.ticks == 0


class Fails(Block):
    """Cannot say what it remembers, once it has run."""

    def step(self) -> None: ...

    def save_state(self) -> None:
        if self.tick:
            raise OSError("no room")


def test_a_block_whose_state_cannot_be_saved() -> None:
    with running(GRAPH + f"  fails: {{use: {__name__}:Fails}}\n", interval=0.1) as run:
        about = run.go()
        assert (
            about["kept"] == [0] and about["problem"] == "saving a state failed: OSError: no room"
        )
        assert run.control.go_back(200) == 0
        run.go()
        assert run.end().ticks == 300


@pytest.mark.long
def test_each_course_is_a_recording_that_replays(tmp_path: Path) -> None:
    file = tmp_path / "graph.yaml"
    file.write_text(GRAPH)
    recorder = Recorder(tmp_path / "run.rrd", flush_period=0.01)
    with running(sinks=[recorder]) as run:
        run.go(20)
        run.set("gain.gain=4")
        run.go(130)
        run.set("gain.gain=7")
        run.go(10)
        run.control.go_back(100)
        run.set("gain.gain=5")
        run.go(60)
        run.control.go_back(0)
        run.go()
        result = run.end()
    assert (recorder.warnings, recorder.problem, recorder.missing) == ([], "", 0)
    names = ["run.rrd", "run-part002.rrd", "run-part003.rrd"]
    assert [file.name for file in recorder.files] == names
    opened = [OpenedRun.of(file) for file in recorder.files]
    ticks = [(int(each.ticks[0]), int(each.ticks[-1])) for each in opened]
    assert ticks == [(0, 159), (100, 159), (0, 299)]
    assert [[(c.tick, c.new) for c in each.changes] for each in opened] == [
        [(20, 4.0), (150, 7.0)], [(20, 4.0), (100, 5.0)], [],
    ]  # fmt: skip
    reasons = [(each.file.outcome or {})["reason"] for each in opened]
    assert reasons == [
        "the run went back to tick 100 and goes on in run-part002.rrd",
        "the run went back to tick 0 and goes on in run-part003.rrd",
        "ran to its end",
    ]
    assert all(each.file.whole and each.file.missing_ticks == 0 for each in opened)
    for each in opened:
        done = replay(each)
        assert done.identical and done.first_tick == each.ticks[0], done.first or done.notes
    assert read(recorder.files[-1]).outcome["run_hash"] == result.run_hash  # type: ignore[index]
    assert result.run_hash == uninterrupted().run_hash


@pytest.mark.long
def test_a_recorder_that_takes_nothing_any_more_records_no_tick_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = Recorder(tmp_path / "run.rrd", flush_period=0.01)
    with running(sinks=[recorder]) as run:
        run.go(60)
        recorder._write = lambda kind, tick, data: False
        monkeypatch.setattr(recorder, "_waiting_helps", lambda: False)
        run.control.go_back(50)
        monkeypatch.undo()
        run.go()
        run.end()
    assert recorder.warnings[0] == "nothing is recorded after the run has gone back to tick 50"
    assert list(read(tmp_path / "run.rrd").ticks) == list(range(60))
    assert recorder.dropped == 250
