"""Functions that are given as tables."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from math import prod
from typing import Any, Literal

import numpy as np

from ...mathematics.arrays import Array1D, Indices1D
from ...mathematics.interpolation import interpolate, interpolate_grid
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, Input, Output, UnmetRequirement
from ...runtime.language.parameters import Numbers, Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .vectors import SourceParameters, UnitFromParameters, Vector, VectorParameters


def unsorted_points(name: str, points: Sequence[float]) -> Iterable[UnmetRequirement]:
    """Report points that do not rise from each to the next."""
    for one, two in pairwise(points):
        if two <= one:
            yield UnmetRequirement(
                f"{name} does not rise",
                parameter=name.partition("[")[0],
                expected=f"more than {one:g} behind {one:g}",
                found=f"{two:g}",
            )
            return


class LookupTable(UnitFromParameters, Block):
    """The line through the points (points[k], values[k]), evaluated at every element of the input.

    Beyond the first and last point the outer values hold (``clamp``) or the outer lines go on
    (``extrapolate``).
    """

    class Params(VectorParameters, SourceParameters):
        in_unit = ("values",)

        points: Numbers = parameter(text="inputs, rising", min_length=2)
        values: Numbers = parameter(text="the output at each of them", min_length=2)
        beyond: Literal["clamp", "extrapolate"] = parameter(
            "clamp", text="rule beyond the first and last point"
        )

    params: Params
    u = Input(Vector, text="place at which the table is read")
    y = Output(Vector, text="the table's values there")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report points that do not rise, or have no value each."""
        assert isinstance(params, cls.Params)
        yield from unsorted_points("points", params.points)
        if len(params.values) != len(params.points):
            yield UnmetRequirement(
                "there must be as many values as points",
                parameter="values",
                expected=str(len(params.points)),
                found=str(len(params.values)),
            )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Three points."""
        return {"n": 2, "points": [-1.0, 0.0, 2.0], "values": [1.0, 0.0, 4.0]}

    @kernel
    @staticmethod
    def step(u: Vector, y: Vector, params: Params) -> None:
        for i in range(y.value.shape[0]):
            y.value[i] = interpolate(
                params.points, params.values, u.value[i], params.beyond == "clamp"
            )


class TableValue(Signal):
    """Value of a table of several variables: a vector of one number."""

    value = Field(1, inferred=True, text="the number")


class LookupGrid(UnitFromParameters, Block):
    """One number from a table on a grid, multilinear between its points: y = table(u[0], u[1], ...).

    ``axes`` holds the rising points of every variable; ``values`` the table in row-major order: the
    last variable's points follow each other. Beyond the ends the outer values hold (``clamp``) or
    the outer cells go on (``extrapolate``). It takes time in proportion to 2^n for n variables.
    """

    class Params(SourceParameters):
        in_unit = ("values",)

        axes: list[list[float]] = parameter(
            text="for every variable its points, rising", min_length=1, max_length=8
        )
        values: Numbers = parameter(text="the table, the last variable fastest")
        beyond: Literal["clamp", "extrapolate"] = parameter(
            "clamp", text="rule beyond the first and last points"
        )

    class Scratch(Signal):
        """Scratch memory of one step."""

        places = Field("n", dtype="int64", text="the cell that the input is in, by axis")
        shares = Field("n", text="share of the cell at which the input is, by axis")

    params: Params
    u = Input(Vector, text="place at which the table is read, one element a variable")
    y = Output(TableValue, text="the table's value there")

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """``n`` variables."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.axes)}

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Every axis must rise, and the grid have as many values as points."""
        assert isinstance(params, cls.Params)
        for k, axis in enumerate(params.axes):
            yield from unsorted_points(f"axes[{k}]", axis)
            if len(axis) < 2:
                yield UnmetRequirement(
                    f"axes[{k}] has too few points",
                    "axes",
                    expected="2 or more",
                    found=str(len(axis)),
                )
        expected = prod(len(axis) for axis in params.axes)
        if len(params.values) != expected:
            yield UnmetRequirement(
                "values does not fill the grid",
                parameter="values",
                expected=" x ".join(str(len(axis)) for axis in params.axes) + f" = {expected}",
                found=str(len(params.values)),
            )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Two variables."""
        return {"axes": [[-1.0, 0.5], [-1.0, 0.0, 1.0]], "values": [0.0, 1.0, 2.0, 3.0, 5.0, 8.0]}

    def setup(self) -> None:
        axes = self.params.axes
        self.points = np.array([point for axis in axes for point in axis])
        self.counts = np.array([len(axis) for axis in axes])

    @kernel
    @staticmethod
    def step(
        u: Vector,
        y: TableValue,
        params: Params,
        points: Array1D,
        counts: Indices1D,
        scratch: Scratch,
    ) -> None:
        clamp = params.beyond == "clamp"
        y.value[0] = interpolate_grid(
            points, counts, params.values, u.value, clamp, scratch.places, scratch.shares
        )
