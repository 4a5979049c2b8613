"""The units of formulas."""

import pytest

from aloft.blocks.general.expression_units import TIME, unit_of
from aloft.mathematics.expression import parse_expression
from aloft.runtime.language.errors import UnitError
from aloft.runtime.language.units import parse_unit

UNITS = {"a": parse_unit("m"), "b": parse_unit("m/s"), "k": parse_unit("N/m"), **TIME, "u": None}


def unit(text: str) -> str | None:
    found = unit_of(parse_expression(text, UNITS).tree, UNITS)
    return None if found is None else str(found)


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("k * a", "N"),
        ("a + b * t", "m"),
        ("-a / t", "m/s"),
        ("sqrt(a ** 2 + (b * t) ** 2)", "m"),
        ("hypot(a, b * t)", "m"),
        ("atan2(a, b * t)", "rad"),
        ("sin(a / (b * t))", "1"),
        ("a if b > 0 else 0", "m"),
        ("max(a, 0)", "m"),
        ("2 * a", "m"),
        ("1 / t", "1/s"),
        ("a < b * t", "1"),
        ("u + a", "m"),
        ("u * a", None),
        ("exp(2)", "1"),
        ("sign(a)", "1"),
        ("abs(a) % a", "m"),
    ],
)
def test_units_of_formulas(formula: str, expected: str | None) -> None:
    assert unit(formula) == expected


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("a + b", "a is in m and b in m/s"),
        ("a + 1", "a is in m and 1 in 1"),
        ("a > t", "a is in m and t in s"),
        ("exp(a)", "exp takes plain numbers, not m"),
        ("cos(a)", "cos takes rad, not m"),
        ("a ** t", "a is in m and needs a whole number as its power"),
        ("sqrt(a)", "the square root of m has no unit"),
    ],
)
def test_mistakes(formula: str, message: str) -> None:
    with pytest.raises(UnitError, match=message.replace("*", r"\*")):
        unit(formula)
