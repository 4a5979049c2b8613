"""A reference that moves the body in all directions over standing feet, so that a robot may be identified."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

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
_SHIFT, _DROP = (0.094, 0.13, 0.0455), 0.09
"""Ahead and aside as shares of the distance from the edge of the support, up and down of the height."""
_TURN, _BY_SUPPORT = (0.12, 0.12, 0.15), 0.138
"""Largest amplitudes [rad], and that with which the moments of turning would move the centre of pressure as far as BRUCE's,
for a robot whose radius of inertia squared is the height times the distance from the edge of the support."""
_SLOWER_ABOVE = 0.329
"""Robots whose centre of mass is higher sway more slowly, as pendulums do [m]."""
_CODE = ("blocks/jumping", "blocks/signals", "mathematics", "planner/library", "robots")
"""The code that decides on the motion."""


class SwayReference(GuidedReference):
    """The body sways over its standing feet: the centre of mass along three axes, the base about three.

    Every direction has a frequency of its own and a second, faster wave, so that sensors, joints and motors
    can be told apart in what they measure. The phase is STAND all the time.
    """

    class Params(GuidedParameters):
        shift: ThreeNumbers | None = parameter(
            None,
            unit="m",
            text="amplitudes of the centre of mass; by default by the robot's support and height",
        )
        turn: ThreeNumbers | None = parameter(
            None,
            unit="rad",
            text="amplitudes of roll, pitch and yaw; by default by its support and inertia",
        )
        drop: float | None = parameter(
            None,
            unit="m",
            ge=0.0,
            text="descent of the centre of mass before it sways; by default by its height",
        )
        frequency: float | None = parameter(
            None, unit="Hz", gt=0.0, le=5.0, text="of the first waves; by default by its height"
        )
        stand_time: float = parameter(1.0, unit="s", gt=0.0, text="standing still at first")
        sway_time: float = parameter(20.0, unit="s", ge=3.0, text="swaying")

    params: Params

    @classmethod
    def example_parameters(cls) -> dict[str, object]:
        """Return a short sway, as its table takes a while."""
        return {"sway_time": 3.0}

    def make_table(self) -> JumpTable:
        """Compute the stance and the motion after it."""
        p, usual = self.params, usual_sway(self.robot)
        chosen = Sway(
            *(
                each if own is None else own
                for own, each in zip((p.shift, p.turn, p.drop, p.frequency), usual, strict=True)
            )
        )
        return _kept_plan(self.robot.model_dump_json(), chosen, p.stand_time, p.sway_time)


class Sway(NamedTuple):
    """Amplitudes of the centre of mass along three axes [m] and of the base about three [rad], the descent of the
    centre of mass before [m], and the frequency of the first waves [Hz]."""

    shift: ThreeNumbers
    turn: ThreeNumbers
    drop: float
    frequency: float


def usual_sway(robot: RobotDescription) -> Sway:
    """Return the default sway of a robot, in whole millimetres, hundredths of a radian and tenths of a hertz.

    The centre of pressure stays as far within the support, for its size, as that of a biped with small feet does (BRUCE).
    """
    body = GuidedBody(build_pinocchio_model(robot), robot)
    q = body.standing(robot.standing_position)
    com, points = body.com(q), body.contact_points(q)
    room, height = np.minimum(points.max(axis=0) - com, com - points.min(axis=0)), com[2]
    ahead, aside, up = np.array(_SHIFT) * [room[0], room[1], height]
    turn = _BY_SUPPORT * height * room[[1, 0]] / body.radii_of_inertia(q)[:2] ** 2
    roll, pitch = np.minimum(_TURN[:2], turn).round(2).tolist()
    slower = min(1.0, math.sqrt(_SLOWER_ABOVE / height))
    return Sway(
        (round(float(ahead), 3), round(float(aside), 3), round(float(up), 3)),
        (roll, pitch, _TURN[2]), round(float(_DROP * height), 3), round(slower, 1),
    )  # fmt: skip


@lru_cache(maxsize=8)
def _kept_plan(robot: str, chosen: Sway, stand_time: float, sway_time: float) -> JumpTable:
    """Compute as ``_plan``, once for all runs of a process, and keep the table for later ones."""
    decided_by = f"{robot} {chosen} {stand_time} {sway_time}".encode() + code_digest(*_CODE)
    arrays = kept_arrays(
        decided_by, lambda: _plan(robot, chosen, stand_time, sway_time).as_arrays()
    )
    return JumpTable.from_arrays(arrays)


def _plan(robot: str, chosen: Sway, stand_time: float, sway_time: float) -> JumpTable:
    """Compute the motion for a robot given as JSON."""
    description = RobotDescription.model_validate_json(robot)
    body = GuidedBody(build_pinocchio_model(description), description)
    table = MotionRecorder(body, body.standing(description.standing_position))
    still = np.zeros((len(description.feet), 3))
    home = body.com(table.q)
    size = np.array([*chosen.shift, *chosen.turn])
    rates = 2.0 * math.pi * chosen.frequency * np.array(_RATIOS)

    def away(t: float) -> Array:
        share = minimum_jerk(min(1.0, max(0.0, min(t, sway_time - t) / _FADE)))[0]
        wave = np.sin(rates * t) + 0.15 * np.sin(_SECOND * rates * t + np.arange(6))
        lowered = np.array([0.0, 0.0, -chosen.drop, 0.0, 0.0, 0.0])
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
