"""A linear system in state space without feedthrough."""

from __future__ import annotations

from ...mathematics.linear_algebra import multiply_vector
from .linear_system import LinearSystem


class StateSpace(LinearSystem):
    """A linear system: y[n] = C x[n], x[n+1] = A x[n] + B u[n], x[0] = initial.

    With ``time: continuous`` A and B are those of dx/dt = A x + B u, discretised exactly for an
    input that is held over the block's period, by the matrix exponential. A Moore block, so it
    breaks a loop; ``StateSpaceWithFeedthrough`` has a matrix D as well and does not.
    """

    def emit(self) -> None:
        """Write the outputs."""
        multiply_vector(self._c, self.x.value, self.y.value)

    def update(self) -> None:
        """Go on to the next state."""
        self.advance()
