"""Gains, sums and products of vectors."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np

from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, Input, Output, UnmetRequirement
from ...runtime.language.parameters import Parameters, ScalarOrVector, live_parameter, parameter
from ...runtime.language.quantities import InputQuantities, OutputQuantities, Quantity
from ...runtime.language.signals import Field, Signal
from ...runtime.language.unit_algebra import read_unit
from .vectors import (
    InUnit,
    Matrix,
    SourceParameters,
    UnitOfProduct,
    Vector,
    VectorParameters,
    VectorUnits,
    matrix_rows,
    said,
)


class Gain(UnitOfProduct, Block):
    """The input times a constant: y = gain u.

    There may be one gain for each element. ``MatrixGain`` multiplies by a matrix.
    """

    class Params(VectorParameters, InUnit):
        in_unit = ("gain",)

        gain: ScalarOrVector = live_parameter(1.0, text="the factor")

    params: Params
    u = Input(Vector, text="the vector to scale")
    y = Output(Vector, text="gain times u")

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, params: Params) -> None:
        y.value[:] = params.gain * u.value


class Sum(Block):
    """The weighted sum of two inputs: y = weights[0] a + weights[1] b; [1, -1] subtracts."""

    class Params(Parameters):
        n: int = parameter(1, ge=1, text="elements")
        weights: list[float] = live_parameter(
            [1.0, 1.0], min_length=2, max_length=2, text="factors of a and b"
        )

    params: Params
    a = Input(Vector, text="the first")
    b = Input(Vector, text="the second")
    y = Output(Vector, text="the sum")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Both inputs must be the same quantity, and so is the sum."""
        return {"y": inputs.alike("a", "b")}

    @kernel
    @staticmethod
    def step(a: Vector, b: Vector, y: Vector, params: Params) -> None:
        y.value[:] = a.value * params.weights[0] + b.value * params.weights[1]


class Product(Block):
    """Element by element: y = a b, or y = a / b.

    A division by zero makes an element infinite, which ends the run with the block's name.
    """

    class Params(VectorParameters):
        operation: Literal["multiply", "divide"] = parameter("multiply", text="the operation")

    params: Params
    a = Input(Vector, text="the first factor, or the dividend")
    b = Input(Vector, text="the second factor, or the divisor")
    y = Output(Vector, text="the product or quotient")

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the product or quotient of the units; a frame is kept."""
        assert isinstance(params, cls.Params)
        a, b = inputs["a"], inputs["b"]
        if a is None or b is None:
            return {}
        return {"y": a.product(b, 1 if params.operation == "multiply" else -1)}

    @kernel
    @staticmethod
    def step(a: Vector, b: Vector, y: Vector, params: Params) -> None:
        if params.operation == "multiply":
            y.value[:] = a.value * b.value
        else:
            np.divide(a.value, b.value, y.value)


class Rows(Signal):
    """A vector of ``m`` numbers, one for each row of the matrix."""

    value = Field("m", inferred=True, text="the vector's elements")


class MatrixGain(Block):
    """A constant matrix times the input: y = K u, K with m rows and n columns.

    Sums run from the first column to the last, so results are the same on every machine. Where u joins unlike
    units, as in a feedback of states, ``input_units`` and ``output_units`` say what comes in and goes out.
    """

    class Params(SourceParameters, VectorUnits):
        in_unit = ("matrix",)

        matrix: Matrix = parameter(text="K, as a list of its rows", min_length=1)

        _rows = matrix_rows("matrix")

    params: Params
    u = Input(Vector, text="the vector to multiply")
    y = Output(Rows, text="K u")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``m`` rows and ``n`` columns."""
        assert isinstance(params, cls.Params)
        return {"m": len(params.matrix), "n": len(params.matrix[0])}

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report lists of units that do not fit the matrix."""
        assert isinstance(params, cls.Params)
        return params.wrong_units(len(params.matrix[0]), len(params.matrix))

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two rows and three columns."""
        return {"matrix": [[1.0, 2.0, -1.0], [0.0, 0.5, 3.0]]}

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return what the parameters say of y, or the unit of u times that of the matrix; the frame is that of
        the parameter."""
        assert isinstance(params, cls.Params)
        u = inputs["u"]
        params.check_inputs(inputs)
        if params.output_units is not None:
            return {"y": said(params.output_units, params.frame)}
        if u is None:
            return {}
        unit = Quantity(u.unit).times(read_unit(params.unit)).unit  # sums of unlike units have none
        return {"y": Quantity(unit, params.frame)}

    @kernel
    @staticmethod
    def step(u: Vector, y: Rows, params: Params) -> None:
        y.value[:] = params.matrix @ u.value
