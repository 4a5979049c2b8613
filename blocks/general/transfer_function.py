"""A transfer function for every element of a vector."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np

from ...mathematics.linear_systems import advance_transfer_function, controllable_form, discretise
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .elements import Elements
from .quantity_parameters import InUnit, Scales
from .vector import Vector


class TransferMemory(Signal):
    """The states of one transfer function for each element."""

    value = Field(("n", "order"), text="states in the controllable canonical form")


class TransferFunction(Scales, Block):
    """A proper rational transfer function, the same for every element, from rest.

    Coefficients are of falling powers, of s for a continuous function and of z for a discrete one:
    ``numerator: [1], denominator: [0.1, 1]`` is 1 / (0.1 s + 1). A continuous one is discretised
    exactly for an input that is held over the block's period, by the matrix exponential of its
    controllable canonical form. Outputs follow from inputs of the same tick; for a loop around a
    strictly proper system use ``StateSpace``.
    """

    class Params(Elements, InUnit):
        numerator: list[float] = parameter(text="coefficients of falling powers", min_length=1)
        denominator: list[float] = parameter(text="coefficients of falling powers", min_length=2)
        time: Literal["continuous", "discrete"] = parameter(
            "continuous", text="whether it is a function of s or of z"
        )

    params: Params
    u = Input(Vector, text="what is filtered")
    y = Output(Vector, text="u, filtered")
    x = State(TransferMemory, text="the states")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` elements, and the ``order``."""
        assert isinstance(params, cls.Params)
        return {"n": params.n, "order": len(params.denominator) - 1}

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """It must be proper, and its denominator have the degree it seems to have."""
        assert isinstance(params, cls.Params)
        if params.denominator[0] == 0.0:
            yield Misfit("the denominator's first coefficient is zero", "denominator")
        if len(params.numerator) > len(params.denominator):
            yield Misfit(
                "it is not proper: the numerator's degree is above the denominator's",
                parameter="numerator",
                expected=f"at most {len(params.denominator)} coefficients",
                found=str(len(params.numerator)),
            )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """A damped second-order system with feedthrough."""
        return {"n": 2, "numerator": [0.1, 1.0, 4.0], "denominator": [1.0, 2.0, 4.0]}

    def setup(self) -> None:
        """Discretise."""
        a, b, c, self._d = controllable_form(self.params.numerator, self.params.denominator)
        if self.params.time == "continuous":
            a, b = discretise(a.tolist(), b.tolist(), self.period)
        self._a, self._b, self._c = a, b[:, 0].copy(), c[0].copy()
        self._next = np.zeros(len(a))

    def step(self) -> None:
        """Filter one sample."""
        advance_transfer_function(
            self._a, self._b, self._c, self._d, self.u.value, self.x.value, self._next, self.y.value
        )
