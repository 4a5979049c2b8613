"""Physical units as SI exponents and a scale, parsed from text such as ``N m`` or ``rad/s``.

Units are checked when a graph is loaded and not used while it runs. Angles are dimensionless in SI,
but a graph that feeds radians where plain numbers or metres are expected is wrong, so ``rad`` has
an exponent of its own.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from .errors import UnitError

BASE_UNITS = ("m", "kg", "s", "A", "K", "mol", "cd", "rad")
"""The order of the exponents: the seven SI base units and the plane angle."""


@dataclass(frozen=True)
class Unit:
    """A physical unit: ``scale`` times the product of the base units to their ``exponents``.

    ``offset`` is where its zero lies in base units. Only units from outside have one, as degrees Celsius of
    an FMU.
    """

    exponents: tuple[int, ...]
    scale: float
    text: str
    offset: float = 0.0

    def __mul__(self, other: Unit) -> Unit:
        exponents = tuple(a + b for a, b in zip(self.exponents, other.exponents, strict=True))
        return Unit(exponents, self.scale * other.scale, f"{self.text} {other.text}".strip())

    def __pow__(self, power: int) -> Unit:
        return Unit(
            tuple(e * power for e in self.exponents), self.scale**power, f"{self.text}^{power}"
        )

    def same_dimension(self, other: Unit) -> bool:
        """Return whether a value in one unit can be converted to the other."""
        return self.exponents == other.exponents

    def matches(self, other: Unit) -> bool:
        """Return whether a value means the same in both units, with no conversion."""
        same = math.isclose(self.scale, other.scale, rel_tol=1e-12) and self.offset == other.offset
        return same and self.same_dimension(other)

    def factor_to(self, other: Unit) -> float:
        """Return the factor that converts a value in this unit to ``other``.

        Raises:
            UnitError: the two have different dimensions, or zeros.
        """
        if not self.same_dimension(other) or self.offset != other.offset:
            raise UnitError(f"cannot convert {self.text!r} to {other.text!r}")
        return self.scale / other.scale

    def __str__(self) -> str:
        return self.text or "1"


def _base(index: int | None) -> Unit:
    exponents = tuple(1 if k == index else 0 for k in range(len(BASE_UNITS)))
    return Unit(exponents, 1.0, "")


def _derived(scale: float = 1.0, **exponents: int) -> Unit:
    return Unit(tuple(exponents.get(name, 0) for name in BASE_UNITS), scale, "")


_SYMBOLS: dict[str, Unit] = {
    **{name: _base(k) for k, name in enumerate(BASE_UNITS)},
    "1": _base(None),
    "g": _derived(1e-3, kg=1),
    "um": _derived(1e-6, m=1),
    "mm": _derived(1e-3, m=1),
    "cm": _derived(1e-2, m=1),
    "km": _derived(1e3, m=1),
    "ms": _derived(1e-3, s=1),
    "us": _derived(1e-6, s=1),
    "ns": _derived(1e-9, s=1),
    "min": _derived(60.0, s=1),
    "h": _derived(3600.0, s=1),
    "deg": _derived(math.pi / 180, rad=1),
    "mrad": _derived(1e-3, rad=1),
    "rev": _derived(2 * math.pi, rad=1),
    "rpm": _derived(2 * math.pi / 60, rad=1, s=-1),
    "dps": _derived(math.pi / 180, rad=1, s=-1),
    "Hz": _derived(s=-1),
    "kHz": _derived(1e3, s=-1),
    "MHz": _derived(1e6, s=-1),
    "mN": _derived(1e-3, kg=1, m=1, s=-2),
    "N": _derived(kg=1, m=1, s=-2),
    "kN": _derived(1e3, kg=1, m=1, s=-2),
    "Nm": _derived(kg=1, m=2, s=-2),
    "mJ": _derived(1e-3, kg=1, m=2, s=-2),
    "J": _derived(kg=1, m=2, s=-2),
    "kJ": _derived(1e3, kg=1, m=2, s=-2),
    "mW": _derived(1e-3, kg=1, m=2, s=-3),
    "W": _derived(kg=1, m=2, s=-3),
    "kW": _derived(1e3, kg=1, m=2, s=-3),
    "Pa": _derived(kg=1, m=-1, s=-2),
    "kPa": _derived(1e3, kg=1, m=-1, s=-2),
    "MPa": _derived(1e6, kg=1, m=-1, s=-2),
    "mbar": _derived(1e2, kg=1, m=-1, s=-2),
    "bar": _derived(1e5, kg=1, m=-1, s=-2),
    "uV": _derived(1e-6, kg=1, m=2, s=-3, A=-1),
    "mV": _derived(1e-3, kg=1, m=2, s=-3, A=-1),
    "V": _derived(kg=1, m=2, s=-3, A=-1),
    "kV": _derived(1e3, kg=1, m=2, s=-3, A=-1),
    "uA": _derived(1e-6, A=1),
    "mA": _derived(1e-3, A=1),
    "C": _derived(A=1, s=1),
    "mohm": _derived(1e-3, kg=1, m=2, s=-3, A=-2),
    "ohm": _derived(kg=1, m=2, s=-3, A=-2),
    "kohm": _derived(1e3, kg=1, m=2, s=-3, A=-2),
    "uH": _derived(1e-6, kg=1, m=2, s=-2, A=-2),
    "mH": _derived(1e-3, kg=1, m=2, s=-2, A=-2),
    "H": _derived(kg=1, m=2, s=-2, A=-2),
    "nF": _derived(1e-9, kg=-1, m=-2, s=4, A=2),
    "uF": _derived(1e-6, kg=-1, m=-2, s=4, A=2),
    "mF": _derived(1e-3, kg=-1, m=-2, s=4, A=2),
    "F": _derived(kg=-1, m=-2, s=4, A=2),
    "mT": _derived(1e-3, kg=1, s=-2, A=-1),
    "T": _derived(kg=1, s=-2, A=-1),
    "Wb": _derived(kg=1, m=2, s=-2, A=-1),
    "%": _derived(1e-2),
}

CELSIUS = "degC"
"""Temperatures that are given so are converted to kelvin; it has an offset, so it is no unit."""
ICE_POINT = 273.15
"""0 degC in kelvin."""
_MICRO = str.maketrans("\u00b5\u03bc", "uu")
"""Both signs that are written for micro."""

_TOKEN = re.compile(
    r"\s*(?:(?P<symbol>[A-Za-z%]+|1)(?:\s*(?:\^|\*\*)\s*(?P<power>[+-]?\d+))?|(?P<op>[*/·()]))"
)
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
QUANTITY = re.compile(
    rf"^\s*(?P<number>[+-]?{_NUMBER})(?:\s*/\s*(?P<divisor>{_NUMBER}))?\s*(?P<unit>.*)$"
)


@lru_cache(maxsize=512)
def parse_unit(text: str) -> Unit:
    """Return the unit that ``text`` names.

    A space or ``*`` multiplies; ``/`` divides by the single factor or bracket that follows it;
    ``^`` raises to an integer power. The empty text and ``1`` are dimensionless.

    Raises:
        UnitError: the text is not a product of known symbols.
    """
    tokens: list[tuple[str, int] | str] = []
    position = 0
    stripped = text.strip().translate(_MICRO)
    while position < len(stripped):
        match = _TOKEN.match(stripped, position)
        if match is None or match.end() == position:
            raise UnitError(f"cannot read unit {text!r} at {stripped[position:]!r}")
        position = match.end()
        if match["op"]:
            tokens.append("*" if match["op"] == "·" else match["op"])
        else:
            tokens.append((match["symbol"], int(match["power"] or 1)))
    unit, rest = _product(tokens, text)
    if rest:
        raise UnitError(f"cannot read unit {text!r}: unexpected ')'")
    return Unit(unit.exponents, unit.scale, "" if stripped == "1" else stripped)


@lru_cache(maxsize=512)
def symbol_powers(text: str) -> Mapping[str, int]:
    """Return the power of every symbol in a unit's text: ``{"N": 1, "m": 1, "rad": -1}`` for ``N
    m/rad``.

    Raises:
        UnitError: the text is not a product of known symbols.
    """
    parse_unit(text)  # the symbols are known and the brackets in order
    powers: dict[str, int] = {}
    signs = [1]  # of the brackets that are open
    sign = 1
    position = 0
    stripped = text.strip().translate(_MICRO)
    while position < len(stripped):
        match = _TOKEN.match(stripped, position)
        assert match is not None
        position = match.end()
        if match["op"] == "(":
            signs.append(signs[-1] * sign)
        elif match["op"] == ")":
            signs.pop()
        elif match["op"]:
            sign = -1 if match["op"] == "/" else 1
            continue
        elif match["symbol"] != "1":
            power = signs[-1] * sign * int(match["power"] or 1)
            powers[match["symbol"]] = powers.get(match["symbol"], 0) + power
        sign = 1
    return {symbol: power for symbol, power in powers.items() if power}


def _product(
    tokens: list[tuple[str, int] | str], text: str
) -> tuple[Unit, list[tuple[str, int] | str]]:
    """Read factors up to the end or the closing bracket; return the product and what is left."""
    result = _base(None)
    sign = 1
    pending = False  # an operator that still waits for its factor
    while tokens:
        token, tokens = tokens[0], tokens[1:]
        if token == ")":
            if pending:
                raise UnitError(f"cannot read unit {text!r}: nothing behind an operator")
            return result, [token, *tokens]
        if token == "(":
            factor, tokens = _product(tokens, text)
            if not tokens:
                raise UnitError(f"cannot read unit {text!r}: a bracket is not closed")
            tokens = tokens[1:]
        elif isinstance(token, str):
            if pending:
                raise UnitError(f"cannot read unit {text!r}: two operators in a row")
            sign, pending = (-1 if token == "/" else 1), True
            continue
        else:
            symbol, power = token
            if symbol not in _SYMBOLS:
                raise UnitError(_unknown(symbol, text))
            factor = _SYMBOLS[symbol] ** power
        result = result * factor**sign
        sign, pending = 1, False
    if pending:
        raise UnitError(f"cannot read unit {text!r}: nothing behind an operator")
    return result, []


def _unknown(symbol: str, text: str) -> str:
    """Return what is wrong with a symbol that is none."""
    if symbol == CELSIUS:
        return (
            f"{text!r} has an offset: a temperature may be given as 20 {CELSIUS}, and signals, differences "
            "and products of it are in K"
        )
    return f"cannot read unit {text!r}: unknown symbol {symbol!r}; the symbols are " + ", ".join(
        known_symbols()
    )


def unit_in(text: str) -> str:
    """Return the unit that a text such as ``70 N`` is in: K for degrees Celsius, empty for a number
    without one or a text that is no number."""
    match = QUANTITY.match(text)
    found = match["unit"].strip() if match is not None else ""
    return "K" if found == CELSIUS else found


def parse_quantity(text: str, unit: str) -> float:
    """Return the value in ``unit`` of a text such as ``70 N``, ``10 ms``, ``1/3 kHz`` or ``20 degC``.

    A number without a unit is taken as it is.

    Raises:
        UnitError: there is no number, or its unit has another dimension.
    """
    match = QUANTITY.match(text)
    if match is None:
        raise UnitError(f"cannot read {text!r} as a number with a unit")
    number = float(match["number"])
    if match["divisor"]:
        divisor = float(match["divisor"])
        if divisor == 0.0:
            raise UnitError(f"cannot read {text!r}: it divides by zero")
        number /= divisor
    if not match["unit"].strip():
        return number
    if match["unit"].strip() == CELSIUS and parse_unit(unit).matches(_SYMBOLS["K"]):
        return number + ICE_POINT
    found, expected = parse_unit(match["unit"]), parse_unit(unit)
    if not found.same_dimension(expected):
        raise UnitError(f"{text!r} is not in {expected}")
    return number * found.factor_to(expected)


def known_symbols() -> list[str]:
    """Every unit symbol that ``parse_unit`` knows, sorted."""
    return sorted(_SYMBOLS, key=lambda symbol: (symbol.lower(), symbol))
