"""Delays: exact values, all dtypes, initial values and their mistakes."""

import pytest

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.delay import delay_block_type, initial_problems
from aloft.runtime.language.errors import RunError
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.language.stages import Wire
from aloft.runtime.running.executor import run
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing import BlockBench
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Mixed(Signal):
    number = Field(text="the tick")
    pair = Field(2, text="the tick twice")
    count = Field(dtype="int64", text="the tick")
    even = Field(dtype="bool", text="whether it is even")


class Counter(Block):
    """Writes the tick in all dtypes."""

    y = Output(Mixed, text="the tick")

    def step(self) -> None:
        self.y.number[()] = self.tick
        self.y.pair.fill(self.tick)
        self.y.count[()] = self.tick
        self.y.even[()] = self.tick % 2 == 0


class VectorCounter(Block):
    """Writes the tick."""

    y = Output(Vector, text="the tick")

    def step(self) -> None:
        self.y.value.fill(self.tick)


@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize("k", [1, 2, 3])
def test_every_field_comes_k_runs_later(k: int, plain: bool) -> None:
    initial = {"initial": {"number": -1.0, "count": 9}}
    bench = BlockBench(delay_block_type(Mixed, k), initial, plain=plain)
    for tick in range(8):
        bench.set("u", number=tick, pair=[tick, -tick], count=tick, even=tick % 2 == 0)
        bench.step()
        y = bench.get("y")
        past = tick - k
        if past < 0:
            assert (y.number, y.pair.tolist(), y.count, y.even) == (-1.0, [0.0, 0.0], 9, False)
        else:
            assert y.number == past and y.pair.tolist() == [past, -past]
            assert y.count == past and y.even == (past % 2 == 0)


def test_one_type_per_signal_and_length() -> None:
    assert delay_block_type(Mixed, 2) is delay_block_type(Mixed, 2)
    assert delay_block_type(Mixed, 2) is not delay_block_type(Mixed, 3)
    with pytest.raises(ValueError, match="a delay is at least 1 run, not 0"):
        delay_block_type(Mixed, 0)


def test_a_delayed_wire_counts_periods_of_its_source() -> None:
    graph = checked_graph(
        {
            "a": BlockUse(VectorCounter, period_ticks=2, offset_ticks=1),
            "b": BlockUse(Gain, {}, {"u": Wire("a.y", "b.u", delay=2, initial={"value": -5.0})}),
        },
        dimensions={"n": 1},
        ticks=10,
    )
    # the source runs in ticks 1, 3, 5, 7, 9; two of its periods later is four ticks later
    expected = [-5.0, -5.0, -5.0, -5.0, -5.0, 1.0, 1.0, 3.0, 3.0, 5.0]
    assert run(graph).signal("b.y.value")[:, 0].tolist() == expected


def test_initial_values_are_checked() -> None:
    shapes = {"number": (), "pair": (2,)}
    assert initial_problems(shapes, {"number": 1, "pair": [1, 2]}) == []
    assert initial_problems(shapes, {"pear": 1, "pair": [1, 2, 3], "number": "x"}) == [
        "initial: no field 'pear'; there is number, pair",
        "initial.pair has shape (3,), expected (2,) or one number",
        "initial.number: 'x' is not a number or an array of numbers",
    ]
    assert initial_problems(shapes, {"number": float("nan")}) == [
        "initial.number: nan is not finite"
    ]


def test_a_wrong_initial_value_names_the_delay() -> None:
    wire = Wire("a.y", "b.u", delay=1, initial={"value": [1.0, 2.0]})
    graph = checked_graph(
        {"a": BlockUse(VectorCounter), "b": BlockUse(Gain, {}, {"u": wire})}, dimensions={"n": 1}
    )
    with pytest.raises(RunError) as caught:
        BoundGraph(graph)
    assert str(caught.value) == (
        "block 'b/u_delay' failed in setup: initial.value has shape (2,), expected (1,) or one "
        "number"
    )
