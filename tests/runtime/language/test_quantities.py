"""Quantities: products of units, and whether numbers of one may be used as another."""

import pytest

from aloft.runtime.language.quantities import UNCHECKED, Quantity, quantity_of
from aloft.runtime.language.signals import Field
from aloft.runtime.language.units import parse_unit

METRE, SECOND, MM = parse_unit("m"), parse_unit("s"), parse_unit("mm")


def test_products_and_quotients() -> None:
    length = Quantity(METRE, "world")
    assert str(length.times(SECOND)) == "m s in world"
    assert str(length.times(SECOND, -1)) == "m/s in world"
    assert length.times(SECOND, 2).unit is not None
    assert length.times(SECOND).times(SECOND, -1).agrees(length)
    assert length.times(None) == Quantity(None, "world")
    assert UNCHECKED.times(METRE) == UNCHECKED


@pytest.mark.parametrize(
    ("one", "other", "agrees"),
    [
        (Quantity(METRE), Quantity(METRE), True), (Quantity(METRE), Quantity(MM), False),
        (Quantity(METRE), Quantity(SECOND), False), (Quantity(METRE), UNCHECKED, True),
        (Quantity(METRE, "world"), Quantity(METRE, "body"), False),
        (Quantity(METRE, "world"), Quantity(METRE, "world"), True),
        (Quantity(METRE, "world"), Quantity(METRE), True),
        (Quantity(METRE, "world"), Quantity(None, "body"), False),
        (Quantity(METRE, "world"), Quantity(SECOND, "world"), False),
    ],
)  # fmt: skip
def test_what_agrees_does_so_both_ways(one: Quantity, other: Quantity, agrees: bool) -> None:
    assert one.agrees(other) == other.agrees(one) == agrees


def test_quantities_as_text_and_of_fields() -> None:
    assert str(UNCHECKED) == "a unit that is not checked"
    assert str(Quantity(METRE)) == "m"
    field = Field(3, unit="m", frame="world", text="a place")
    assert quantity_of(field) == Quantity(METRE, "world")
