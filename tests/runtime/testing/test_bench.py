"""The bench: set, step, get, time, snapshots, and mistakes that are told."""

import numpy as np
import pytest

from aloft.blocks.general.arithmetic import Gain
from aloft.blocks.general.integrators_and_delays import UnitDelay
from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Input, Output, State
from aloft.runtime.language.parameters import Parameters, parameter
from aloft.runtime.testing import BlockBench


class Meter(Block):
    """Integrates, and asks to stop above one."""

    class Params(Parameters):
        n: int = parameter(2, text="elements")

    u = Input(Vector, text="rate")
    bias = Input(Vector, default={"value": 0.5}, text="added")
    y = Output(Vector, text="level")
    x = State(Vector, text="level")
    opened = closed = frozen = thawed = 0

    def start(self) -> None:
        self.opened += 1

    def close(self) -> None:
        self.closed += 1

    def save_state(self) -> None:
        self.frozen += 1

    def load_state(self) -> None:
        self.thawed += 1

    def step(self) -> None:
        self.x.value += self.period * (self.u.value + self.bias.value)
        np.copyto(self.y.value, self.x.value)
        if self.y.value[0] > 1.0:
            self.request_stop(f"full at {self.time} s")


def test_inputs_outputs_and_state() -> None:
    bench = BlockBench(Meter, rate=10.0)
    bench.set("u", value=[1.0, 2.0])
    bench.set("bias", value=0.0)
    bench.set("x", value=0.25)
    bench.step()
    assert bench.get("y").value.tolist() == [0.35, 0.45]
    assert bench.get("x").value.tolist() == [0.35, 0.45]
    assert bench.get("u").value.tolist() == [1.0, 2.0]


def test_time_goes_on_and_the_wish_to_stop_is_kept() -> None:
    bench = BlockBench(Meter, rate=10.0)
    bench.set("u", value=1.0)
    bench.set("bias", value=0.0)
    bench.step(10)
    assert (bench.clock.tick, bench.stop_reason) == (10, None)
    bench.step(1)
    assert bench.stop_reason == "full at 1.0 s"


def test_what_is_not_wired_reads_its_default_and_cannot_be_set() -> None:
    bench = BlockBench(Meter, wired=["u"], rate=1.0)
    bench.step()
    assert bench.get("y").value.tolist() == [0.5, 0.5]
    assert bench.block.context.wired == ("u",)
    with pytest.raises(KeyError, match="'bias' cannot be set; there is u, x"):
        bench.set("bias", value=1.0)
    with pytest.raises(KeyError, match="Meter has no input 'v'"):
        BlockBench(Meter, wired=["v"])


def test_a_moore_block_emits_then_updates() -> None:
    bench = BlockBench(UnitDelay, {"initial": 7.0})
    bench.set("u", value=1.0)
    bench.step()
    assert bench.get("y").value.tolist() == [7.0]
    bench.block.emit()
    assert bench.get("y").value.tolist() == [1.0]


def test_snapshots_go_back_in_memory_tick_and_wish_to_stop() -> None:
    bench = BlockBench(Meter, rate=10.0)
    bench.set("u", value=1.0)
    bench.step(3)
    snapshot = bench.snapshot()
    level = bench.get("x").value.tolist()
    bench.step(10)
    assert bench.stop_reason is not None
    bench.restore(snapshot)
    assert (bench.get("x").value.tolist(), bench.clock.tick, bench.stop_reason) == (level, 3, None)
    assert (bench.block.frozen, bench.block.thawed) == (1, 1)


def test_it_starts_and_closes_the_block() -> None:
    with BlockBench(Meter) as bench:
        assert (bench.block.opened, bench.block.closed) == (1, 0)
    assert bench.block.closed == 1


def test_dimensions_of_the_block_win_over_given_ones_and_those_over_the_robots() -> None:
    class Joints(Block):
        """Nothing."""

        y = Output(Vector, text="numbers")

        def step(self) -> None: ...

    assert BlockBench(Meter, {"n": 4}, dimensions={"n": 3}).get("y").value.shape == (4,)
    assert BlockBench(Joints, dimensions={"n": 3}).get("y").value.shape == (3,)
    context = BlockBench(Joints, robot="bruce", dimensions={"n": 3, "n_feet": 4}).block.context
    assert (context.dimensions["n_feet"], context.dimensions["n_joints"]) == (4, 10)


@pytest.mark.parametrize(
    ("port", "fields", "error", "text"),
    [
        ("y", {"value": 1.0}, KeyError, "'y' cannot be set; there is u"),
        ("u", {"values": 1.0}, KeyError, "u has no field 'values'; it has value"),
        ("u", {"value": [1.0, 2.0]}, ValueError, r"u.value has shape \(3,\), not \(2,\)"),
    ],
)
def test_mistakes_are_told(
    port: str, fields: dict[str, object], error: type[Exception], text: str
) -> None:
    bench = BlockBench(Gain, {"n": 3})
    with pytest.raises(error, match=text):
        bench.set(port, **fields)
    with pytest.raises(KeyError, match="Gain has no port 'z'"):
        bench.get("z")
