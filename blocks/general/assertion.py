"""A bound that a signal must keep."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Metric, Misfit, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .bounds import crossed_bounds
from .elements import Elements, PerElement, spread_bound
from .flags import Flag
from .vector import Vector


class Violations(Signal):
    """What an assertion remembers."""

    count = Field((), dtype="int64", text="runs in which a bound was broken")
    first = Field((), unit="s", text="when that was first")
    value = Field((), text="the element's value then")
    element = Field((), dtype="int64", text="the element that broke it then")


class Assertion(Block):
    """Bounds that every element must keep: lower <= u <= upper.

    A run in which one was broken is not successful, and its reason names the first: the element, its
    value, and when. With ``action: stop`` the run ends there; with ``mark`` it goes on.
    """

    class Params(Elements):
        lower: PerElement | None = parameter(None, text="what u must not be below")
        upper: PerElement | None = parameter(None, text="what u must not be above")
        action: Literal["stop", "mark"] = parameter("stop", text="what a broken bound does")

    params: Params
    u = Input(Vector, text="what must keep the bounds")
    ok = Output(Flag, text="whether it does in this run")
    x = State(Violations, text="what was broken")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """The bounds must not cross, and one must be there."""
        assert isinstance(params, cls.Params)
        yield from crossed_bounds(params.lower, params.upper, params.n)
        if params.lower is None and params.upper is None:
            yield Misfit("it has no bound", fix="with: {upper: 1.0}")

    @classmethod
    def example_parameters(cls) -> Mapping[str, object]:
        """A bound that is broken now and then."""
        return {"n": 2, "lower": -0.9, "upper": 0.9}

    def setup(self) -> None:
        """Keep the bounds at hand."""
        p = self.params
        self._lower = spread_bound(p.lower, p.n, -np.inf)
        self._upper = spread_bound(p.upper, p.n, np.inf)
        self._broken, self._above = np.zeros(p.n, bool), np.zeros(p.n, bool)

    def step(self) -> None:
        """Look at every element."""
        np.less(self.u.value, self._lower, out=self._broken)
        np.greater(self.u.value, self._upper, out=self._above)
        np.logical_or(self._broken, self._above, out=self._broken)
        broken = bool(self._broken.any())
        self.ok.value[...] = not broken
        if not broken:
            return
        x = self.x
        if x.count == 0:
            element = int(self._broken.argmax())
            x.first[...], x.element[...] = self.time, element
            x.value[...] = self.u.value[element]
        x.count[...] = int(x.count) + 1
        if self.params.action == "stop":
            self.request_stop(self._reason())

    def _reason(self) -> str:
        element = int(self.x.element)
        return (
            f"{self.context.path}: element {element} was {float(self.x.value):.6g} at "
            f"{float(self.x.first):.6g} s, outside [{self._lower[element]:g}, "
            f"{self._upper[element]:g}]"
        )

    def metrics(self) -> Mapping[str, Metric]:
        """Whether the bounds were kept, and in how many runs they were not."""
        count = int(self.x.count)
        if not count:
            return {"success": True, "violations": 0}
        return {"success": False, "reason": self._reason(), "violations": count}
