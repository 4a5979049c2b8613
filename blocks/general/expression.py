"""A formula of up to four vectors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ...mathematics.expression import parse_expression
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, Input, Misfit, Output
from ...runtime.language.parameters import Parameters, parameter
from .elements import Elements
from .vector import Vector

INPUTS = ("a", "b", "c", "d")
ABSENT = {"value": 0.0}


class Expression(Block):
    """A formula, element by element, of the inputs a to d, the time t [s] and named constants.

    It may hold numbers, ``+ - * / ** %``, comparisons (1 where they hold, else 0), brackets,
    ``x if condition else y``, ``pi``, and abs, sign, sqrt, exp, log, sin, cos, tan, asin, acos,
    atan, atan2, tanh, floor, ceil, min, max, hypot::

        with: {expression: "k * (a - b) if t > 1 else 0", constants: {k: 2.5}}

    It is compiled once, never evaluated as Python. Both sides of a choice are computed, so neither
    may be outside a function's domain.
    """

    class Params(Elements):
        expression: str = parameter(text="the formula")
        constants: dict[str, float] = parameter({}, text="numbers by the names the formula has")

    params: Params
    a = Input(Vector, text="the variable a", default=ABSENT)
    b = Input(Vector, text="the variable b", default=ABSENT)
    c = Input(Vector, text="the variable c", default=ABSENT)
    d = Input(Vector, text="the variable d", default=ABSENT)
    y = Output(Vector, text="the formula's value")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """The formula must be one."""
        assert isinstance(params, cls.Params)
        for name in params.constants:
            if name in (*INPUTS, "t", "pi") or not name.isidentifier():
                yield Misfit(f"a constant cannot be called {name!r}", "constants")
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
    def example_parameters(cls) -> Mapping[str, Any]:
        """A formula of all inputs."""
        return {
            "n": 2,
            "expression": "k * a - b if c > d else sin(t) * d",
            "constants": {"k": 2.0},
        }

    def setup(self) -> None:
        """Compile the formula."""
        p = self.params
        self._time = np.zeros(())
        inputs = {"a": self.a, "b": self.b, "c": self.c, "d": self.d}
        variables = {name: signal.value for name, signal in inputs.items()}
        variables |= {name: np.array(value) for name, value in p.constants.items()}
        variables["t"] = self._time
        self._evaluate = parse_expression(p.expression, variables).compile(variables, p.n)

    def step(self) -> None:
        """Evaluate it."""
        self._time[...] = self.time
        self._evaluate(self.y.value)
