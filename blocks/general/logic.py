"""Truth values: comparisons, logic, edges, counters, timers, and a switch."""

from __future__ import annotations

from typing import Literal

from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities
from ...runtime.language.signals import Field, Signal
from .vectors import NEVER, CountState, Flag, Flags, Number, Seconds, Vector, VectorParameters


class Logic(Block):
    """Element by element: y = a and b, a or b, a xor b, not (a and b), not (a or b)."""

    class Params(VectorParameters):
        operation: Literal["and", "or", "xor", "nand", "nor"] = parameter(
            "and", text="the operation"
        )

    params: Params
    a = Input(Flags, text="the first truth values")
    b = Input(Flags, text="the second truth values")
    y = Output(Flags, text="the result")

    @kernel
    @staticmethod
    def step(a: Flags, b: Flags, y: Flags, params: Params) -> None:
        for i in range(a.value.shape[0]):
            p, q = a.value[i], b.value[i]
            if params.operation == "and":
                y.value[i] = p and q
            elif params.operation == "or":
                y.value[i] = p or q
            elif params.operation == "xor":
                y.value[i] = p != q
            elif params.operation == "nand":
                y.value[i] = not (p and q)
            else:
                y.value[i] = not (p or q)


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
    y = Output(Flags, text="elements for which it holds")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Both sides must be the same quantity."""
        inputs.alike("a", "b")
        return {}

    @kernel
    @staticmethod
    def step(a: Vector, b: Vector, y: Flags, params: Params) -> None:
        for i in range(a.value.shape[0]):
            p, q = a.value[i], b.value[i]
            if params.operation == "<":
                y.value[i] = p < q
            elif params.operation == "<=":
                y.value[i] = p <= q
            elif params.operation == "==":
                y.value[i] = p == q
            elif params.operation == "!=":
                y.value[i] = p != q
            elif params.operation == ">=":
                y.value[i] = p >= q
            else:
                y.value[i] = p > q


class Not(Block):
    """Element by element: y = not u."""

    Params = VectorParameters
    params: VectorParameters
    u = Input(Flags, text="the truth values")
    y = Output(Flags, text="their opposites")

    @kernel
    @staticmethod
    def step(u: Flags, y: Flags) -> None:
        for i in range(u.value.shape[0]):
            y.value[i] = not u.value[i]


class FlagsBefore(Signal):
    """The truth values of the run before."""

    value = Field("n", dtype="bool", text="the truth values")
    started = Field((), dtype="bool", text="there was a run before")


class EdgeDetector(Block):
    """Marks the elements that began to hold in this run (rising), ceased to (falling), or either.

    The first run has no edge.
    """

    class Params(VectorParameters):
        edge: Literal["rising", "falling", "either"] = parameter("rising", text="which change")

    params: Params
    u = Input(Flags, text="the truth values")
    y = Output(Flags, text="elements that changed in this run")
    x = State(FlagsBefore, text="the truth values of the run before")

    @kernel
    @staticmethod
    def step(u: Flags, y: Flags, x: FlagsBefore, params: Params) -> None:
        for i in range(u.value.shape[0]):
            now = u.value[i]
            before = x.value[i] if x.started else now
            if params.edge == "rising":
                y.value[i] = now and not before
            elif params.edge == "falling":
                y.value[i] = before and not now
            else:
                y.value[i] = now != before
            x.value[i] = now
        x.started = True


_ENDLESS = 2**62
"""A count that no run reaches."""


class Counter(Block):
    """Counts the runs in which ``u`` held so far, this one included; from 0 again behind ``last``.

    Where ``reset`` holds the count is 0, whatever ``u`` is. To count how often something begins to
    hold put an ``EdgeDetector`` before it.
    """

    class Params(Parameters):
        last: int | None = parameter(
            None, ge=1, text="the greatest count, behind which it is 0 again"
        )

    class Constants(Signal):
        """Constants derived from the parameters."""

        last = Field(dtype="int64", text="the greatest count")

    params: Params
    u = Input(Flag, text="the condition to count")
    reset = Input(Flag, text="begins at 0 again", default=NEVER)
    y = Output(Number, text="the count")
    x = State(CountState, text="the count")

    def prepare(self) -> None:
        self.constants.last = _ENDLESS if self.params.last is None else self.params.last

    @kernel
    @staticmethod
    def step(u: Flag, reset: Flag, y: Number, x: CountState, constants: Constants) -> None:
        if u.value:
            x.count += 1
        if reset.value or x.count > constants.last:
            x.count = 0
        y.value[0] = x.count


class Timer(Block):
    """Measures the time for which ``u`` has held without a break: 0 in the first run in which it holds.

    ``done`` is true when u holds and that is at least ``duration``. Time is counted in whole runs,
    so it has no error of rounding that grows.
    """

    class Params(Parameters):
        duration: float = live_parameter(
            1.0, unit="s", ge=0.0, text="time for which it must hold to be done"
        )

    params: Params
    u = Input(Flag, text="the condition to time")
    elapsed = Output(Seconds, text="time for which it has held; 0 where it does not")
    done = Output(Flag, text="it has held long enough")
    x = State(CountState, text="runs in which it has held")

    @kernel
    @staticmethod
    def step(
        u: Flag, elapsed: Seconds, done: Flag, x: CountState, params: Params, period: float
    ) -> None:
        x.count = x.count + 1 if u.value else 0
        elapsed.value[0] = max(x.count - 1, 0) * period
        done.value = x.count > 0 and elapsed.value[0] >= params.duration - 1e-6 * period


class Switch(Block):
    """The first vector where the condition holds, else the second: y = a if condition else b."""

    Params = VectorParameters
    params: VectorParameters
    condition = Input(Flag, text="takes a")
    a = Input(Vector, text="taken where the condition holds")
    b = Input(Vector, text="taken where it does not")
    y = Output(Vector, text="the one that is taken")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Both vectors must be the same quantity, and so is the output."""
        return {"y": inputs.alike("a", "b")}

    @kernel
    @staticmethod
    def step(condition: Flag, a: Vector, b: Vector, y: Vector) -> None:
        if condition.value:
            y.value[:] = a.value
        else:
            y.value[:] = b.value
