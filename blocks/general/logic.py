"""Truth values: comparisons, logic, edges, counters, timers, and a switch."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.quantities import Carried, Given
from ...runtime.language.signals import Field, Signal
from .vectors import NEVER, Flag, Flags, Number, Seconds, Tally, Vector, VectorParameters

UFUNCS: Mapping[str, tuple[Any, bool]] = {
    "and": (np.logical_and, False),
    "or": (np.logical_or, False),
    "xor": (np.logical_xor, False),
    "nand": (np.logical_and, True),
    "nor": (np.logical_or, True),
}
"""The function of each operation, and whether its result is negated."""


class Logic(Block):
    """Element by element: y = a and b, a or b, a xor b, not (a and b), not (a or b)."""

    class Params(VectorParameters):
        operation: Literal["and", "or", "xor", "nand", "nor"] = parameter(
            "and", text="what is done"
        )

    params: Params
    a = Input(Flags, text="the first truth values")
    b = Input(Flags, text="the second truth values")
    y = Output(Flags, text="the result")

    def setup(self) -> None:
        """Choose the operation."""
        self._operation, self._negated = UFUNCS[self.params.operation]

    def step(self) -> None:
        """Combine."""
        self._operation(self.a.value, self.b.value, out=self.y.value)
        if self._negated:
            np.logical_not(self.y.value, out=self.y.value)


COMPARISONS: Mapping[str, Any] = {
    "<": np.less, "<=": np.less_equal, "==": np.equal, "!=": np.not_equal,
    ">=": np.greater_equal, ">": np.greater,
}  # fmt: skip


class Compare(Block):
    """Element by element whether a < b, or another comparison; exact, with no tolerance.

    To compare with a constant, wire the constant: ``in: {a: sensor.y, b: {value: {value: 0.5}}}``.
    """

    class Params(VectorParameters):
        operation: Literal["<", "<=", "==", "!=", ">=", ">"] = parameter(
            ">", text="the comparison of a with b"
        )

    params: Params
    a = Input(Vector, text="the left side")
    b = Input(Vector, text="the right side")
    y = Output(Flags, text="where it holds")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """Both sides must be the same quantity."""
        given.alike("a", "b")
        return {}

    def setup(self) -> None:
        """Choose the comparison."""
        self._compare = COMPARISONS[self.params.operation]

    def step(self) -> None:
        """Compare."""
        self._compare(self.a.value, self.b.value, out=self.y.value)


class Not(Block):
    """Element by element: y = not u."""

    Params = VectorParameters
    params: VectorParameters
    u = Input(Flags, text="the truth values")
    y = Output(Flags, text="their opposites")

    def step(self) -> None:
        """Negate."""
        np.logical_not(self.u.value, out=self.y.value)


class FlagsBefore(Signal):
    """The truth values of the run before."""

    value = Field("n", dtype="bool", text="the truth values")
    started = Field((), dtype="bool", text="whether there was a run before")


class EdgeDetector(Block):
    """Where an element began to hold in this run (rising), ceased to (falling), or either.

    The first run has no edge.
    """

    class Params(VectorParameters):
        edge: Literal["rising", "falling", "either"] = parameter("rising", text="which change")

    params: Params
    u = Input(Flags, text="the truth values")
    y = Output(Flags, text="which elements changed in this run")
    x = State(FlagsBefore, text="the truth values of the run before")

    def step(self) -> None:
        """Compare with the run before."""
        u, before, y = self.u.value, self.x.value, self.y.value
        if not self.x.started:
            np.copyto(before, u)
            self.x.started[...] = True
        if self.params.edge == "rising":
            np.greater(u, before, out=y)
        elif self.params.edge == "falling":
            np.less(u, before, out=y)
        else:
            np.not_equal(u, before, out=y)
        np.copyto(before, u)


class Counter(Block):
    """In how many runs ``u`` held so far, this one included; from 0 again behind ``last``.

    Where ``reset`` holds the count is 0, whatever ``u`` is. To count how often something begins to
    hold put an ``EdgeDetector`` before it.
    """

    class Params(Parameters):
        last: int | None = parameter(
            None, ge=1, text="the greatest count, behind which it is 0 again"
        )

    params: Params
    u = Input(Flag, text="what is counted")
    reset = Input(Flag, text="whether to begin at 0 again", default=NEVER)
    y = Output(Number, text="the count")
    x = State(Tally, text="the count")

    def step(self) -> None:
        """Count."""
        count = int(self.x.count) + bool(self.u.value)
        if self.reset.value or (self.params.last is not None and count > self.params.last):
            count = 0
        self.x.count[...] = count
        self.y.value.fill(count)


class Timer(Block):
    """For how long ``u`` has held without a break: 0 in the first run in which it holds.

    ``done`` says whether u holds and that is at least ``duration``. Time is counted in whole runs,
    so it has no error of rounding that grows.
    """

    class Params(Parameters):
        duration: float = live_parameter(
            1.0, unit="s", ge=0.0, text="how long it must hold to be done"
        )

    params: Params
    u = Input(Flag, text="what must hold")
    elapsed = Output(Seconds, text="for how long it has held; 0 where it does not")
    done = Output(Flag, text="whether it has held long enough")
    x = State(Tally, text="runs in which it has held")

    def step(self) -> None:
        """Count the runs."""
        count = int(self.x.count) + 1 if self.u.value else 0
        self.x.count[...] = count
        elapsed = max(count - 1, 0) * self.period
        self.elapsed.value.fill(elapsed)
        self.done.value[...] = count > 0 and elapsed >= self.params.duration - 1e-6 * self.period


class Switch(Block):
    """The first vector where the condition holds, else the second: y = a if condition else b."""

    Params = VectorParameters
    params: VectorParameters
    condition = Input(Flag, text="whether a is taken")
    a = Input(Vector, text="taken where the condition holds")
    b = Input(Vector, text="taken where it does not")
    y = Output(Vector, text="the one that is taken")

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """Both vectors must be the same quantity, and so is the output."""
        return {"y": given.alike("a", "b")}

    def step(self) -> None:
        """Choose."""
        np.copyto(self.y.value, self.a.value if self.condition.value else self.b.value)
