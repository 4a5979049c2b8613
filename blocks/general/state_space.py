"""A linear system in state space without feedthrough."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ...mathematics.linear import add_product, multiply_vector
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output, State
from ...runtime.language.parameters import Parameters
from .linear_system import (
    SystemInput,
    SystemOutput,
    SystemParameters,
    SystemState,
    example_system,
)


class StateSpace(Block):
    """A linear system: y[n] = C x[n], x[n+1] = A x[n] + B u[n], x[0] = initial.

    With ``time: continuous`` A and B are those of dx/dt = A x + B u, discretised exactly for an
    input that is held over the block's period, by the matrix exponential. A Moore block, so it
    breaks a loop; ``StateSpaceWithFeedthrough`` has a matrix D as well and does not.
    """

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
        assert isinstance(params, cls.Params)
        return params.sizes()

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """The matrices must fit each other."""
        assert isinstance(params, cls.Params)
        return params.wrong_sizes()

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """An oscillator."""
        return example_system()

    def setup(self) -> None:
        """Discretise, and start from the initial state."""
        self._a, self._b = self.params.matrices(self.period)
        self._c = np.array(self.params.c)
        self._next = np.zeros(len(self._a))
        if self.params.initial is not None:
            self.x.value[...] = self.params.initial

    def emit(self) -> None:
        """Write the outputs."""
        multiply_vector(self._c, self.x.value, self.y.value)

    def update(self) -> None:
        """Go on to the next state."""
        multiply_vector(self._a, self.x.value, self._next)
        add_product(self._b, self.u.value, self._next)
        np.copyto(self.x.value, self._next)
