"""Inputs that the ``emit`` of a Moore block reads are found in its source, and nothing else is."""

import pytest

from aloft.runtime.language.block import Block, Input, Output, State
from aloft.runtime.language.feedthrough import inputs_read_by_emit
from aloft.runtime.language.registry import all_blocks
from aloft.runtime.language.signals import Field, Signal


class Number(Signal):
    value = Field(text="a number")


class Honest(Block):
    """Emits its state."""

    u = Input(Number, text="what is kept")
    push = Input(Number, default={}, text="not read in emit")
    y = Output(Number, text="what was kept")
    x = State(Number, text="what is kept")

    def emit(self) -> None:
        """Names like those of inputs, of something else."""
        record = self.x
        record.push = None  # type: ignore[attr-defined]
        u = self.y.value
        self._write(u)

    def _write(self, u: object) -> None:
        self.y.value[()] = self.x.value

    def update(self) -> None:
        """Reads everything."""
        self.x.value[()] = self.u.value + self.push.value


class Direct(Honest):
    """Emits its input."""

    def emit(self) -> None:
        self.y.value[()] = self.u.value


class ByMethod(Honest):
    """Emits its inputs by way of a method and a property."""

    @property
    def _sum(self) -> float:
        return float(self.push.value) + 1.0

    def emit(self) -> None:
        self._publish()

    def _publish(self) -> None:
        self.y.value[()] = self._sum + self._kept()

    def _kept(this) -> float:
        return float(this.u.value)


class ByParent(Direct):
    """Emits what its parent emits."""

    def emit(self) -> None:
        super().emit()


class Overrides(ByMethod):
    """Its own method takes the place of the one that reads inputs."""

    def _publish(self) -> None:
        self.y.value[()] = self.x.value


class Inside(Honest):
    """A function inside reads the input."""

    def emit(self) -> None:
        self.y.value[()] = max(float(value) for value in (self.u.value, 0.0))


class Mealy(Block):
    """May read what it likes."""

    u = Input(Number, text="a number")
    y = Output(Number, text="the same")

    def step(self) -> None:
        self.y.value[()] = self.u.value


@pytest.mark.parametrize(
    ("block_type", "names"),
    [
        (Honest, ()),
        (Direct, ("u",)),
        (ByMethod, ("u", "push")),
        (ByParent, ("u",)),
        (Overrides, ()),
        (Inside, ("u",)),
        (Mealy, ()),
    ],
)
def test_inputs_are_found(block_type: type[Block], names: tuple[str, ...]) -> None:
    assert sorted(read.name for read in inputs_read_by_emit(block_type)) == sorted(names)


def test_the_place_is_named() -> None:
    (read,) = inputs_read_by_emit(ByParent)
    assert read.method == "Direct.emit" and read.file == __file__
    with open(read.file) as file:
        assert "self.u.value" in file.read().splitlines()[read.line - 1]


def test_no_shipped_block_is_accused() -> None:
    found = {name: inputs_read_by_emit(block) for name, block in all_blocks().items()}
    assert {name: reads for name, reads in found.items() if reads} == {}


def test_a_block_without_source_is_left_alone() -> None:
    names: dict[str, object] = {"Honest": Honest}
    exec("class Made(Honest):\n    def emit(self): self.y.value[()] = self.u.value\n", names)  # noqa: S102
    made = names["Made"]
    assert isinstance(made, type) and inputs_read_by_emit(made) == ()
