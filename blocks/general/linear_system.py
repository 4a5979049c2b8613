"""What the blocks of linear systems share: matrices as parameters, and their check."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...mathematics.linear_algebra import add_product, multiply_vector
from ...mathematics.linear_systems import discretise
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .matrices import Matrix, matrix_rows
from .quantity_parameters import Says, SourceParameters


class SystemInput(Signal):
    """The input of a linear system, a vector of ``n`` numbers."""

    value = Field("n", carried=True, text="the inputs")


class SystemOutput(Signal):
    """The output of a linear system, a vector of ``m`` numbers."""

    value = Field("m", carried=True, text="the outputs")


class SystemState(Signal):
    """The state of a linear system, a vector of ``order`` numbers."""

    value = Field("order", text="the system's state")


class SystemParameters(SourceParameters):
    """A linear system in state space. ``unit`` and ``frame`` are those of its outputs."""

    a: Matrix = parameter(text="A, order x order, as a list of rows", min_length=1)
    b: Matrix = parameter(text="B, order x inputs", min_length=1)
    c: Matrix = parameter(text="C, outputs x order", min_length=1)
    initial: list[float] | None = parameter(None, text="the state at the start; else zero")
    time: Literal["discrete", "continuous"] = parameter(
        "discrete",
        text="whether A and B give the next state, or its rate: then they are discretised exactly",
    )

    _rows = matrix_rows("a", "b", "c")

    def sizes(self) -> Mapping[str, int]:
        """The dimensions ``n`` (inputs), ``m`` (outputs) and ``order``."""
        return {"n": len(self.b[0]), "m": len(self.c), "order": len(self.a)}

    def wrong_sizes(self) -> Iterable[Misfit]:
        """Matrices and initial values that do not fit A."""
        order = len(self.a)
        yield from _misfit("a", "columns", len(self.a[0]), order)
        yield from _misfit("b", "rows", len(self.b), order)
        yield from _misfit("c", "columns", len(self.c[0]), order)
        if self.initial is not None:
            yield from _misfit("initial", "elements", len(self.initial), order)

    def matrices(self, period: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The discrete A and B of a period [s]."""
        if self.time == "discrete":
            return np.array(self.a), np.array(self.b)
        return discretise(self.a, self.b, period)


class LinearSystem(Says, Block):
    """The base of the linear systems in state space."""

    Params = SystemParameters
    params: SystemParameters
    u = Input(SystemInput, text="the inputs")
    y = Output(SystemOutput, text="the outputs")
    x = State(SystemState, text="the system's state")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` inputs, ``m`` outputs and the ``order``."""
        assert isinstance(params, SystemParameters)
        return params.sizes()

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """The matrices must fit each other."""
        assert isinstance(params, SystemParameters)
        return params.wrong_sizes()

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """A damped oscillator with two inputs and one output."""
        return {
            "a": [[0.0, 1.0], [-4.0, -0.5]],
            "b": [[0.0, 1.0], [1.0, 0.0]],
            "c": [[1.0, 0.0]],
            "time": "continuous",
        }

    def setup(self) -> None:
        """Discretise, and start from the initial state."""
        self._a, self._b = self.params.matrices(self.period)
        self._c = np.array(self.params.c)
        self._next = np.zeros(len(self._a))
        if self.params.initial is not None:
            self.x.value[...] = self.params.initial

    def advance(self) -> None:
        """Go on to the next state."""
        multiply_vector(self._a, self.x.value, self._next)
        add_product(self._b, self.u.value, self._next)
        np.copyto(self.x.value, self._next)


def _misfit(name: str, what: str, found: int, order: int) -> Iterable[Misfit]:
    if found != order:
        yield Misfit(
            f"{name} has {found} {what}, and the system is of order {order}",
            parameter=name,
            expected=f"{order} {what}",
            found=str(found),
        )
