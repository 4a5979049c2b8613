"""Functions that a kernel may call beside other kernels: Python's ``min`` and ``abs``, ``math``,
and NumPy.

NumPy's functions of elements take numbers, or arrays and at the end the array to write to.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .array_code import FunctionCode
from .failures import Failure
from .llvm_code import BOOL, FLOAT, INT, NOTHING, NotCompilable, Value, join, number

Translation = Callable[[FunctionCode, Sequence[Value]], Value]
"""Writes a call with these arguments, and returns its result."""


def _function(name: str) -> Translation:
    """Return a function of numbers with a fraction, which C's mathematical library or LLVM has."""

    def write(code: FunctionCode, arguments: Sequence[Value]) -> Value:
        operands = [f"double {code.convert(each, FLOAT).parts[0]}" for each in arguments]
        return Value(FLOAT, (code.call(name, "double", *operands),))

    return write


def _checked(name: str, pole: Failure = Failure.OUT_OF_RANGE) -> Translation:
    """Return a function of ``math``, which reports arguments outside of its domain."""
    plain = _function(name)

    def write(code: FunctionCode, arguments: Sequence[Value]) -> Value:
        operands = [code.convert(each, FLOAT) for each in arguments]
        made = plain(code, operands)
        code.in_domain(made, operands, pole)
        return made

    return write


def _root(code: FunctionCode, arguments: Sequence[Value]) -> Value:
    (value,) = (code.convert(each, FLOAT) for each in arguments)
    if value.constant is None or value.constant < 0.0:
        code.fail_if(code.result(f"fcmp olt double {value.parts[0]}, 0.0"), Failure.OUT_OF_DOMAIN)
    return _SAME["sqrt"](code, [value])


def _to_whole(name: str) -> Translation:
    """Return a function that rounds to a whole number in its own way."""
    rounded = _function(name)

    def write(code: FunctionCode, arguments: Sequence[Value]) -> Value:
        (value,) = arguments
        return value if value.kind == "int" else code.convert(rounded(code, [value]), INT)

    return write


def _conversion(kind: Any) -> Translation:
    def write(code: FunctionCode, arguments: Sequence[Value]) -> Value:
        (value,) = arguments
        if value.constant is None and value.kind == kind.kind:
            return value
        return code.convert(value, kind)

    return write


def _extreme(comparison: str) -> Translation:
    """``max`` or ``min`` of several numbers: as in Python, of equal ones the first."""

    def write(code: FunctionCode, arguments: Sequence[Value]) -> Value:
        kind = arguments[0].type
        for each in arguments[1:]:
            kind = join(kind, each.type)
        found, *others = (code.convert(each, kind) for each in arguments)
        for other in others:
            counts = comparison == "Gt" and (found.counts or other.counts)
            found = code.select(code.compare(comparison, other, found), other, found)
            found = replace(found, counts=found.counts or counts)
        return found

    return write


def _absolute(code: FunctionCode, arguments: Sequence[Value]) -> Value:
    (value,) = arguments
    if value.kind == "float":
        return Value(FLOAT, (code.call("llvm.fabs.f64", "double", f"double {value.parts[0]}"),))
    value = code.convert(value, INT)
    below = code.compare("Lt", value, number(0))
    chosen = code.select(below, code.negative(value), value)
    return Value(INT, chosen.parts, counts=True, bits=min(value.bits + 1, 63))


def _length(code: FunctionCode, arguments: Sequence[Value]) -> Value:
    (value,) = arguments
    try:
        return code.size(value, 0)
    except NotCompilable:
        return number(len(value.members))


def _is_nan(code: FunctionCode, arguments: Sequence[Value]) -> Value:
    x = code.convert(arguments[0], FLOAT).parts[0]
    return Value(BOOL, (code.result(f"fcmp uno double {x}, 0.0"),))


def _is_below_infinity(comparison: str) -> Translation:
    def write(code: FunctionCode, arguments: Sequence[Value]) -> Value:
        size = _absolute(code, [code.convert(arguments[0], FLOAT)])
        infinity = number(math.inf).parts[0]
        text = f"fcmp {comparison} double {size.parts[0]}, {infinity}"
        return Value(BOOL, (code.result(text),))

    return write


def _operation(name: str) -> Translation:
    return lambda code, arguments: code.operation(name, *arguments)


_FLOOR, _CEILING = "llvm.floor.f64", "llvm.ceil.f64"
_LLVM = {
    name: f"llvm.{name}.f64"
    for name in ("sqrt", "sin", "cos", "exp", "log", "exp2", "log2", "copysign")
}
_SAME = {name: _function(_LLVM[name]) for name in _LLVM if name != "log2"} | {
    name: _function(name) for name in ("tan", "sinh", "cosh", "tanh", "log10", "log1p", "expm1")
}
_POLE = dict.fromkeys(("log", "log2", "log10", "log1p", "atanh"), Failure.OUT_OF_DOMAIN)
_NEVER = ("tanh", "atan", "atan2", "asinh", "copysign")
_MATH = {
    name: _function(_LLVM.get(name, name)) if name in _NEVER
    else _checked(_LLVM.get(name, name), _POLE.get(name, Failure.OUT_OF_RANGE))
    for name in (
        "sin", "cos", "tan", "exp", "exp2", "log", "log2", "log10", "log1p", "expm1", "sinh", "cosh", "tanh",
        "asin", "acos", "atan", "atan2", "asinh", "acosh", "atanh", "hypot", "fmod", "copysign",
    )
} | {
    "sqrt": _root, "pow": lambda code, arguments: code.operation(
        "Pow", *(code.convert(each, FLOAT) for each in arguments)),
    "fabs": lambda code, arguments: _absolute(code, [code.convert(arguments[0], FLOAT)]),
    "floor": _to_whole(_FLOOR), "ceil": _to_whole(_CEILING),
    "trunc": _to_whole("llvm.trunc.f64"), "isnan": _is_nan, "isinf": _is_below_infinity("oeq"),
    "isfinite": _is_below_infinity("olt"), "radians": lambda code, arguments: code.operation("Mult", arguments[0], number(math.pi / 180.0)),
    "degrees": lambda code, arguments: code.operation("Mult", arguments[0], number(180.0 / math.pi)),
}  # fmt: skip

FUNCTIONS: dict[Any, Translation] = {
    float: _conversion(FLOAT), int: _conversion(INT), bool: _conversion(BOOL),
    max: _extreme("Gt"), min: _extreme("Lt"), abs: _absolute, len: _length,
    round: _to_whole("llvm.rint.f64"),
} | {getattr(math, name): write for name, write in _MATH.items()}  # fmt: skip
"""Translations of calls of Python's own functions, and of those in ``math``."""

ELEMENTWISE: dict[Any, Translation] = {
    getattr(np, name): write for name, write in _SAME.items()
} | {
    np.add: _operation("Add"), np.subtract: _operation("Sub"), np.multiply: _operation("Mult"),
    np.divide: _operation("Div"), np.absolute: _absolute, np.rint: _function("llvm.rint.f64"),
    np.negative: lambda code, arguments: code.negative(*arguments), np.hypot: _function("hypot"),
    np.arctan2: _function("atan2"), np.arctan: _function("atan"), np.arccos: _function("acos"),
    np.arcsin: _function("asin"), np.floor: _function(_FLOOR), np.ceil: _function(_CEILING),
    np.isfinite: _is_below_infinity("olt"), np.isnan: _is_nan, np.isinf: _is_below_infinity("oeq"),
    np.square: lambda code, arguments: code.operation("Mult", arguments[0], arguments[0]),
    np.maximum: _extreme("Gt"), np.minimum: _extreme("Lt"),
}  # fmt: skip
"""Translations of NumPy's functions of elements, for one element."""


def write_elements(code: FunctionCode, function: Any, arguments: Sequence[Value]) -> Value:
    """Write a call of one of NumPy's functions of elements."""
    write = ELEMENTWISE[function]
    if len(arguments) == function.nin:
        return write(code, arguments)
    *operands, out = arguments
    apply(code, out, operands, write)
    return NOTHING


def apply(code: FunctionCode, out: Value, operands: Sequence[Value], write: Translation) -> None:
    """Write to each element of an array what a function makes of those of others, and of numbers."""

    def one(places: list[Value]) -> None:
        values = []
        for each in operands:
            if each.type in (BOOL, INT, FLOAT):
                values.append(each)
                continue
            skipped = len(places) - each.array.dimensions
            if skipped < 0:
                raise NotCompilable("an array of more dimensions than the one that is written")
            values.append(code.element(each, places[skipped:]))
        code.assign(out.array, code.place(out, places), write(code, values))

    code.loop(out.shape, one)


def write_product(code: FunctionCode, arguments: Sequence[Value]) -> Value:
    """``np.dot(a, b, out)``; sums go from the first product to the last."""
    a, b, *out = arguments
    if not out:
        if a.array.dimensions != 1 or b.array.dimensions != 1:
            raise NotCompilable(
                "a product of a matrix needs room: assign it into an array, as in out[:] = R @ v"
            )
        return _sum_of_products(code, a, b, [], [])
    own = a.array.dimensions - 1

    def one(places: list[Value]) -> None:
        total = _sum_of_products(code, a, b, places[:own], places[own:])
        code.assign(out[0].array, code.place(out[0], places), total)

    code.loop(out[0].shape, one)
    return NOTHING


def _sum_of_products(
    code: FunctionCode, a: Value, b: Value, rows: list[Value], columns: list[Value]
) -> Value:
    total = code.variable(FLOAT)
    code.store(number(0.0), total)

    def add(places: list[Value]) -> None:
        terms = code.element(a, [*rows, *places]), code.element(b, [*places, *columns])
        product = code.operation("Mult", *terms)
        code.store(code.operation("Add", code.load(FLOAT, total), product), total)

    code.loop([a.shape[-1]], add)
    return code.load(FLOAT, total)
