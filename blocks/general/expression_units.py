"""The unit of an expression, from those of its variables."""

from __future__ import annotations

import ast
from collections.abc import Mapping

from ...runtime.language.errors import UnitError
from ...runtime.language.unit_algebra import ONE, SECOND, over, root, times
from ...runtime.language.units import Unit, parse_unit

_RAD = parse_unit("rad")
_OF_ANGLES = ("sin", "cos", "tan")
_TO_ANGLES = ("asin", "acos", "atan", "atan2")
_ALIKE = ("min", "max", "hypot", "atan2")
_SAME = ("abs", "floor", "ceil")
TIME = {"t": SECOND}
"""The unit of the variable that every expression has."""


def unit_of(node: ast.expr, units: Mapping[str, Unit | None]) -> Unit | None:
    """The unit of a checked expression; ``None`` where it is not checked.

    ``units`` has those of the variables. Numbers are plain; zero has every unit.

    Raises:
        UnitError: parts that are added or compared differ, or a function does not take a unit.
    """
    match node:
        case ast.Constant(value=value):
            return None if value == 0 else ONE
        case ast.Name(id=name):
            return units.get(name, ONE)
        case ast.UnaryOp(operand=operand):
            return unit_of(operand, units)
        case ast.IfExp(test=test, body=body, orelse=other):
            unit_of(test, units)
            return _alike(body, other, units)
        case ast.Compare(left=left, comparators=[right]):
            _alike(left, right, units)
            return ONE
        case ast.BinOp(left=left, op=ast.Add() | ast.Sub() | ast.Mod(), right=right):
            return _alike(left, right, units)
        case ast.BinOp(left=left, op=ast.Pow(), right=right):
            return _power(left, right, units)
        case ast.BinOp(left=left, op=operator, right=right):
            a, b = _factor(left, units), _factor(right, units)
            if a is None or b is None:
                return None
            return times(a, b) if isinstance(operator, ast.Mult) else over(a, b)
        case ast.Call(func=ast.Name(id=name), args=arguments):
            return _call(name, arguments, units)
        case _:
            raise AssertionError("the expression was not checked")


def _factor(node: ast.expr, units: Mapping[str, Unit | None]) -> Unit | None:
    """The same for a factor, in which zero is as plain as any number."""
    return ONE if isinstance(node, ast.Constant) else unit_of(node, units)


def _alike(left: ast.expr, right: ast.expr, units: Mapping[str, Unit | None]) -> Unit | None:
    a, b = unit_of(left, units), unit_of(right, units)
    if a is not None and b is not None and not a.matches(b):
        raise UnitError(f"{ast.unparse(left)} is in {a} and {ast.unparse(right)} in {b}")
    return b if a is None else a


def _power(base: ast.expr, power: ast.expr, units: Mapping[str, Unit | None]) -> Unit | None:
    unit = unit_of(base, units)
    if unit is None or unit.matches(ONE):
        return unit
    try:
        exponent = ast.literal_eval(power)
    except ValueError:
        exponent = None
    if exponent == 0.5:
        return root(unit)
    if exponent is None or exponent != int(exponent):
        raise UnitError(f"{ast.unparse(base)} is in {unit} and needs a whole number as its power")
    return times(ONE, unit, int(exponent))


def _call(name: str, arguments: list[ast.expr], units: Mapping[str, Unit | None]) -> Unit | None:
    first = arguments[0]
    if name in _ALIKE:
        found = _alike(first, arguments[1], units)
        return _RAD if name in _TO_ANGLES else found
    unit = unit_of(first, units)
    if name in _SAME:
        return unit
    if name == "sqrt":
        return None if unit is None else root(unit)
    if name == "sign":
        return ONE
    taken = (_RAD, ONE) if name in _OF_ANGLES else (ONE,)
    if unit is not None and not any(unit.matches(each) for each in taken):
        raise UnitError(
            f"{name} takes {taken[0] if len(taken) > 1 else 'plain numbers'}, not {unit}"
        )
    return _RAD if name in _TO_ANGLES else ONE
