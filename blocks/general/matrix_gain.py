"""A matrix times a vector."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...mathematics.linear_algebra import multiply_vector
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.quantities import Carried, Given
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import read_unit
from .matrices import Matrix, matrix_rows
from .quantity_parameters import SourceParameters
from .vector import Vector


class Rows(Signal):
    """A vector of ``m`` numbers, one for each row of the matrix."""

    value = Field("m", carried=True, text="the vector's elements")


class MatrixGain(Block):
    """A constant matrix times the input: y = K u, K with m rows and n columns.

    Sums run from the first column to the last, so results are the same on every machine.
    """

    class Params(SourceParameters):
        in_unit = ("matrix",)

        matrix: Matrix = parameter(text="K, as a list of its rows", min_length=1)

        _rows = matrix_rows("matrix")

    params: Params
    u = Input(Vector, text="what is multiplied")
    y = Output(Rows, text="K u")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``m`` rows and ``n`` columns."""
        assert isinstance(params, cls.Params)
        return {"m": len(params.matrix), "n": len(params.matrix[0])}

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two rows and three columns."""
        return {"matrix": [[1.0, 2.0, -1.0], [0.0, 0.5, 3.0]]}

    @classmethod
    def carried(cls, params: Parameters, given: Given) -> Carried:
        """The unit of u times that of the matrix; the frame is what the parameter says."""
        assert isinstance(params, cls.Params)
        u = given["u"]
        return {"y": u and replace(u.times(read_unit(params.unit)), frame=params.frame)}

    def setup(self) -> None:
        """Make the matrix."""
        self._matrix = np.array(self.params.matrix)

    def step(self) -> None:
        """Multiply."""
        multiply_vector(self._matrix, self.u.value, self.y.value)
