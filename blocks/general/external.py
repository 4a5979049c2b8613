"""A vector that is set from outside of the graph, between two ticks."""

from __future__ import annotations

import numpy as np

from ...runtime.language.block import Block, Output, State
from .initial_value import InitialParameters
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class External(Says, Block):
    """A vector that Python sets between two ticks: ``run["action"] = [0.1, 0.2]``.

    It holds what was set last, and ``initial`` before. See ``aloft.Graph.open`` and ``aloft.gym``.
    In a run that nobody steps it is a constant.
    """

    class Params(InitialParameters, SourceParameters):
        in_unit = ("initial",)

    params: Params
    y = Output(Vector, text="what was set last")
    x = State(Vector, text="what was set last")

    def setup(self) -> None:
        """Begin with the initial value."""
        np.copyto(self.x.value, self.params.start_value())

    def emit(self) -> None:
        """Write the vector."""
        np.copyto(self.y.value, self.x.value)

    def update(self) -> None:
        """Do nothing: there is no input."""
