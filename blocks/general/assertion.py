"""Assertions that a run must keep."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

from ...mathematics.kernel import kernel
from ...runtime.language.block import (
    Block,
    Clock,
    Context,
    Input,
    Metric,
    Output,
    State,
    UnmetRequirement,
)
from ...runtime.language.parameters import Parameters, ScalarOrVector, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities
from ...runtime.language.signals import Field, Signal
from .vectors import (
    Bounded,
    Bounds,
    Flag,
    Vector,
    VectorParameters,
    ask_for_lists,
)


class Violations(Signal):
    """Memory of an assertion."""

    count = Field((), dtype="int64", text="runs in which a bound was broken")
    first = Field((), unit="s", text="time of the first one")
    value = Field((), text="the element's value then")
    element = Field((), dtype="int64", text="the element that broke it then")


class Assertion(Bounded, Block):
    """Bounds that every element must keep: lower <= u <= upper.

    A run in which one was broken is not successful, and its reason names the first: the element, its
    value, and when. With ``action: stop`` the run ends there; with ``mark`` it goes on.
    """

    class Params(VectorParameters):
        lower: ScalarOrVector | None = parameter(None, text="lower bound of u")
        upper: ScalarOrVector | None = parameter(None, text="upper bound of u")
        action: Literal["stop", "mark"] = parameter("stop", text="effect of a broken bound")

    params: Params
    u = Input(Vector, text="the signal to bound")
    ok = Output(Flag, text="the bounds are kept in this run")
    x = State(Violations, text="the broken bounds")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report bounds that cross, or the lack of any."""
        assert isinstance(params, cls.Params)
        yield from super().requires(params, context)
        if params.lower is None and params.upper is None:
            yield UnmetRequirement("it has no bound", fix="with: {upper: 1.0}")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Ask for bounds one by one where the elements have unlike units."""
        ask_for_lists(("lower", "upper"), params, inputs)
        return {}

    @classmethod
    def example_parameters(cls) -> Mapping[str, object]:
        """Return a bound that is broken now and then."""
        return {"n": 2, "lower": -0.9, "upper": 0.9}

    def _reason(self) -> str:
        element = int(self.x.element)
        return (
            f"{self.context.path}: element {element} was {float(self.x.value):.6g} at "
            f"{float(self.x.first):.6g} s, outside [{self.constants.lower[element]:g}, "
            f"{self.constants.upper[element]:g}]"
        )

    def metrics(self) -> Mapping[str, Metric]:
        """Return whether the bounds were kept, and in how many runs they were not."""
        count = int(self.x.count)
        if not count:
            return {"success": True, "violations": 0}
        return {"success": False, "reason": self._reason(), "violations": count}

    @kernel
    @staticmethod
    def step(
        u: Vector, ok: Flag, x: Violations, params: Params, constants: Bounds, clock: Clock
    ) -> bool:
        broken = -1
        for i in range(u.value.shape[0]):
            if u.value[i] < constants.lower[i] or u.value[i] > constants.upper[i]:
                broken = i
                break
        ok.value = broken < 0
        if broken < 0:
            return False
        if x.count == 0:
            x.first = clock.base_period * clock.tick
            x.element = broken
            x.value = u.value[broken]
        x.count += 1
        return params.action == "stop"

    def on_event(self) -> None:
        self.request_stop(self._reason())
