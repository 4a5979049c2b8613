"""Whatever ends a run, stop cycles come last, then close; and the result says what happened."""

from typing import Any

import numpy as np
import pytest

from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import STOP_CYCLES, Block, Input, Output
from aloft.runtime.language.errors import AloftError, BlockError, ExitCode, RunError
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.running.executor import Executor, run
from aloft.runtime.running.life_cycle import LifeCycle, LifeState
from aloft.runtime.running.sink import Sink
from aloft.runtime.testing.graphs import BlockUse, checked_graph

CALLS: list[str] = []


class Robot(Block):
    """Writes down what is called, and fails where it is told to."""

    class Params(Parameters):
        n: int = 2
        fail_in: str = ""
        fail_at: int = 812
        failure: str = "value"

    u = Input(Vector, default={}, text="command")
    y = Output(Vector, text="reading")

    def _call(self, what: str) -> None:
        CALLS.append(f"{self.context.path} {what}")
        ticking = what in ("emit", "update")
        if what == self.params.fail_in and (not ticking or self.tick == self.params.fail_at):
            if self.params.failure == "nan":
                self.y.value[1] = np.nan
                return
            raise {
                "value": ValueError("no such joint"),
                "block": BlockError("the battery is empty"),
                "keyboard": KeyboardInterrupt(),
                "exit": SystemExit(5),
            }[self.params.failure]

    def start(self) -> None:
        self._call("start")

    def emit(self) -> None:
        self._call("emit")

    def update(self) -> None:
        self._call("update")

    def stop_cycle(self) -> None:
        self._call("stop_cycle")

    def close(self) -> None:
        self._call("close")


def run_robot(ticks: int = 900, **params: Any) -> Any:
    CALLS.clear()
    graph = checked_graph(
        {"arm/robot": BlockUse(Robot, params), "other": BlockUse(Robot)}, ticks=ticks
    )
    return run(graph, log=False)


def last_calls() -> list[str]:
    """What was called after the last tick."""
    ticking = [i for i, call in enumerate(CALLS) if call.endswith(("emit", "update", "start"))]
    return CALLS[ticking[-1] + 1 :]


ALL_STOPPED = ["arm/robot stop_cycle", "other stop_cycle"] * STOP_CYCLES + [
    "arm/robot close",
    "other close",
]


def test_a_run_that_ends_by_itself_is_stopped_and_closed() -> None:
    result = run_robot(ticks=3)
    assert result.success
    assert CALLS[:2] == ["arm/robot start", "other start"]
    assert last_calls() == ALL_STOPPED
    assert STOP_CYCLES >= 5


@pytest.mark.parametrize(
    ("params", "text"),
    [
        (
            {"fail_in": "emit"},
            "block 'arm/robot' failed at tick 812 (1.624 s): ValueError: no such joint",
        ),
        (
            {"fail_in": "update", "fail_at": 7},
            "block 'arm/robot' failed at tick 7 (0.014 s): ValueError: no such joint",
        ),
        (
            {"fail_in": "emit", "failure": "block"},
            "block 'arm/robot' failed at tick 812 (1.624 s): the battery is empty",
        ),
        (
            {"fail_in": "emit", "failure": "nan"},
            (
                "block 'arm/robot' wrote a value that is not finite at tick 812 (1.624 s): "
                "arm/robot.y.value[1] is nan"
            ),
        ),
        (
            {"fail_in": "emit", "failure": "exit"},
            "block 'arm/robot' failed at tick 812 (1.624 s): SystemExit: 5",
        ),
        ({"fail_in": "start"}, "block 'arm/robot' failed in start: ValueError: no such joint"),
    ],
)
def test_a_failure_is_told_and_everything_stopped(params: dict[str, Any], text: str) -> None:
    result = run_robot(**params)
    assert (result.success, result.reason) == (False, text)
    assert result.exit_code is ExitCode.RUN_FAILED
    assert result.error.block == "arm/robot"
    if params["fail_in"] == "start":
        assert ["arm/robot start", *["arm/robot stop_cycle"] * 5, "arm/robot close"] == CALLS
    else:
        assert result.ticks == result.error.tick == params.get("fail_at", 812)
        assert last_calls() == ALL_STOPPED
    with pytest.raises(RunError) as caught:
        result.raise_if_failed()
    assert str(caught.value) == text


def test_a_keyboard_interrupt_in_a_block_stops_everything() -> None:
    result = run_robot(fail_in="update", failure="keyboard")
    assert (result.success, result.exit_code) == (False, ExitCode.INTERRUPTED)
    assert result.reason == "block 'arm/robot' failed at tick 812 (1.624 s): KeyboardInterrupt"
    assert last_calls() == ALL_STOPPED


@pytest.mark.parametrize("failure", ["value", "keyboard", "exit"])
def test_a_failing_stop_cycle_keeps_nobody_from_theirs(failure: str) -> None:
    result = run_robot(ticks=2, fail_in="stop_cycle", failure=failure)
    assert last_calls() == ALL_STOPPED
    assert len(result.stop_problems) == STOP_CYCLES
    what = {"value": "ValueError: no such joint", "keyboard": "KeyboardInterrupt"}
    text = f"block 'arm/robot' failed in stop cycle 1: {what.get(failure, 'SystemExit: 5')}"
    assert result.stop_problems[0] == text
    assert (result.success, result.reason) == (False, text)
    assert result.exit_code is ExitCode.RUN_FAILED


def test_a_failing_close_keeps_nobody_from_theirs() -> None:
    result = run_robot(ticks=2, fail_in="close")
    assert last_calls() == ALL_STOPPED
    assert result.reason == "block 'arm/robot' failed in close: ValueError: no such joint"


def test_the_tick_that_is_not_finite_is_recorded() -> None:
    CALLS.clear()
    graph = checked_graph(
        {"r": BlockUse(Robot, {"fail_in": "emit", "fail_at": 4, "failure": "nan"})}
    )
    result = run(graph)
    values = result.signal("r.y.value")[:, 1]
    assert values.shape == (5,)
    assert np.isnan(values[4]) and np.isfinite(values[:4]).all()


def test_a_failing_sink_ends_the_run_and_is_closed() -> None:
    class FullDisk(Sink):
        closed = False

        def record(self, tick: int) -> None:
            if tick == 2:
                raise OSError("no space left")

        def close(self) -> None:
            self.closed = True

    CALLS.clear()
    sink = FullDisk()
    result = run(
        checked_graph({"arm/robot": BlockUse(Robot), "other": BlockUse(Robot)}), sinks=[sink]
    )
    assert (
        result.reason == "the runtime (FullDisk) failed at tick 2 (0.004 s): OSError: no space left"
    )
    assert last_calls() == ALL_STOPPED
    assert sink.closed


def test_failing_metrics_are_a_problem_but_hide_no_others() -> None:
    class Scored(Robot):
        def metrics(self) -> dict[str, float]:
            if self.context.path == "arm/robot":
                raise ZeroDivisionError("no samples")
            return {"height_m": 1.0}

    result = run(checked_graph({"arm/robot": BlockUse(Scored), "other": BlockUse(Scored)}, ticks=2))
    assert result.reason == "block 'arm/robot' failed in metrics: ZeroDivisionError: no samples"
    assert result.metrics == {"height_m": 1.0}
    assert not result.success


def test_states_follow_one_another() -> None:
    life = LifeCycle({})
    life.start()
    with pytest.raises(AloftError, match="a graph that is ready cannot become stopped"):
        life.move(LifeState.STOPPED)
    life.move(LifeState.RUNNING)
    with pytest.raises(AloftError, match="a graph that is running cannot be started"):
        life.start()
    life.stop()
    assert life.state is LifeState.STOPPED
    life.stop()
    with pytest.raises(AloftError, match="a graph that is stopped cannot become ready"):
        life.move(LifeState.READY)


def test_the_executor_goes_through_all_states() -> None:
    seen = []

    class Witness(Robot):
        def _call(self, what: str) -> None:
            seen.append(executor.life.state)

    executor = Executor(checked_graph({"w": BlockUse(Witness)}, ticks=1))
    executor.run()
    assert list(dict.fromkeys(seen)) == [LifeState.IDLE, LifeState.RUNNING, LifeState.STOPPING]
    assert executor.life.state is LifeState.STOPPED
