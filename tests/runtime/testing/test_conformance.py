"""The conformance suite finds each broken promise, in the case that is meant to."""

import numpy as np
import pytest

from aloft.blocks.general.vectors import Vector
from aloft.blocks.signals import Phase
from aloft.runtime.language.block import Block, Input, Output, State
from aloft.runtime.language.parameters import Parameters, live_parameter, parameter
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.running.finite import NotFiniteError
from aloft.runtime.testing.conformance import (
    ConformanceError,
    check_block,
    conformance_cases,
    random_value,
)


class Sound(Block):
    """A filter that keeps all promises."""

    class Params(Parameters):
        n: int = parameter(3, text="elements")

    params: Params
    u = Input(Vector, text="input")
    y = Output(Vector, text="output")
    x = State(Vector, text="the last output")

    def setup(self) -> None:
        self.half = np.array(0.5)

    def step(self) -> None:
        np.add(self.u.value, self.x.value, out=self.y.value)
        np.multiply(self.y.value, self.half, out=self.x.value)


class Delay(Block):
    """A delay that keeps all promises."""

    Params = Sound.Params
    u = Input(Vector, text="input")
    y = Output(Vector, text="output")
    x = State(Vector, text="the last input")

    def emit(self) -> None:
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        np.copyto(self.x.value, self.u.value)


def failure(block_type: type[Block], case: str) -> str:
    with pytest.raises((ConformanceError, NotFiniteError)) as caught:
        check_block(block_type, cases=[case])
    return str(caught.value)


@pytest.mark.parametrize("case", conformance_cases())
@pytest.mark.parametrize("block_type", [Sound, Delay])
def test_sound_blocks_pass(block_type: type[Block], case: str) -> None:
    check_block(block_type, cases=[case])


def test_documentation_is_required() -> None:
    class Silent(Sound):
        __doc__ = ""

    class SilentPort(Sound):
        """A block."""

        z = Input(Vector, default={})

    class Bare(Signal):
        value = Field()

    class SilentField(Sound):
        """A block."""

        z = Input(Bare, default={}, text="bare")

    class SilentParameter(Sound):
        """A block."""

        class Params(Sound.Params):
            m: int = 3

    assert failure(Silent, "documented") == "Silent: no docstring"
    assert failure(SilentPort, "documented") == "SilentPort: port 'z' has no text"
    assert failure(SilentField, "documented") == "SilentField: z.value has no text"
    assert failure(SilentParameter, "documented") == "SilentParameter: parameter 'm' has no text"


def test_a_port_that_nothing_uses() -> None:
    class Idle(Sound):
        """A block."""

        extra = Input(Vector, default={}, text="ignored")

    assert failure(Idle, "ports used") == "Idle: port 'extra' is declared, but no method uses it"


def test_an_output_that_is_not_always_written() -> None:
    class Sometimes(Sound):
        """A block."""

        def step(self) -> None:
            if self.tick % 2 == 0:
                super().step()

    class Remembers(Sound):
        """A block."""

        def step(self) -> None:
            np.add(self.y.value, self.u.value, out=self.y.value)

    for block_type in (Sometimes, Remembers):
        assert "output y.value is not written by every run, or depends on what was in it" in (
            failure(block_type, "outputs written")
        )


def test_a_constant_output_may_be_filled_in_setup() -> None:
    class Constant(Sound):
        """A block."""

        label = Output(Vector, text="what does not change")

        def setup(self) -> None:
            super().setup()
            self.label.value[:] = 3.0

    class Forgotten(Sound):
        """A block."""

        label = Output(Vector, text="what nobody writes")

    class Overwritten(Constant):
        """A block."""

        def step(self) -> None:
            super().step()
            if self.tick == 5:
                self.label.value[:] = 4.0

    check_block(Constant, cases=["outputs written"])
    for block_type in (Forgotten, Overwritten):
        assert "output label.value is not written by every run" in (
            failure(block_type, "outputs written")
        )


def test_an_index_beyond_an_array() -> None:
    class Beyond(Sound):
        """A block."""

        def step(self) -> None:
            super().step()
            self.y.value[0] = self.u.value[self.params.n]

    class FromTheEnd(Sound):
        """A block."""

        def step(self) -> None:
            super().step()
            self.y.value[0] = self.u.value[-1]

    text = failure(Beyond, "bounds")
    assert text.startswith("Beyond: index 3 is out of bounds for axis 0 with size 3, in step (")
    assert text.endswith("compiled, it would read or write beyond the array")
    check_block(FromTheEnd, cases=["bounds"])  # the same in both tiers


def test_an_input_that_is_written() -> None:
    class Rude(Sound):
        """A block."""

        def step(self) -> None:
            super().step()
            self.u.value.base[...] = 0.0  # around the read-only view

    assert failure(Rude, "inputs kept") == "Rude: input 'u' was written"


def test_a_moore_block_that_is_none() -> None:
    class Hasty(Delay):
        """A block."""

        def emit(self) -> None:
            np.copyto(self.y.value, self.u.value)

    class Late(Delay):
        """A block."""

        def update(self) -> None:
            super().update()
            np.copyto(self.y.value, self.u.value)

    assert "emit() makes y.value depend on an input" in failure(Hasty, "machine")
    assert failure(Late, "machine") == "Late: update() writes an output"


def test_a_block_that_is_not_deterministic() -> None:
    class Random(Sound):
        """A block."""

        def setup(self) -> None:
            super().setup()
            self.noise = np.random.default_rng().random(3)

        def step(self) -> None:
            np.add(self.u.value, self.noise, out=self.y.value)

    assert failure(Random, "deterministic") == (
        "Random: two instances with equal inputs differ in tick 0"
    )


def test_a_block_that_remembers_in_secret() -> None:
    class Secret(Sound):
        """A block."""

        def setup(self) -> None:
            super().setup()
            self.memory = np.zeros(3)

        def step(self) -> None:
            self.memory += self.u.value
            np.copyto(self.y.value, self.memory)

    class Open(Secret):
        """A block."""

        def save_state(self) -> None:
            np.copyto(self.x.value, self.memory)

        def load_state(self) -> None:
            np.copyto(self.memory, self.x.value)

    assert failure(Secret, "restored") == (
        "Secret: itself, restored from a snapshot, goes on differently 1 ticks later; something "
        "is remembered outside the declared State"
    )
    check_block(Open, cases=["restored"])


def test_a_block_that_does_not_take_over_a_live_parameter() -> None:
    class Tuned(Sound):
        """A block."""

        class Params(Sound.Params):
            gain: float = live_parameter(2.0, text="a factor")

        def setup(self) -> None:
            self.half = np.array(self.params.gain)

    class Fresh(Tuned):
        """A block."""

        def prepare(self) -> None:
            self.half = np.array(self.params.gain)

    class Meddling(Fresh):
        """A block."""

        def prepare(self) -> None:
            super().prepare()
            self.x.value[...] = 0.0

    assert failure(Tuned, "live parameters") == (
        "Tuned: 'gain' is live, but 1 ticks after a change the block differs from one that had "
        "the new value from the start; derive anew in prepare()"
    )
    assert failure(Meddling, "live parameters") == (
        "Meddling: prepare() writes state or outputs, for 'gain'"
    )
    check_block(Fresh, cases=["live parameters"])


def test_a_block_that_allocates() -> None:
    class Wasteful(Sound):
        """A block."""

        def step(self) -> None:
            super().step()
            self.x.value[:] = self.x.value * 2.0 + self.u.value

    class Declared(Wasteful):
        """A block."""

        array_allocations = 2
        allocation_reason = "the library returns new arrays"

    class Unexplained(Declared):
        """A block."""

        allocation_reason = ""

    text = failure(Wasteful, "array allocations")
    assert text.startswith("Wasteful: tick 3 allocates 2 arrays, declared are 0; the first at ")
    assert __file__ in text
    check_block(Declared, cases=["array allocations"])
    assert failure(Unexplained, "array allocations") == (
        "Unexplained: array_allocations without an allocation_reason"
    )


def test_a_block_that_makes_infinity() -> None:
    class Divides(Sound):
        """A block."""

        def step(self) -> None:
            with np.errstate(divide="ignore"):
                np.divide(1.0, np.maximum(self.u.value, 0.0), out=self.y.value)

    assert failure(Divides, "finite").endswith("] is inf")


def test_every_instance_is_closed() -> None:
    opened: list[int] = []

    class Device(Sound):
        """Holds something open."""

        def start(self) -> None:
            opened.append(id(self))

        def close(self) -> None:
            opened.remove(id(self))

    check_block(Device)
    assert not opened

    class Infinite(Device):
        """Fails a check."""

        def step(self) -> None:
            self.y.value[:] = np.inf

    assert failure(Infinite, "finite").endswith("] is inf")
    assert not opened


def test_metrics_that_are_no_plain_values() -> None:
    class Odd(Sound):
        """A block."""

        def metrics(self) -> dict[str, object]:
            return {"values": [1.0]}

    assert failure(Odd, "life") == "Odd: metric 'values' is of type list, not a plain value"


def test_example_inputs_and_parameters_are_used() -> None:
    seen = []

    class Picky(Sound):
        """A block."""

        @classmethod
        def example_parameters(cls) -> dict[str, object]:
            return {"n": 2}

        @classmethod
        def example_inputs(
            cls, rng: np.random.Generator, dimensions: dict[str, int]
        ) -> dict[str, dict[str, object]]:
            return {"u": {"value": np.full(dimensions["n"], 4.0)}}

        def step(self) -> None:
            seen.append(self.u.value.tolist())
            super().step()

    check_block(Picky, cases=["finite"])
    assert seen and all(value == [4.0, 4.0] for value in seen)


def draw(name: str, field: Field, shape: tuple[int, ...]) -> np.ndarray:
    return random_value(name, field, shape, np.random.default_rng(0))


def test_quaternions_have_unit_length() -> None:
    value = draw("base_orientation", Field((5, 4)), (5, 4))
    np.testing.assert_allclose(np.linalg.norm(value, axis=1), 1.0, atol=1e-15)


def test_rotations_are_rotations() -> None:
    value = draw("foot_rotation", Field((5, 3, 3)), (5, 3, 3))
    product = value @ value.transpose(0, 2, 1)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), (5, 3, 3)), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(value), 1.0, atol=1e-15)
    assert not np.allclose(value[0], value[1])


def test_whole_numbers_and_truth_values() -> None:
    phases = draw("phase", Field(100, dtype="int64", values=Phase), (100,))
    assert set(phases.tolist()) == {int(phase) for phase in Phase}
    assert phases.dtype == np.int64
    flags = draw("closed", Field(100, dtype="bool"), (100,))
    assert set(flags.tolist()) == {True, False}


def test_other_floats_are_of_order_one() -> None:
    value = draw("force", Field(100), (100,))
    assert np.abs(value).max() <= 1.0 and np.ptp(value) > 1.0
