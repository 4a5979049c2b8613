"""A linear system in state space with feedthrough."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ...mathematics.linear import add_product, multiply_vector
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters, parameter
from .linear_system import (
    SystemInput,
    SystemOutput,
    SystemParameters,
    SystemState,
    example_system,
)
from .matrices import Matrix, matrix_rows


class StateSpaceWithFeedthrough(Block):
    """A linear system: y[n] = C x[n] + D u[n], x[n+1] = A x[n] + B u[n], x[0] = initial.

    With ``time: continuous`` A and B are those of dx/dt = A x + B u, discretised exactly for an
    input that is held over the block's period. Outputs follow from the inputs of the same tick.
    """

    class Params(SystemParameters):
        d: Matrix = parameter(text="D, outputs x inputs", min_length=1)

        _d_rows = matrix_rows("d")

    params: Params
    u = Input(SystemInput, text="the inputs")
    y = Output(SystemOutput, text="the outputs")
    x = State(SystemState, text="the system's state")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` inputs, ``m`` outputs and the ``order``."""
        assert isinstance(params, cls.Params)
        return params.sizes()

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """The matrices must fit each other."""
        assert isinstance(params, cls.Params)
        yield from params.wrong_sizes()
        found = f"{len(params.d)} x {len(params.d[0])}"
        expected = f"{len(params.c)} x {len(params.b[0])}"
        if found != expected:
            yield Misfit("d does not fit b and c", "d", expected=expected, found=found)

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """An oscillator with feedthrough."""
        return {**example_system(), "d": [[0.5, -1.0]]}

    def setup(self) -> None:
        """Discretise, and start from the initial state."""
        self._a, self._b = self.params.matrices(self.period)
        self._c, self._d = np.array(self.params.c), np.array(self.params.d)
        self._next = np.zeros(len(self._a))
        if self.params.initial is not None:
            self.x.value[...] = self.params.initial

    def step(self) -> None:
        """Write the outputs and go on to the next state."""
        multiply_vector(self._c, self.x.value, self.y.value)
        add_product(self._d, self.u.value, self.y.value)
        multiply_vector(self._a, self.x.value, self._next)
        add_product(self._b, self.u.value, self._next)
        np.copyto(self.x.value, self._next)
