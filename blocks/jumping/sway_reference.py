"""A reference that moves the body in all directions over standing feet, so that a robot may be identified."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.interpolation import minimum_jerk
from ...mathematics.kept_arrays import code_digest, kept_arrays
from ...planner.library.jump_table import JumpTable
from ...robots.description import RobotDescription
from ...robots.pinocchio_model import build_pinocchio_model
from ...runtime.language.parameters import ThreeNumbers, parameter
from .guided_motion import (
    NEVER,
    GuidedBody,
    GuidedMotion,
    GuidedParameters,
    GuidedReference,
    MotionRecorder,
    check_limits,
)

_RATIOS = (1.0, 1.29, 0.83, 1.13, 0.71, 0.91)
"""The frequencies of x, y, z, roll, pitch and yaw, as multiples of one: they never repeat together."""
_SECOND = 2.3
"""A second, faster wave in every direction, as a multiple of the first."""
_FADE = 1.0
"""The time in which the motion begins and ends [s]."""
_STEP = 1e-4
_CODE = ("blocks/jumping", "blocks/signals", "mathematics", "planner/library", "robots")
"""The code that decides on the motion."""


class SwayReference(GuidedReference):
    """The body sways over its standing feet: the centre of mass along three axes, the base about three.

    Every direction has a frequency of its own and a second, faster wave, so that sensors, joints and motors
    can be told apart in what they measure. The phase is STAND all the time.
    """

    class Params(GuidedParameters):
        shift: ThreeNumbers = parameter(
            (0.004, 0.01, 0.015), unit="m", text="amplitudes of the centre of mass"
        )
        turn: ThreeNumbers = parameter(
            (0.12, 0.12, 0.15), unit="rad", text="amplitudes of roll, pitch and yaw"
        )
        drop: float = parameter(
            0.03, unit="m", ge=0.0, text="how far the centre of mass goes down before it sways"
        )
        frequency: float = parameter(1.0, unit="Hz", gt=0.0, le=5.0, text="of the first waves")
        stand_time: float = parameter(1.0, unit="s", gt=0.0, text="standing still at first")
        sway_time: float = parameter(20.0, unit="s", ge=3.0, text="swaying")

    params: Params

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        """A short sway, as its table takes a while."""
        return {"sway_time": 3.0}

    def make_table(self) -> JumpTable:
        """The stance and the motion after it."""
        p = self.params
        return _kept_plan(
            self.robot.model_dump_json(), tuple(p.shift), tuple(p.turn), p.drop, p.frequency,
            p.stand_time, p.sway_time,
        )  # fmt: skip


@lru_cache(maxsize=8)
def _kept_plan(robot: str, *numbers: Any) -> JumpTable:
    """As ``_plan``, computed once for all runs of a process, and kept for later ones."""
    decided_by = (robot + repr(numbers)).encode() + code_digest(*_CODE)
    arrays = kept_arrays(decided_by, lambda: _plan(robot, *numbers).as_arrays())
    return JumpTable.from_arrays(arrays)


def _plan(
    robot: str, shift: ThreeNumbers, turn: ThreeNumbers, drop: float, frequency: float,
    stand_time: float, sway_time: float,
) -> JumpTable:  # fmt: skip
    """The motion for a robot given as JSON."""
    description = RobotDescription.model_validate_json(robot)
    body = GuidedBody(build_pinocchio_model(description), description)
    table = MotionRecorder(body, body.standing(description.standing_position))
    still = np.zeros((len(description.feet), 3))
    home = body.com(table.q)
    size = np.array([*shift, *turn])
    rates = 2.0 * math.pi * frequency * np.array(_RATIOS)

    def away(t: float) -> Array:
        share = minimum_jerk(min(1.0, max(0.0, min(t, sway_time - t) / _FADE)))[0]
        wave = np.sin(rates * t) + 0.15 * np.sin(_SECOND * rates * t + np.arange(6))
        lowered = np.array([0.0, 0.0, -drop, 0.0, 0.0, 0.0])
        return np.asarray(share * (lowered + size * wave))

    def sway(t: float) -> GuidedMotion:
        before, here, after = away(t - _STEP), away(t), away(t + _STEP)
        rate = (after - before) / (2.0 * _STEP)
        bend = (after - 2.0 * here + before) / _STEP**2
        return GuidedMotion(
            home + here[:3], rate[:3], bend[:3], rate[3:], bend[3:], (False, False, False), still
        )

    def stand(t: float) -> GuidedMotion:
        zero = np.zeros(3)
        return GuidedMotion(home, zero, zero, zero, zero, (False, False, False), still)

    table.run(stand_time, stand)
    table.run(sway_time, sway)
    columns = {name: np.array(rows) for name, rows in table.rows.items()}
    check_limits(description, columns)
    return JumpTable(np.array(table.time), columns, NEVER, NEVER, NEVER, NEVER, NEVER)
