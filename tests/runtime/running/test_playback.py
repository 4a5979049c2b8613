"""Blocks that do not run but write what was recorded."""

import numpy as np
import pytest

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.integrators_and_delays import UnitDelay
from aloft.blocks.general.sources import SineWave
from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Input, Output
from aloft.runtime.language.layout import Layout, PortLayout
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.running.playback import (
    Playback,
    PlaybackBlock,
    playback_block_type,
    playback_graph,
)
from aloft.runtime.running.sink import Sink
from aloft.runtime.testing import BlockUse, checked_graph


class Fragile(Block):
    """A block that cannot even be set up, as a robot that is not there."""

    y = Output(Vector, text="what it says")
    u = Input(Vector, text="what it is told", default={})

    def setup(self) -> None:
        raise AssertionError("must not be set up")

    def step(self) -> None:
        raise AssertionError("must not run")


GRAPH = checked_graph(
    {
        "robot": BlockUse(Fragile),
        "double": BlockUse(Gain, {"gain": 2.0}, {"u": "robot.y"}),
        "late": BlockUse(UnitDelay, {}, {"u": "double.y"}, period_ticks=2),
    },
    dimensions={"n": 1},
)


def test_the_stand_in_has_ports_and_machine_but_no_state() -> None:
    for kind in (Fragile, UnitDelay, SineWave):
        fed = playback_block_type(kind)
        assert issubclass(fed, PlaybackBlock) and fed is playback_block_type(kind)
        assert (fed.inputs, fed.outputs) == (kind.inputs, kind.outputs)
        assert fed.is_moore() == kind.is_moore()
        assert not fed.states


def test_what_is_fed_is_computed_with() -> None:
    bound = BoundGraph(playback_graph(GRAPH, ["robot"]))
    layout = Layout.of(
        [PortLayout("other.y", Vector, {"n": 2}), PortLayout("robot.y", Vector, {"n": 1})]
    )
    feed = Playback(bound, layout)  # a recording with another layout

    class Show(Sink):
        def open(self, bound: BoundGraph) -> None:
            self.record(-1)

        def record(self, tick: int) -> None:
            row = np.zeros(layout.size, np.uint8)
            layout.view(row, "robot.y.value")[...] = tick + 1.0
            first, last = layout.byte_range("robot.y.value")
            row[first:last] = np.array([tick + 1.0]).view(np.uint8)
            feed.show(row)

    result = Executor(bound, sinks=[Show()]).run(6)
    result.raise_if_failed()
    assert feed.paths == ["robot"]
    np.testing.assert_array_equal(result.signal("robot.y.value")[:, 0], np.arange(6.0))
    np.testing.assert_array_equal(result.signal("double.y.value")[:, 0], 2 * np.arange(6.0))
    np.testing.assert_array_equal(result.signal("late.y.value")[:, 0], [0, 0, 0, 0, 4, 4])


def test_a_field_that_was_not_recorded() -> None:
    bound = BoundGraph(playback_graph(GRAPH, ["robot"]))
    with pytest.raises(KeyError, match=r"robot\.y\.value"):
        Playback(bound, Layout.of([PortLayout("robot.z", Vector, {"n": 1})]))
