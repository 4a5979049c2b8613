"""The time integral of a vector."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Input, Output, State
from .initial_value import InitialParameters
from .vector import Vector


class Integrator(Block):
    """The time integral by forward Euler: y[n] = x[n], x[n+1] = x[n] + T u[n], x[0] = initial.

    T is the block's period. A Moore block, so it breaks a loop. Raises ``BlockError`` if
    ``initial`` has not n elements.
    """

    Params = InitialParameters
    params: InitialParameters
    u = Input(Vector, text="the rate")
    y = Output(Vector, text="its integral")
    x = State(Vector, text="the integral")

    def setup(self) -> None:
        """Start from the initial value."""
        self.x.value[...] = self.params.start_value()
        self._step = np.zeros(self.params.n)
        self._period = np.array(self.period)

    def emit(self) -> None:
        """Write the integral so far."""
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        """Take one Euler step."""
        np.multiply(self.u.value, self._period, out=self._step)
        np.add(self.x.value, self._step, out=self.x.value)
