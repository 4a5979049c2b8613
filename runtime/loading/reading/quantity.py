"""A positive quantity in a graph file, such as ``rate: 500 Hz``."""

from __future__ import annotations

import math

from ...language.errors import UnitError
from ...language.units import parse_quantity
from ..problems import Code, Problems
from .nodes import Node, ScalarNode, kind


def read_quantity(node: Node, what: str, unit: str, problems: Problems) -> float | None:
    """A positive quantity as a number, or text with a unit."""
    value = node.value if isinstance(node, ScalarNode) else None
    example = {"Hz": "500 Hz", "s": "4 s"}[unit]
    number: float | None = None
    reason = ""
    if isinstance(value, str):
        try:
            number = parse_quantity(value, unit)
        except UnitError as error:
            reason = str(error)
    elif isinstance(value, (int, float)) and not isinstance(value, bool):
        number = float(value) if abs(value) < 1e300 else math.inf
    if number is not None and math.isfinite(number) and number > 0 and number < 1e12:
        return number
    problems.add(
        Code.BAD_VALUE,
        f"{what} cannot be {kind(node)}" + (f": {reason}" if reason else ""),
        node.where,
        at=what,
        expected=f"a positive number in {unit}, such as {example}",
        found=kind(node),
    )
    return None
