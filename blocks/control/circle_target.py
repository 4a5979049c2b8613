"""A point that moves on a circle, as the target of a task such as ``FramePosition``."""

from __future__ import annotations

import math
from typing import Literal

from ...mathematics.elementary import sincos
from ...mathematics.interpolation import minimum_jerk
from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Clock, Output
from ...runtime.language.parameters import Parameters, live_parameter, parameter
from ..signals import PointTarget

Vector = tuple[float, float, float]


class CircleTarget(Block):
    """A point on a circle about ``centre``, which begins at rest in the centre.

    It waits there for ``start``. Then the radius r(t) grows to ``radius`` with minimum jerk within
    ``growth``, while the point turns with the constant rate w = 2 pi / ``turn_time``::

        p = centre + r (cos(w t) u + sin(w t) v)

    with u and v the two axes of the world across ``axis``, in the order x, y, z, x. Velocity and
    acceleration are the derivatives of p. The block knows no robot: whether the point can be reached
    is for the graph to ensure.
    """

    class Params(Parameters):
        centre: Vector = live_parameter(unit="m", text="the middle of the circle, in the world")
        radius: float = live_parameter(0.05, unit="m", ge=0.0, text="radius of the circle")
        axis: Literal["x", "y", "z"] = parameter("x", text="the world's axis across the circle")
        turn_time: float = parameter(2.0, unit="s", gt=0.0, text="duration of a turn")
        start: float = parameter(0.5, unit="s", ge=0.0, text="time of rest in the centre")
        growth: float = parameter(1.0, unit="s", gt=0.0, text="time in which the radius grows")

    params: Params
    target = Output(PointTarget, text="place and motion of the point")

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        return {"centre": [0.3, 0.2, 0.8]}

    @kernel
    @staticmethod
    def step(target: PointTarget, params: Params, clock: Clock) -> None:
        time = clock.tick * clock.base_period - params.start
        share, rate, second = minimum_jerk(time / params.growth)
        radius = params.radius * share
        speed = params.radius * rate / params.growth
        growth = params.radius * second / (params.growth * params.growth)
        w = 2.0 * math.pi / params.turn_time
        sine, cosine = sincos(w * time)
        target.position[:] = params.centre
        target.velocity[:] = 0.0
        target.acceleration[:] = 0.0
        first = 1
        if params.axis == "y":
            first = 2
        elif params.axis == "z":
            first = 0
        second_axis = (first + 1) % 3
        target.position[first] += radius * cosine
        target.position[second_axis] += radius * sine
        target.velocity[first] = speed * cosine - radius * w * sine
        target.velocity[second_axis] = speed * sine + radius * w * cosine
        target.acceleration[first] = (growth - radius * w * w) * cosine - 2.0 * speed * w * sine
        target.acceleration[second_axis] = (growth - radius * w * w) * sine + (
            2.0 * speed * w * cosine
        )
