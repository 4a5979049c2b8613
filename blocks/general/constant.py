"""A vector that does not change."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Output
from ...runtime.language.parameters import Parameters, live_parameter
from .quantity_parameters import Says, SourceParameters
from .vector import Vector


class Constant(Says, Block):
    """A constant vector: y[n] = value. It has as many elements as ``value``."""

    class Params(SourceParameters):
        in_unit = ("value",)

        value: list[float] = live_parameter(text="the vector", min_length=1)

    params: Params
    y = Output(Vector, text="the vector")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` is the length of ``value``."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.value)}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Three numbers."""
        return {"value": [1.0, -2.0, 0.5]}

    def setup(self) -> None:
        """Make the vector."""
        self.on_parameters()

    def on_parameters(self) -> None:
        """Make the vector again from the changed parameters."""
        self._value = np.array(self.params.value)

    def step(self) -> None:
        """Write the vector."""
        np.copyto(self.y.value, self._value)
