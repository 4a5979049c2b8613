"""Products and powers of units, written as people write them: ``N m/rad`` times ``rad`` is ``N m``.

Only what is common to the symbols of both is simplified, so ``N`` times ``s`` stays ``N s``, and where the mass
drops out: ``N/kg`` is ``m/s^2``.
"""

from __future__ import annotations

from functools import lru_cache

from .errors import UnitError
from .units import BASE_UNITS, Unit, parse_unit, symbol_powers

ONE = parse_unit("")
"""The unit of plain numbers."""
SECOND = parse_unit("s")


@lru_cache(maxsize=1024)
def times(a: Unit, b: Unit, power: int = 1) -> Unit:
    """Multiply ``a`` by ``b`` to a whole ``power``."""
    powers = dict(symbol_powers(a.text))
    for symbol, exponent in symbol_powers(b.text).items():
        powers[symbol] = powers.get(symbol, 0) + power * exponent
    unit = parse_unit(_text(powers))
    if powers.get("kg") and unit.scale == 1.0:
        text = _in_base_units(unit)
        if "kg" not in symbol_powers(text):
            return parse_unit(text)
    return unit


def over(a: Unit, b: Unit) -> Unit:
    """Divide ``a`` by ``b``."""
    return times(a, b, -1)


@lru_cache(maxsize=256)
def root(unit: Unit) -> Unit:
    """Return the unit whose square is ``unit``.

    Raises:
        UnitError: there is none with whole powers, as for ``m^3``.
    """
    powers = symbol_powers(unit.text)
    if all(power % 2 == 0 for power in powers.values()):
        return parse_unit(_text({symbol: power // 2 for symbol, power in powers.items()}))
    base = symbol_powers(_in_base_units(unit))
    if unit.scale != 1.0 or any(power % 2 for power in base.values()):
        raise UnitError(f"the square root of {unit} has no unit")
    return parse_unit(_text({symbol: power // 2 for symbol, power in base.items()}))


def _in_base_units(unit: Unit) -> str:
    return _text(dict(zip(BASE_UNITS, unit.exponents, strict=True)))


def _text(powers: dict[str, int]) -> str:
    """``{"N": 1, "m": 1, "rad": -1}`` as ``N m/rad``."""
    above = [_power(symbol, power) for symbol, power in powers.items() if power > 0]
    below = [f"/{_power(symbol, -power)}" for symbol, power in powers.items() if power < 0]
    return (" ".join(above) or ("1" if below else "")) + "".join(below)


def _power(symbol: str, power: int) -> str:
    return symbol if power == 1 else f"{symbol}^{power}"


UNCHECKED = "unchecked"
"""Text that a graph writes in place of a unit that is not checked."""


def read_unit(text: str) -> Unit | None:
    """Return the unit that a parameter ``unit`` names; ``None`` for ``unchecked``.

    Raises:
        UnitError: it is neither.
    """
    return None if text.strip() == UNCHECKED else parse_unit(text)
