"""A linear system in state space with feedthrough."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ...mathematics.linear_algebra import add_product, multiply_vector
from ...robots.description import RobotDescription
from ...runtime.language.block import Misfit
from ...runtime.language.parameters import Parameters, parameter
from .linear_system import LinearSystem, SystemParameters
from .matrices import Matrix, matrix_rows


class StateSpaceWithFeedthrough(LinearSystem):
    """A linear system: y[n] = C x[n] + D u[n], x[n+1] = A x[n] + B u[n], x[0] = initial.

    With ``time: continuous`` A and B are those of dx/dt = A x + B u, discretised exactly for an
    input that is held over the block's period. Outputs follow from the inputs of the same tick.
    """

    class Params(SystemParameters):
        d: Matrix = parameter(text="D, outputs x inputs", min_length=1)

        _d_rows = matrix_rows("d")

    params: Params

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
        return {**super().example_parameters(), "d": [[0.5, -1.0]]}

    def setup(self) -> None:
        """Discretise, and start from the initial state."""
        super().setup()
        self._d = np.array(self.params.d)

    def step(self) -> None:
        """Write the outputs and go on to the next state."""
        multiply_vector(self._c, self.x.value, self.y.value)
        add_product(self._d, self.u.value, self.y.value)
        self.advance()
