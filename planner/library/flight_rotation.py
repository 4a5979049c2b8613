"""How fast a somersault's plan turns with its joints held, and how far it still turns so."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ..models.exact_dynamics import ExactDynamics
from .jump_table import JumpTable

PITCH = 1
"""The axis of a somersault: the world's y axis, which is the body's too."""
WHOLE = math.pi
"""A flight that turns further than this [rad] is a somersault."""
TUCKED = 0.9
"""The legs are tucked from when the rate is this share of its greatest."""
OUT = 0.3
"""They are out when this share of the rate's way from its greatest to its last value is left."""
ROUNDING = 1e-9


class FlightRotation(NamedTuple):
    """The flight of a somersault as a rotation about the pitch axis.

    ``time`` (n,) [s] of the plan, from lift-off to touchdown. ``rate`` (n,) [rad/s], the angular momentum
    divided by the inertia of the whole robot in the plan's pose, without a sign. ``left`` (n,) [rad], its
    integral from then until touchdown. ``marks`` (4,): when the legs are tucked and when they are out
    again [s], the greatest rate [rad/s], and the direction, 1 forwards and -1 backwards.
    """

    time: Array
    rate: Array
    left: Array
    marks: Array


def flight_rotation(table: JumpTable, robot: RobotDescription) -> FlightRotation | None:
    """The rotation of a plan that turns over in its only flight; ``None`` for every other plan."""
    if table.later_jumps:
        return None
    first, end = (
        int(np.searchsorted(table.time, time - ROUNDING))
        for time in (table.lift_off_time, table.touchdown_time)
    )
    rows = slice(first, end + 1)  # a second row at touchdown is of after the impact
    momentum = table.columns["angular_momentum"][rows, PITCH]
    time, inertia = np.array(table.time[rows]), _inertia(table, rows, robot)
    direction = math.copysign(1.0, float(momentum.sum()))
    rate = np.asarray(direction * momentum / inertia)
    parts = 0.5 * np.diff(time) * (rate[1:] + rate[:-1])
    left = np.concatenate([np.cumsum(parts[::-1])[::-1], [0.0]])
    greatest, last = float(rate.max()), float(rate[-1])
    tucked = np.flatnonzero(rate >= TUCKED * greatest)
    folded = np.flatnonzero(rate - last >= OUT * (greatest - last))
    if left[0] < WHOLE or folded[-1] == len(rate) - 1:
        return None
    marks = np.array([time[tucked[0]], time[folded[-1]], greatest, direction])
    return FlightRotation(time, rate, left, marks)


def _inertia(table: JumpTable, rows: slice, robot: RobotDescription) -> Array:
    """The inertia of the whole robot about its pitch axis [kg m^2] in those rows."""
    dynamics, spin = ExactDynamics(robot), np.zeros(6 + len(robot.joints))
    spin[3 + PITCH] = 1.0
    poses = zip(
        table.columns["orientation"][rows], table.columns["joint_position"][rows], strict=True
    )
    return np.array([
        dynamics.centroidal(np.concatenate([np.zeros(3), turn, joints]), spin)[2][PITCH]
        for turn, joints in poses
    ])  # fmt: skip
