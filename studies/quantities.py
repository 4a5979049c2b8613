"""Numbers with units as they are written in study files: axes, ranges, filters."""

from __future__ import annotations

import re
from typing import Any

from ..runtime.language.errors import UnitError
from ..runtime.language.units import parse_unit

_QUANTITY = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)$")


def quantity(value: Any) -> tuple[float, str] | None:
    """Parse the number and the unit's text of ``15``, ``15 deg`` or ``0.7 N s``; ``None`` for
    others."""
    if isinstance(value, bool) or value is None:
        return None
    if isinstance(value, (int, float)):
        return float(value), ""
    match = _QUANTITY.match(value.strip()) if isinstance(value, str) else None
    if match is None:
        return None
    try:
        parse_unit(match[2])
    except UnitError:
        return None
    return float(match[1]), match[2].strip()


def in_unit(value: Any, unit: str) -> float | None:
    """Convert the quantity to a number in ``unit``; a bare number is taken as is. ``None`` for no
    quantity."""
    found = quantity(value)
    if found is None:
        return None
    number, own = found
    if not own or own == unit:
        return number
    try:
        return number * parse_unit(own).factor_to(parse_unit(unit))
    except UnitError:
        return None


def written(number: float, unit: str) -> Any:
    """Write the quantity as a parameter takes it: a number, or text with its unit."""
    # fifteen digits: sums of steps such as 0.1 come out as they would be written
    plain = float(f"{number:.15g}")
    whole: float | int = int(plain) if plain.is_integer() and abs(plain) < 1e15 else plain
    return f"{whole!r} {unit}" if unit else whole


def column_name(axis: str, unit: str) -> str:
    """Name a column: ``direction`` in ``deg`` is ``direction_deg``; ``m/s`` is ``_m_s``, as in
    metrics."""
    suffix = re.sub(r"[^0-9a-z]+", "_", unit.lower().replace("%", "percent")).strip("_")
    return f"{axis}_{suffix}" if suffix else axis
