"""A function of several variables that is given as a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod
from typing import Any, Literal

import numpy as np

from ...mathematics.interpolation import interpolate_grid
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .quantity_parameters import Says, SourceParameters
from .tables import unsorted_points
from .vector import Vector


class TableValue(Signal):
    """What a table of several variables gives: a vector of one number."""

    value = Field(1, carried=True, text="the number")


class LookupGrid(Says, Block):
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
        values: list[float] = parameter(text="the table, the last variable fastest")
        beyond: Literal["clamp", "extrapolate"] = parameter(
            "clamp", text="what holds beyond the first and last points"
        )

    params: Params
    u = Input(Vector, text="where the table is read, one element a variable")
    y = Output(TableValue, text="the table's value there")

    @classmethod
    def local_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """``n`` variables."""
        assert isinstance(params, cls.Params)
        return {"n": len(params.axes)}

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """Every axis must rise, and the grid have as many values as points."""
        assert isinstance(params, cls.Params)
        for k, axis in enumerate(params.axes):
            yield from unsorted_points(f"axes[{k}]", axis)
            if len(axis) < 2:
                yield Misfit(
                    f"axes[{k}] has too few points",
                    "axes",
                    expected="2 or more",
                    found=str(len(axis)),
                )
        expected = prod(len(axis) for axis in params.axes)
        if len(params.values) != expected:
            yield Misfit(
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
        """Keep the table at hand, and scratch memory."""
        p = self.params
        self._points = np.array([point for axis in p.axes for point in axis])
        self._counts = np.array([len(axis) for axis in p.axes])
        self._values = np.array(p.values)
        self._places, self._shares = np.zeros(len(p.axes), np.int64), np.zeros(len(p.axes))
        self._clamp = p.beyond == "clamp"

    def step(self) -> None:
        """Read the table."""
        self.y.value[0] = interpolate_grid(
            self._points,
            self._counts,
            self._values,
            self.u.value,
            self._clamp,
            self._places,
            self._shares,
        )
