"""Memory: ports are views of one buffer, inputs read-only, unwired ones read their defaults."""

import numpy as np
import pytest

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.sources import Constant
from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Input, Output, State
from aloft.runtime.language.errors import BlockError, DeclarationError, RunError
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Pair(Signal):
    value = Field("n", text="numbers")
    extra = Field(dtype="int64", text="more than a reader of Vector needs")


class Source(Block):
    """Writes a pair."""

    y = Output(Pair, text="the pair")

    def step(self) -> None:
        self.y.value.fill(7.0)
        self.y.extra[()] = 3


class Cramped(Constant):
    def setup(self) -> None:
        raise BlockError("no room for the model")


class Reader(Block):
    """Reads with a default."""

    class Params(Parameters):
        n: int = 2

    u = Input(Vector, default={"value": [1.5, -2.0]}, text="read")
    y = Output(Vector, text="the same")

    def step(self) -> None:
        np.copyto(self.y.value, self.u.value)


class Wide(Signal):
    many = Field("n_private", text="numbers")


class Modeller(Block):
    """Has a state whose size only it knows."""

    y = Output(Vector, text="output")
    memory = State(Wide, text="state")

    @classmethod
    def state_dimensions(cls, params: object, robot: object) -> dict[str, int]:
        return {"n_private": 5}

    def step(self) -> None:
        self.y.value.fill(self.memory.many.size)


def test_a_wired_input_is_a_read_only_view_of_its_source() -> None:
    bound = BoundGraph(
        checked_graph(
            {"a": BlockUse(Source), "b": BlockUse(Reader, {}, {"u": "a.y"})}, dimensions={"n": 2}
        )
    )
    a, b = bound.blocks["a"], bound.blocks["b"]
    assert np.shares_memory(a.y.value, b.u.value)
    assert np.shares_memory(a.y.value, bound.memory.bus.buffer)
    a.step()
    b.step()
    assert b.y.value.tolist() == [7.0, 7.0]
    with pytest.raises(ValueError, match="read-only"):
        b.u.value[0] = 1.0
    assert bound.memory.bus.buffer.ctypes.data % 64 == 0
    assert b.context.wired == ("u",)


def test_an_unwired_input_reads_its_default_from_the_bus() -> None:
    bound = BoundGraph(checked_graph({"b": BlockUse(Reader)}))
    bound.blocks["b"].step()
    assert bound.blocks["b"].y.value.tolist() == [1.5, -2.0]
    assert bound.memory.bus.field("b.u.value").tolist() == [1.5, -2.0]
    assert bound.blocks["b"].context.wired == ()


def test_defaults_of_wrong_name_or_shape_are_errors() -> None:
    class Misnamed(Reader):
        u = Input(Vector, default={"values": 1.0}, text="read")

    class Misshaped(Reader):
        u = Input(Vector, default={"value": [1.0, 2.0, 3.0]}, text="read")

    with pytest.raises(DeclarationError, match=r"default of b.u: Vector has no field 'values'"):
        BoundGraph(checked_graph({"b": BlockUse(Misnamed)}))
    with pytest.raises(
        DeclarationError, match=r"default of b.u.value has shape \(3,\), expected \(2,\)"
    ):
        BoundGraph(checked_graph({"b": BlockUse(Misshaped)}))


def test_state_has_dimensions_of_its_own() -> None:
    bound = BoundGraph(checked_graph({"m": BlockUse(Modeller)}, dimensions={"n": 1}))
    assert bound.memory.state.layout.slots["m.memory.many"].shape == (5,)


def test_a_failing_setup_names_the_block() -> None:
    with pytest.raises(RunError) as caught:
        BoundGraph(checked_graph({"d": BlockUse(Cramped, {"value": [1.0]})}))
    assert str(caught.value) == "block 'd' failed in setup: no room for the model"
    assert caught.value.block == "d"


def test_a_snapshot_of_another_graph_is_refused() -> None:
    one = BoundGraph(checked_graph({"c": BlockUse(Constant, {"value": [1.0]})}))
    other = BoundGraph(
        checked_graph(
            {
                "c": BlockUse(Constant, {"value": [1.0] * 9}),
                "g": BlockUse(Gain, {"n": 9}, {"u": "c.y"}),
            }
        )
    )
    with pytest.raises(ValueError, match="the snapshot has 64 bytes where this graph has 192"):
        other.restore(one.snapshot())
