"""Parameters that change while a graph runs: at a tick boundary, all together or not at all."""

import threading

import numpy as np
import pytest

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.sources import SineWave
from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.errors import AloftError, BlockError
from aloft.runtime.language.parameter_change import ParameterChange
from aloft.runtime.language.parameters import Parameters, live_parameter, parameter
from aloft.runtime.loading.checking.parameters import adjust
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.live_parameters import LiveParameters
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.sink import Sink
from aloft.runtime.testing import BlockUse, checked_graph


class Picky(Block):
    """A block that refuses odd values, but only when it derives something from them."""

    class Params(Parameters):
        n: int = parameter(1, text="elements")
        even: int = live_parameter(0, text="an even number")

    params: Params
    y = Output(Vector, text="half of it")

    def prepare(self) -> None:
        if self.params.even % 2:
            raise BlockError(f"{self.params.even} is odd")
        self._half = self.params.even // 2

    def step(self) -> None:
        self.y.value[...] = self._half


def bound() -> BoundGraph:
    return BoundGraph(
        checked_graph(
            {
                "wave": BlockUse(SineWave, {"frequency": 10.0}),
                "gain": BlockUse(Gain, wires={"u": "wave.y"}),
                "picky": BlockUse(Picky),
            }
        )
    )


class ChangeAt(Sink):
    """A sink that changes parameters after a tick, as somebody at the keyboard would."""

    def __init__(self, tick: int, *settings: str) -> None:
        self.tick, self.settings = tick, settings

    def open(self, graph: BoundGraph) -> None:
        self.parameters: LiveParameters = graph.parameters

    def record(self, tick: int) -> None:
        if tick == self.tick:
            self.parameters.requests.append(adjust(self.parameters.blocks, self.settings))


def test_a_change_counts_from_the_next_tick_on_and_is_kept() -> None:
    seen: list[ParameterChange] = []
    graph = bound()
    graph.parameters.listeners.append(seen.append)
    sink = ChangeAt(9, "gain.gain=3", "wave.amplitude=2.0")
    result = Executor(graph, sinks=[sink]).run(20)
    factor = np.full(20, 1.0)
    factor[10:] = 6.0
    pure = Executor(bound()).run(20).signal("wave.y.value")
    np.testing.assert_array_equal(result.signal("gain.y.value")[:, 0], factor * pure[:, 0])
    expected = [
        ParameterChange(10, "gain.gain", 1.0, 3.0),
        ParameterChange(10, "wave.amplitude", 1.0, 2.0),
    ]
    assert seen == expected == list(result.parameter_changes)
    assert result.to_json()["parameter_changes"][0] == {
        "tick": 10, "path": "gain.gain", "old": 1.0, "new": 3.0,
    }  # fmt: skip


def test_a_block_that_refuses_leaves_everything_as_it_was() -> None:
    graph = bound()
    adjustment = adjust(graph.blocks, {"gain.gain": 5.0, "picky.even": 3})
    with pytest.raises(AloftError, match="block 'picky' refuses the change: 3 is odd"):
        graph.parameters.apply(adjustment, 0)
    result = Executor(graph).run(3)
    assert result.parameter_changes == () and result.success
    assert graph.blocks["gain"].params == Gain.Params()
    np.testing.assert_array_equal(result.signal("gain.y.value"), result.signal("wave.y.value"))


def test_another_thread_submits_while_the_graph_runs() -> None:
    graph = bound()
    answers: list[str] = []

    def submit() -> None:
        adjustment = adjust(graph.blocks, ["picky.even=4"])
        graph.parameters.submit(adjustment)
        answers.append(f"taken over at tick {adjustment.tick}")
        try:
            graph.parameters.submit(adjust(graph.blocks, ["picky.even=5"]))
        except AloftError as error:
            answers.append(str(error))
        graph.clock.stop_reason = "changed enough"

    thread = threading.Thread(target=submit)
    thread.start()
    result = Executor(graph, log=False).run()  # until the thread stops it
    thread.join()
    (change,) = result.parameter_changes
    assert answers == [
        f"taken over at tick {change.tick}", "block 'picky' refuses the change: 5 is odd",
    ]  # fmt: skip
    assert graph.blocks["picky"].y.value[0] == 2.0


def test_without_a_tick_a_change_is_withdrawn() -> None:
    parameters = bound().parameters
    with pytest.raises(AloftError, match=r"no tick came within 0\.01 s; nothing was changed"):
        parameters.submit(adjust(parameters.blocks, ["gain.gain=2"]), timeout=0.01)
    assert not parameters.requests
    parameters.requests.append(adjust(parameters.blocks, ["gain.gain=2"]))
    with pytest.raises(AloftError, match="another change is waiting"):
        parameters.submit(adjust(parameters.blocks, ["gain.gain=3"]))
