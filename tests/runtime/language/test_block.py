"""Blocks: what a class declares and what the runtime reads from it."""

import pytest

from aloft.runtime.language.block import Block, Clock, Context, Input, Output, State
from aloft.runtime.language.errors import DeclarationError
from aloft.runtime.language.parameters import Parameters, parameter
from aloft.runtime.language.signals import Field, Signal


class Scalar(Signal):
    """One number."""

    value = Field(unit="m", text="the number")


class Filter(Block):
    """A first-order low-pass filter."""

    class Params(Parameters):
        order: int = parameter(2, text="how many", ge=1)
        fast: bool = parameter(False, text="a switch is no dimension")
        time_constant: float = parameter(0.1, text="of the filter", unit="s", gt=0)

    params: Params
    u = Input(Scalar, text="in")
    bias = Input(Scalar, text="taken off", default={"value": 0.5})
    y = Output(Scalar, text="out")
    x = State(Scalar, text="memory")

    def step(self) -> None:
        self.y.value[()] = self.u.value


class NotchFilter(Filter):
    """Inherits its ports and adds one."""

    depth = Output(Scalar, text="how deep")


def make(block_type: type[Block], tick: int = 0, period: int = 1) -> Block:
    clock = Clock(base_period=0.002, tick=tick)
    return block_type(block_type.Params(), Context("a", clock, period_ticks=period))


def test_ports_by_kind_in_order_of_declaration() -> None:
    assert list(Filter.inputs) == ["u", "bias"]
    assert list(Filter.outputs) == ["y"]
    assert list(Filter.states) == ["x"]
    assert list(NotchFilter.outputs) == ["y", "depth"]


def test_a_default_makes_an_input_optional() -> None:
    assert Filter.bias.optional and not Filter.u.optional


def test_integer_parameters_are_dimensions_of_the_block() -> None:
    assert Filter.dimensions(Filter.Params(order=3), None) == {"order": 3}


def test_time_is_derived_from_the_tick() -> None:
    block = make(Filter, tick=250, period=4)
    assert block.time == pytest.approx(0.5)
    assert block.period == pytest.approx(0.008)
    assert block.tick == 250


def test_the_first_stop_reason_is_kept() -> None:
    block = make(Filter)
    block.request_stop("fell")
    block.request_stop("later")
    assert block.context.clock.stop_reason == "fell"


def test_unbound_port_says_so() -> None:
    with pytest.raises(AttributeError, match=r"Filter\.u is not bound to memory"):
        _ = make(Filter).u  # type: ignore[attr-defined]


class Both(Block):
    """Wrong."""

    def step(self) -> None: ...
    def emit(self) -> None: ...


class Neither(Block):
    """Wrong."""


class Moore(Block):
    """Right."""

    def emit(self) -> None: ...
    def update(self) -> None: ...


def test_machines() -> None:
    assert not Filter.is_moore()
    assert Moore.is_moore()


@pytest.mark.parametrize(("block_type", "found"), [(Both, "step, emit"), (Neither, "none")])
def test_a_block_is_one_machine(block_type: type[Block], found: str) -> None:
    with pytest.raises(DeclarationError) as error:
        block_type.is_moore()
    assert str(error.value) == (
        f"{block_type.__name__} must define either step(), or emit() and update(); "
        f"it defines {found}"
    )


def test_a_port_cannot_hide_a_method() -> None:
    with pytest.raises(DeclarationError, match="Bad: a port cannot be called 'setup'"):
        type("Bad", (Block,), {"setup": Input(Scalar)})


def test_a_port_needs_a_signal_with_fields() -> None:
    with pytest.raises(DeclarationError, match="a port carries a Signal type, not 3"):
        Input(3)  # type: ignore[type-var]
    with pytest.raises(DeclarationError, match="signal Signal has no fields"):
        Output(Signal)


def test_the_tick_of_a_clock_is_where_kernels_read_it() -> None:
    clock = Clock(0.002, 7)
    present = clock.present
    assert present.tolist() == [7]
    clock.tick += 2
    assert clock.present is present and present.tolist() == [9]
    present[0] = 4
    assert clock.tick == 4 and type(clock.tick) is int
