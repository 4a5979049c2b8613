"""A formula of up to eight vectors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from pydantic import field_validator

from ...mathematics.expression import parse_expression
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, Input, Misfit, Output
from ...runtime.language.errors import UnitError
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import Carried, Given, Quantity
from ...runtime.language.unit_algebra import read_unit
from ...runtime.language.units import parse_unit
from .elements import Elements
from .expression_units import TIME, unit_of
from .vector import Vector

INPUTS = ("a", "b", "c", "d", "e", "f", "g", "h")
ABSENT = {"value": 0.0}


class Expression(Block):
    """A formula, element by element, of the inputs a to h, the time t [s] and named constants.

    It may hold numbers, ``+ - * / ** %``, comparisons (1 where they hold, else 0), brackets,
    ``x if condition else y``, ``pi``, and abs, sign, sqrt, exp, log, sin, cos, tan, asin, acos,
    atan, atan2, tanh, floor, ceil, min, max, hypot::

        with: {expression: "k * (a - b) if t > 1 else 0", constants: {k: 2.5}}

    Units are checked in it: ``units: {k: N/m}`` says those of constants, t is in s, and other
    numbers are plain. ``unit: unchecked`` switches this off.

    It is compiled once, never evaluated as Python. Both sides of a choice are computed, so neither
    may be outside a function's domain.
    """

    class Params(Elements):
        expression: str = parameter(text="the formula")
        constants: dict[str, float] = parameter({}, text="numbers by the names the formula has")
        units: dict[str, str] = parameter({}, text="units of constants, by name")
        unit: str | None = parameter(None, text="unit of y, if it is said and not computed")

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
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """The formula must be one."""
        assert isinstance(params, cls.Params)
        for name in params.constants:
            if name in (*INPUTS, "t", "pi") or not name.isidentifier():
                yield Misfit(f"a constant cannot be called {name!r}", "constants")
        for name in params.units:
            if name not in params.constants:
                yield Misfit(
                    f"there is no constant {name!r}",
                    f"units.{name}",
                    expected=", ".join(params.constants) or "constants",
                )
        try:
            parse_expression(params.expression, (*INPUTS, "t", *params.constants))
        except ValueError as error:
            yield Misfit(str(error), "expression", found=params.expression)

    @classmethod
    def requires_of_graph(cls, params: Parameters, context: Context) -> Iterable[Misfit]:
        """Every input that the formula reads must be wired."""
        assert isinstance(params, cls.Params)
        try:
            names = parse_expression(params.expression, (*INPUTS, "t", *params.constants)).names
        except ValueError:
            return  # reported by ``requires``
        for name in names:
            if name in INPUTS and name not in context.wired:
                yield Misfit(f"the formula reads {name!r}, which is not wired", "expression")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The unit of the formula, and the one frame that its inputs have."""
        assert isinstance(params, cls.Params)
        formula = parse_expression(params.expression, (*INPUTS, "t", *params.constants))
        read = {name: given[name] for name in formula.names if name in INPUTS}
        known = {name: quantity for name, quantity in read.items() if quantity is not None}
        frames = dict.fromkeys(q.frame for q in known.values() if q.frame is not None)
        frame = next(iter(frames)) if len(frames) == 1 else None
        said = None if params.unit is None else read_unit(params.unit)
        if params.unit is not None and said is None:
            return {"y": Quantity(None, frame)}
        if len(known) < len(read):
            return {"y": None if params.unit is None else Quantity(said, frame)}
        units = {name: parse_unit(unit) for name, unit in params.units.items()}
        try:
            unit = unit_of(formula.tree, {**{n: q.unit for n, q in known.items()}, **units, **TIME})
        except UnitError as error:
            given.refuse(next(iter(known), "a"), f"in {params.expression!r} {error}")
            return {"y": Quantity(said, frame)}
        if said is not None and unit is not None and not said.matches(unit):
            given.refuse(next(iter(known), "a"), f"the formula is in {unit}, not in {said}")
        return {"y": Quantity(unit if said is None else said, frame)}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """A formula of all inputs."""
        return {
            "n": 2,
            "expression": "k * a - b + e * f if c > d else sin(t) * d + g - h",
            "constants": {"k": 2.0},
        }

    def setup(self) -> None:
        """Compile the formula."""
        p = self.params
        self._time = np.zeros(())
        ports = (self.a, self.b, self.c, self.d, self.e, self.f, self.g, self.h)
        variables = {name: port.value for name, port in zip(INPUTS, ports, strict=True)}
        variables |= {name: np.array(value) for name, value in p.constants.items()}
        variables["t"] = self._time
        self._evaluate = parse_expression(p.expression, variables).compile(variables, p.n)

    def step(self) -> None:
        """Evaluate it."""
        self._time[...] = self.time
        self._evaluate(self.y.value)
