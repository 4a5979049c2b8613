"""Units: parsing, algebra and conversion."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.runtime.language.errors import UnitError
from aloft.runtime.language.units import known_symbols, parse_quantity, parse_unit

SYMBOLS = known_symbols()
UNITS = st.lists(st.tuples(st.sampled_from(SYMBOLS), st.integers(-3, 3)), min_size=1, max_size=4)


def text_of(factors: list[tuple[str, int]]) -> str:
    return " ".join(f"{symbol}^{power}" for symbol, power in factors)


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("N", "kg m/s^2"),
        ("N m", "kg m^2 s^-2"),
        ("N*m", "J"),
        ("V", "kg m^2/(s^3 A)"),
        ("W", "N m/s"),
        ("ohm", "V/A"),
        ("Pa", "N/m^2"),
        ("m/s/s", "m/s^2"),
        ("m/(s s)", "m/s^2"),
        ("", "1"),
        ("1/s", "Hz"),
        ("N·m", "N m"),
    ],
)
def test_two_texts_of_one_unit_match(left: str, right: str) -> None:
    assert parse_unit(left).matches(parse_unit(right))


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("rad", "1"),
        ("rad/s", "Hz"),
        ("N m", "N/m"),
        ("mm", "m"),
        ("deg", "rad"),
        ("m/s s", "m/s^2"),
    ],
)
def test_different_units_do_not_match(left: str, right: str) -> None:
    assert not parse_unit(left).matches(parse_unit(right))


def test_a_slash_divides_by_one_factor_only() -> None:
    assert parse_unit("m/s kg").exponents == parse_unit("m kg/s").exponents


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("70 N", "N", 70.0),
        ("10 ms", "s", 0.01),
        ("-3.5e-1 mrad", "rad", -3.5e-4),
        ("180 deg", "rad", math.pi),
        ("500 dps", "rad/s", 500 * math.pi / 180),
        ("0.5", "m", 0.5),
        (".5 kN", "N", 500.0),
        ("5 %", "", 0.05),
        ("9 g", "kg", 0.009),
        ("20 degC", "K", 293.15),
        ("12 mV", "V", 0.012),
        ("3 mN m", "Nm", 0.003),
        ("2 kPa", "N/m^2", 2000.0),
        ("1.5 bar", "Pa", 1.5e5),
        ("4 \u00b5m", "m", 4e-6),
        ("8 MHz", "Hz", 8e6),
        ("3 mH", "V s/A", 3e-3),
        ("47 uF", "A s/V", 47e-6),
        ("2 T", "N/A/m", 2.0),
        ("250 mW", "V A", 0.25),
        ("1 kV", "J/C", 1000.0),
    ],
)
def test_quantity(text: str, unit: str, value: float) -> None:
    assert parse_quantity(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "N q",
            f"cannot read unit 'N q': unknown symbol 'q'; the symbols are {', '.join(SYMBOLS)}",
        ),
        (
            "W/degC",
            (
                "'W/degC' has an offset: a temperature may be given as 20 degC, and signals, "
                "differences and products of it are in K"
            ),
        ),
        ("N^^2", "cannot read unit 'N^^2' at '^^2'"),
        ("m/", "cannot read unit 'm/': nothing behind an operator"),
        ("m*/s", "cannot read unit 'm*/s': two operators in a row"),
        ("(m", "cannot read unit '(m': a bracket is not closed"),
        ("m)", "cannot read unit 'm)': unexpected ')'"),
        ("(m/)s", "cannot read unit '(m/)s': nothing behind an operator"),
    ],
)
def test_errors_of_units(text: str, message: str) -> None:
    with pytest.raises(UnitError) as error:
        parse_unit(text)
    assert str(error.value) == message


@pytest.mark.parametrize(
    ("text", "unit", "message"),
    [
        ("fast", "m/s", "cannot read 'fast' as a number with a unit"),
        ("70 N", "m", "'70 N' is not in m"),
        (
            "20 degC",
            "m",
            (
                "'degC' has an offset: a temperature may be given as 20 degC, and signals, "
                "differences and products of it are in K"
            ),
        ),
    ],
)
def test_errors_of_quantities(text: str, unit: str, message: str) -> None:
    with pytest.raises(UnitError) as error:
        parse_quantity(text, unit)
    assert str(error.value) == message


def test_conversion_between_dimensions_is_an_error() -> None:
    with pytest.raises(UnitError, match="cannot convert 'm' to 's'"):
        parse_unit("m").factor_to(parse_unit("s"))


@given(UNITS, UNITS)
def test_exponents_add_under_multiplication(
    left: list[tuple[str, int]], right: list[tuple[str, int]]
) -> None:
    product = parse_unit(text_of(left + right))
    expected = parse_unit(text_of(left)) * parse_unit(text_of(right))
    assert product.exponents == expected.exponents
    assert product.scale == pytest.approx(expected.scale, rel=1e-12)


@given(UNITS, st.floats(1e-6, 1e6))
def test_conversion_there_and_back_is_the_identity(
    factors: list[tuple[str, int]], value: float
) -> None:
    unit = parse_unit(text_of(factors))
    base = parse_unit(text_of([(s, e) for s, e in zip(BASE, unit.exponents, strict=True)]))
    assert value * unit.factor_to(base) * base.factor_to(unit) == pytest.approx(value, rel=1e-12)


BASE = ("m", "kg", "s", "A", "K", "mol", "cd", "rad")


def test_fractions_and_hours() -> None:
    assert parse_quantity("1/3 kHz", "Hz") == pytest.approx(1000.0 / 3.0, rel=1e-15)
    assert parse_quantity("100/3", "Hz") == pytest.approx(100.0 / 3.0, rel=1e-15)
    assert parse_quantity("1 h", "s") == 3600.0
    assert parse_quantity("1 /s", "Hz") == 1.0
    with pytest.raises(UnitError, match="divides by zero"):
        parse_quantity("1/0 kHz", "Hz")


def test_the_page_lists_all_symbols() -> None:
    page = (Path(__file__).parents[3] / "docs" / "graph_files.md").read_text()
    section = page.partition("### Symbols of units")[2].partition("\n\nA parameter")[0]
    table = section.partition("|---|---|")[2]
    listed = [text for text in re.findall(r"`([^`]+)`", table) if " " not in text]
    assert sorted(listed) == sorted(SYMBOLS)


def test_units_with_other_zeros_do_not_match() -> None:
    kelvin = parse_unit("K")
    celsius = replace(kelvin, text="degC", offset=273.15)
    assert not celsius.matches(kelvin) and celsius.matches(celsius)
    with pytest.raises(UnitError, match="cannot convert 'degC' to 'K'"):
        celsius.factor_to(kelvin)
