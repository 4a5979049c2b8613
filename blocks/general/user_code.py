"""Computations of the graph by a formula, or values from outside."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from pydantic import field_validator

from ...mathematics.arrays import Array1D, Indices1D
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.expression import parse_expression
from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.errors import UnitError
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities, Quantity
from ...runtime.language.unit_algebra import ONE, SECOND, over, read_unit, root, times
from ...runtime.language.units import Unit, parse_unit
from .vectors import (
    InitialValueParameters,
    SourceParameters,
    UnitFromParameters,
    Vector,
    VectorParameters,
)

INPUTS = ("a", "b", "c", "d", "e", "f", "g", "h")
ABSENT = {"value": 0.0}


class Expression(KernelBlock):
    """A formula, element by element, of the inputs a to h, the time t [s] and named constants.

    It may hold numbers, ``+ - * / ** %``, comparisons (1 where they hold, else 0), brackets,
    ``x if condition else y``, ``pi``, and abs, sign, sqrt, exp, log, log10, sin, cos, tan, asin,
    acos, atan, atan2, sinh, cosh, tanh, floor, ceil, round (halves to even), min, max, hypot::

        with: {expression: "k * (a - b) if t > 1 else 0", constants: {k: 2.5}}

    Units are checked in it: ``units: {k: N/m}`` gives those of constants, t is in s, and other
    numbers are plain. ``unit: unchecked`` switches this off.

    It is never evaluated as Python: each operation is a call of a kernel. Both sides of a choice are computed, so neither
    may be outside a function's domain.
    """

    class Params(VectorParameters):
        expression: str = parameter(text="the formula")
        constants: dict[str, float] = parameter({}, text="numbers by the names the formula has")
        units: dict[str, str] = parameter({}, text="units of constants, by name")
        unit: str | None = parameter(None, text="unit of y, if it is given and not computed")

        @field_validator("unit", "units")
        @classmethod
        def _readable(cls, value: Any) -> Any:
            for text in value.values() if isinstance(value, dict) else [value or ""]:
                read_unit(text)
            return value

    params: Params
    a = Input(Vector, text="the variable a", default=ABSENT)
    b = Input(Vector, text="the variable b", default=ABSENT)
    c = Input(Vector, text="the variable c", default=ABSENT)
    d = Input(Vector, text="the variable d", default=ABSENT)
    e = Input(Vector, text="the variable e", default=ABSENT)
    f = Input(Vector, text="the variable f", default=ABSENT)
    g = Input(Vector, text="the variable g", default=ABSENT)
    h = Input(Vector, text="the variable h", default=ABSENT)
    y = Output(Vector, text="the formula's value")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a formula that is none, or reads an input that is not wired."""
        assert isinstance(params, cls.Params)
        for name in params.constants:
            if name in (*INPUTS, "t", "pi") or not name.isidentifier():
                yield UnmetRequirement(f"a constant cannot be called {name!r}", "constants")
        for name in params.units:
            if name not in params.constants:
                yield UnmetRequirement(
                    f"there is no constant {name!r}",
                    f"units.{name}",
                    expected=", ".join(params.constants) or "constants",
                )
        try:
            names = parse_expression(params.expression, (*INPUTS, "t", *params.constants)).names
        except ValueError as error:
            yield UnmetRequirement(str(error), "expression", found=params.expression)
            return
        for name in names:
            if name in INPUTS and name not in context.wired:
                yield UnmetRequirement(
                    f"the formula reads {name!r}, which is not wired", "expression"
                )

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the unit of the formula, and the one frame that its inputs have."""
        assert isinstance(params, cls.Params)
        formula = parse_expression(params.expression, (*INPUTS, "t", *params.constants))
        read = {name: inputs[name] for name in formula.names if name in INPUTS}
        known = {name: quantity for name, quantity in read.items() if quantity is not None}
        frames = dict.fromkeys(q.frame for q in known.values() if q.frame is not None)
        frame = next(iter(frames)) if len(frames) == 1 else None
        said = None if params.unit is None else read_unit(params.unit)
        if params.unit is not None and said is None:
            return {"y": Quantity(None, frame)}
        if len(known) < len(read):
            return {"y": None if params.unit is None else Quantity(said, frame)}
        units = {name: parse_unit(unit) for name, unit in params.units.items()}
        size = max((len(quantity.elements) for quantity in known.values()), default=0) or 1
        found = []
        columns = [quantity.units(size) for quantity in known.values()]
        for given in zip(*columns, strict=False) if columns else [()]:
            try:
                here = dict(zip(known, given, strict=True))
                unit = unit_of(formula.tree, {**here, **units, **TIME})
            except UnitError as error:
                inputs.refuse(next(iter(known), "a"), f"in {params.expression!r} {error}")
                return {"y": Quantity(said, frame)}
            if said is not None and unit is not None and not said.matches(unit):
                inputs.refuse(next(iter(known), "a"), f"the formula is in {unit}, not in {said}")
            found.append(unit if said is None else said)
        return {"y": Quantity.of(found, frame)}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return a formula of all inputs."""
        return {
            "n": 2,
            "expression": "k * a - b + e * f if c > d else sin(t) * d + g - h",
            "constants": {"k": 2.0},
        }

    def setup(self) -> None:
        """Compile the formula."""
        p = self.params
        time = np.zeros(p.n)
        ports = (self.a, self.b, self.c, self.d, self.e, self.f, self.g, self.h)
        variables = {name: port.value for name, port in zip(INPUTS, ports, strict=True)}
        variables |= {name: np.full(p.n, value) for name, value in p.constants.items()}
        variables["t"] = time
        formula = parse_expression(p.expression, variables)
        calls = formula.calls(variables, self.y.value)
        if "t" in formula.names:
            clock = self.context.clock
            calls.insert(0, KernelCall(_write_time, clock.present, clock.base_period, time))
        self.kernel_calls = tuple(calls)


@kernel
def _write_time(tick: Indices1D, base_period: float, time: Array1D) -> None:
    """Write the seconds since the run began into each element."""
    time[:] = base_period * tick[0]


_RAD = parse_unit("rad")
_TO_ANGLES = ("asin", "acos", "atan", "atan2")
_ALIKE = ("min", "max", "hypot", "atan2")
_SAME = ("abs", "floor", "ceil", "round")
_OF_ANGLES = ("sin", "cos", "tan")
TIME = {"t": SECOND}
"""The unit of the variable that every expression has."""


def unit_of(node: ast.expr, units: Mapping[str, Unit | None]) -> Unit | None:
    """Return the unit of a checked expression; ``None`` where it is not checked.

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
    """Return the same as ``unit_of`` for a factor, in which zero is as plain as any number."""
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


class External(UnitFromParameters, Block):
    """A vector that Python sets between two ticks: ``run["action"] = [0.1, 0.2]``.

    It holds what was set last, and ``initial`` before. See ``aloft.Graph.open`` and ``aloft.environments``.
    In a run that nobody steps it is a constant.
    """

    class Params(InitialValueParameters, SourceParameters):
        in_unit = ("initial",)

    params: Params
    y = Output(Vector, text="values that were set last")
    x = State(Vector, text="values that were set last")

    def setup(self) -> None:
        """Begin with the initial value."""
        self.x.value[...] = self.params.initial

    def emit(self) -> None:
        """Write the vector."""
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        """Do nothing: there is no input."""
