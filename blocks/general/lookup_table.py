"""A function that is given as a table."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np

from ...mathematics.interpolation import interpolate
from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Misfit, Output
from ...runtime.language.parameters import Parameters, parameter
from .elements import Elements
from .quantity_parameters import Says, SourceParameters
from .tables import unsorted_points
from .vector import Vector


class LookupTable(Says, Block):
    """The line through the points (points[k], values[k]), evaluated at every element of the input.

    Beyond the first and last point the outer values hold (``clamp``) or the outer lines go on
    (``extrapolate``).
    """

    class Params(Elements, SourceParameters):
        in_unit = ("values",)

        points: list[float] = parameter(text="inputs, rising", min_length=2)
        values: list[float] = parameter(text="the output at each of them", min_length=2)
        beyond: Literal["clamp", "extrapolate"] = parameter(
            "clamp", text="what holds beyond the first and last point"
        )

    params: Params
    u = Input(Vector, text="where the table is read")
    y = Output(Vector, text="the table's values there")

    @classmethod
    def requires(cls, params: Parameters, robot: RobotDescription | None) -> Iterable[Misfit]:
        """The points must rise and each must have a value."""
        assert isinstance(params, cls.Params)
        yield from unsorted_points("points", params.points)
        if len(params.values) != len(params.points):
            yield Misfit(
                "there must be as many values as points",
                parameter="values",
                expected=str(len(params.points)),
                found=str(len(params.values)),
            )

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Three points."""
        return {"n": 2, "points": [-1.0, 0.0, 2.0], "values": [1.0, 0.0, 4.0]}

    def setup(self) -> None:
        """Keep the table at hand."""
        self._points, self._values = np.array(self.params.points), np.array(self.params.values)
        self._clamp = self.params.beyond == "clamp"

    def step(self) -> None:
        """Read the table for every element."""
        u, y = self.u.value, self.y.value
        for i in range(self.params.n):
            y[i] = interpolate(self._points, self._values, float(u[i]), self._clamp)
