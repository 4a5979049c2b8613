"""Steps that name what they take: what is bound, what is refused, and what a live change does."""

import math
from typing import Any, Literal

import numpy as np
import pytest

from aloft.mathematics.kernel import kernel
from aloft.runtime.language.block import Block, Clock, Input, Output, State
from aloft.runtime.language.errors import BlockError, DeclarationError
from aloft.runtime.language.kernel_block import KernelBlock
from aloft.runtime.language.parameter_change import Adjustment
from aloft.runtime.language.parameters import Parameters, live_parameter, parameter
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.language.steps import call_of
from aloft.runtime.running.live_parameters import LiveParameters
from aloft.runtime.running.tick_calls import can_be_chained
from aloft.runtime.testing.bench import BlockBench


class Row(Signal):
    """Some numbers."""

    value = Field("n", text="the numbers")


class Count(Signal):
    """A number of runs."""

    runs = Field(dtype="int64", text="how many")


class LowPass(Block):
    """y' = (u - y) / tau."""

    class Params(Parameters):
        n: int = parameter(2, text="how many numbers")
        cutoff: float = live_parameter(5.0, unit="Hz", gt=0.0, text="the corner frequency")
        start: Literal["zero", "input"] = parameter("zero", text="where it begins")
        limit: int = live_parameter(1000, text="the run that asks for on_event")

    class Constants(Signal):
        """What follows from the corner frequency."""

        alpha = Field(text="share of the old value that stays")

    params: Params
    u = Input(Row, text="what is filtered")
    y = Output(Row, text="the filtered input")
    x = State(Row, text="the filtered input")
    count = State(Count, text="how often it ran")

    def setup(self) -> None:
        self.events: list[int] = []

    def prepare(self) -> None:
        self.constants.alpha = math.exp(-math.tau * self.params.cutoff * self.period)

    @kernel
    @staticmethod
    def step(
        u: Row, y: Row, x: Row, count: Count, constants: Constants, params: Params, clock: Clock
    ) -> bool:
        if params.start == "input" and clock.tick == 0:
            x.value[:] = u.value
        x.value[:] = constants.alpha * x.value + (1.0 - constants.alpha) * u.value
        y.value[:] = x.value
        count.runs += 1
        return count.runs == params.limit

    def on_event(self) -> None:
        self.events.append(int(self.count.runs))


class Held(Block):
    """The input of the last tick, by two named steps in plain Python."""

    u = Input(Row, text="what is held")
    y = Output(Row, text="the last input")
    x = State(Row, text="the last input")

    @staticmethod
    def emit(y: Row, x: Row) -> None:
        y.value[:] = x.value

    @staticmethod
    def update(u: Row, x: Row) -> None:
        x.value[:] = u.value


@pytest.mark.parametrize("plain", [True, False])
def test_a_kernel_step_gets_what_it_names(plain: bool) -> None:
    bench = BlockBench(LowPass, {"limit": 3, "start": "input"}, plain=plain)
    bench.set("u", value=[1.0, -2.0])
    bench.step()
    assert bench.get("y").value.tolist() == [1.0, -2.0]
    bench.set("u", value=[3.0, 0.0])
    bench.step()
    alpha = math.exp(-math.tau * 5.0 / 500.0)
    expected = alpha * np.array([1.0, -2.0]) + (1.0 - alpha) * np.array([3.0, 0.0])
    assert bench.get("y").value.tobytes() == expected.tobytes()
    bench.step(2)
    assert bench.block.events == [3]
    assert bench.get("count").runs[()] == 4


def test_a_live_change_prepares_again() -> None:
    changed = BlockBench(LowPass, {"cutoff": 5.0})
    fresh = BlockBench(LowPass, {"cutoff": 9.0, "limit": 2})
    parameters = LiveParameters({"block": changed.block})
    parameters.apply(Adjustment({"block": fresh.block.params}, ()), 0)
    for bench in (changed, fresh):
        bench.set("u", value=[1.0, 2.0])
        bench.step(2)
    assert changed.get("y").value.tobytes() == fresh.get("y").value.tobytes()
    assert changed.block.events == fresh.block.events == [2]


class OffsetAndScaleParams(Parameters):
    """The parameters of ``OffsetAndScale``."""

    offset: float = live_parameter(1.0, text="is added")
    scale: float = live_parameter(2.0, text="is multiplied by")


@kernel
def write_offset(y: Count, params: OffsetAndScaleParams) -> None:
    """The first of two calls of a block."""
    y.runs = int(params.offset)


@kernel
def multiply_by_scale(y: Count, params: OffsetAndScaleParams) -> None:
    """The second one, with a parameter of its own."""
    y.runs = y.runs * int(params.scale)


class OffsetAndScale(KernelBlock):
    """Two kernels in turn, each with its own parameters."""

    Params = OffsetAndScaleParams
    y = Output(Count, text="offset times scale")

    def setup(self) -> None:
        self.kernel_calls = (call_of(self, write_offset), call_of(self, multiply_by_scale))


def test_a_live_change_reaches_all_calls_of_a_block() -> None:
    bench = BlockBench(OffsetAndScale)
    bench.step()
    assert bench.get("y").runs == 2
    new = bench.block.params.model_copy(update={"offset": 5.0, "scale": 3.0})
    LiveParameters({"block": bench.block}).apply(Adjustment({"block": new}, ()), 1)
    bench.step()
    assert bench.get("y").runs == 15


def test_steps_in_plain_python_have_the_same_signature() -> None:
    bench = BlockBench(Held, dimensions={"n": 2})
    assert Held.is_moore()
    bench.set("u", value=[1.0, 2.0])
    bench.step()
    assert bench.get("y").value.tolist() == [0.0, 0.0]
    bench.step()
    assert bench.get("y").value.tolist() == [1.0, 2.0]


def test_a_wrong_type_is_refused_with_both_lines() -> None:
    with pytest.raises(DeclarationError) as error:

        class Wrong(Block):
            u = Input(Row, text="a row")

            @kernel
            @staticmethod
            def step(u: Count) -> None:
                pass

    text = str(error.value)
    assert "Wrong.step takes u: Count (line " in text
    assert "but Wrong.u is Input(Row) (line " in text and "write u: Row" in text


def test_what_is_not_declared_is_refused() -> None:
    with pytest.raises(
        DeclarationError, match="takes 'w', which is no port or state of it; there is u"
    ):

        class Unknown(Block):
            u = Input(Row, text="a row")

            @kernel
            @staticmethod
            def step(u: Row, w) -> None:  # type: ignore[no-untyped-def]
                pass

    with pytest.raises(
        DeclarationError, match="takes constants, but Without has no class Constants"
    ):

        class Without(Block):
            u = Input(Row, text="a row")

            @kernel
            @staticmethod
            def step(u: Row, constants: Any) -> None:
                pass


def test_what_setup_forgot_is_named() -> None:
    class Forgetful(Block):
        u = Input(Row, text="a row")

        @kernel
        @staticmethod
        def step(u: Row, gain: float) -> None:
            u.value[0] = gain

    with pytest.raises(BlockError, match="takes 'gain', which is no port or state, and setup"):
        BlockBench(Forgetful, dimensions={"n": 2})


class Doubled(LowPass):
    """A step in Python around a kernel."""

    def step(self) -> None:  # type: ignore[override]  # the kernel's arguments are bound by name
        super().step()
        self.y.value[...] *= 2.0


def test_a_step_in_python_may_call_the_kernel_that_it_replaces() -> None:
    whole, base = BlockBench(Doubled), BlockBench(LowPass)
    for bench in (whole, base):
        bench.set("u", value=[1.0, 2.0])
        bench.step()
    assert whole.get("y").value.tolist() == (2.0 * base.get("y").value).tolist()
    assert not can_be_chained(whole.block) and can_be_chained(base.block)
