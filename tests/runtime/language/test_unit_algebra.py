"""Products, quotients and roots of units: their meaning and their text."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.runtime.language.errors import UnitError
from aloft.runtime.language.unit_algebra import ONE, over, read_unit, root, times
from aloft.runtime.language.units import Unit, known_symbols, parse_unit

SYMBOLS = st.sampled_from(known_symbols())
FACTORS = st.lists(st.tuples(SYMBOLS, st.integers(-3, 3).filter(bool)), max_size=4)


def unit_of(factors: list[tuple[str, int]]) -> Unit:
    return parse_unit(" ".join(f"{symbol}^{power}" for symbol, power in factors))


UNITS = FACTORS.map(unit_of)


@given(UNITS, UNITS)
def test_a_product_has_the_exponents_and_scale_of_both(a: Unit, b: Unit) -> None:
    found = times(a, b)
    assert found.exponents == tuple(x + y for x, y in zip(a.exponents, b.exponents, strict=True))
    assert found.scale == pytest.approx(a.scale * b.scale, rel=1e-9)


@given(UNITS, UNITS)
def test_a_quotient_undoes_a_product(a: Unit, b: Unit) -> None:
    assert over(times(a, b), b).matches(a)


@given(UNITS)
def test_a_root_undoes_a_square(a: Unit) -> None:
    assert root(times(a, a)).matches(a)


@given(UNITS, UNITS)
def test_the_text_can_be_read_back(a: Unit, b: Unit) -> None:
    found = times(a, b)
    assert parse_unit(found.text).matches(found)


@pytest.mark.parametrize(
    ("a", "b", "text"),
    [
        ("N m/rad", "rad", "N m"),
        ("m/s^2", "s", "m/s"),
        ("m", "s^-1", "m/s"),
        ("", "1/s", "1/s"),
        ("m", "1/m", "1"),
        ("kg/(m s)", "s", "kg/m"),
        ("N", "1/kg", "m/s^2"),
        ("N s/kg", "s", "m"),
        ("N s/m", "1", "N s/m"),
    ],
)
def test_texts_are_those_that_people_write(a: str, b: str, text: str) -> None:
    assert str(times(parse_unit(a), parse_unit(b))) == text


def test_roots_of_derived_units_are_in_base_units() -> None:
    assert str(root(parse_unit("J/kg"))) == "m/s"


@pytest.mark.parametrize("text", ["m", "m^3", "mm kg", "kN m/kg"])
def test_what_has_no_root(text: str) -> None:
    with pytest.raises(UnitError, match=r"the square root of .* has no unit"):
        root(parse_unit(text))


def test_unchecked_is_said_by_its_own_word() -> None:
    assert read_unit("unchecked") is None
    assert read_unit("") == ONE
    with pytest.raises(UnitError, match="unknown symbol 'uncheked'"):
        read_unit("uncheked")
