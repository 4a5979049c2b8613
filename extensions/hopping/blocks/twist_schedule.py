"""Velocities from a list, each from its time on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from pydantic import field_validator

from ....mathematics.arrays import Array1D, Array2D
from ....mathematics.kernel import kernel
from ....mathematics.ticks import first_tick
from ....runtime.language.block import Block, Output
from ....runtime.language.context import Clock
from ....runtime.language.parameters import Parameters, parameter
from ..signals import BodyTwist


class TimedTwist(Parameters):
    """One velocity."""

    at: float = parameter(0.0, unit="s", ge=0.0, text="from this time of the run on")
    ahead: float = parameter(0.0, unit="m/s", ge=-10.0, le=10.0, text="speed ahead")
    aside: float = parameter(0.0, unit="m/s", ge=-10.0, le=10.0, text="speed to the left")
    turn: float = parameter(0.0, unit="rad/s", ge=-10.0, le=10.0, text="rate of turn to the left")


class TwistRows(NamedTuple):
    """The velocities: ``at`` (n,) [s]; ``twists`` (n, 3), ahead, aside [m/s] and turn [rad/s]."""

    at: Array1D
    twists: Array2D


class TwistSchedule(Block):
    """Gives one velocity after the other, each from its time ``at`` on; before the first of them zero."""

    class Params(Parameters):
        twists: tuple[TimedTwist, ...] = parameter((), text="in the order of their times")

        @field_validator("twists")
        @classmethod
        def _check_times(cls, twists: tuple[TimedTwist, ...]) -> tuple[TimedTwist, ...]:
            times = [twist.at for twist in twists]
            if sorted(set(times)) != times:
                raise ValueError(f"expected rising times `at`, found {times} s")
            return twists

    params: Params
    twist = Output(BodyTwist, text="the velocity that holds")

    def setup(self) -> None:
        given = self.params.twists
        self.rows = TwistRows(
            np.array([one.at for one in given], dtype=np.float64),
            np.array([[one.ahead, one.aside, one.turn] for one in given]).reshape(-1, 3),
        )

    @kernel
    @staticmethod
    def step(twist: BodyTwist, rows: TwistRows, clock: Clock) -> None:
        twist.linear[:] = 0.0
        twist.angular[:] = 0.0
        for row in range(rows.at.shape[0]):
            if clock.tick >= first_tick(rows.at[row], clock.base_period):
                twist.linear[0], twist.linear[1] = rows.twists[row, 0], rows.twists[row, 1]
                twist.angular[2] = rows.twists[row, 2]
