"""A block's contract as data: what its declarations say, and nothing that is written twice."""

from typing import Literal

import pytest

from aloft.runtime.language.block import Block, Input, Output, State
from aloft.runtime.language.parameters import Parameters, parameter
from aloft.runtime.language.reference import block_reference, type_text
from aloft.runtime.language.signals import Field, Signal


class Length(Signal):
    value = Field("n", unit="m", frame="world", text="how long")


class Spring(Block):
    """A spring, linear::

        f = k x

    Knows no damping.
    """

    class Params(Parameters):
        n: int = parameter(2, ge=1, le=8, text="how many")
        stiffness: float = parameter(unit="N/m", gt=0, text="of each")
        ends: list[str] = parameter(["fixed", "free"], min_length=2, max_length=2, text="kinds")
        law: Literal["linear", "cubic"] = parameter("linear", text="which")

    x = Input(Length, text="its length", default={})
    y = Output(Length, text="what is left", truth=True)
    rest = State(Length, text="its length at rest")

    def emit(self) -> None:
        """Nothing."""

    def update(self) -> None:
        """Nothing."""


def test_ports_and_parameters_are_as_declared() -> None:
    reference = block_reference("blocks.Spring", Spring)
    assert reference.summary == "A spring, linear"
    assert reference.text.endswith("Knows no damping.")
    assert reference.machine == "Moore"
    (x,), (y,), (rest,) = reference.inputs, reference.outputs, reference.states
    assert (x.name, x.signal, x.note) == ("x", "Length", "optional")
    assert x.fields[0].type == "float64[n] m in world"
    assert y.note == "simulation truth"
    assert rest.text == "its length at rest"
    n, stiffness, ends, law = reference.parameters
    assert (n.type, n.default, n.bounds) == ("int", "2", "≥ 1, ≤ 8")
    assert (stiffness.default, stiffness.unit, stiffness.bounds) == ("", "N/m", "> 0")
    assert ends.bounds == "at least 2 long, at most 2 long"
    assert law.type == "'linear' | 'cubic'"
    assert reference.as_json()["inputs"][0]["fields"][0]["text"] == "how long"


@pytest.mark.parametrize(
    ("annotation", "text"),
    [
        (float, "float"),
        (list[float], "list[float]"),
        (tuple[float, ...], "tuple[float, ...]"),
        (float | None, "float | none"),
        (dict[str, list[int]], "dict[str, list[int]]"),
    ],
)
def test_types_are_written_as_one_would(annotation: object, text: str) -> None:
    assert type_text(annotation) == text
