"""How far a plan's thrust has come, by the motion and not by the clock."""

from __future__ import annotations

from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel

SLOWEST = 0.5
"""Vertical speed [m/s] below which a height makes no difference to the apex yet."""
LEAST_PUSH = 8.0
"""Acceleration [m/s^2] by which at least a delay of the plan is taken to speed the robot up."""


@kernel
def speed_error(height: float, speed: float, planned_height: float, planned_speed: float) -> float:
    """By how much [m/s] the robot is too fast for the planned apex, or too slow, if negative.

    The apex of a throw is z + v^2 / (2 g), so a height error dz counts like the speed error
    g dz / v.

    Args:
        height, planned_height: of the centre of mass above the feet [m].
        speed, planned_speed: upwards [m/s].
    """
    error = speed - planned_speed
    if planned_speed > SLOWEST:
        error += GRAVITY * (height - planned_height) / planned_speed
    return error


@kernel
def delay_change(error: float, push: float, gain: float, fastest: float, period: float) -> float:
    """The change [s] of a plan's delay in one period, so that the thrust ends at the planned apex.

    A thrust that ends later by d makes the robot faster by its acceleration times d.

    Args:
        error: from ``speed_error`` [m/s].
        push: the planned upward acceleration [m/s^2].
        gain: the rate at which the error is corrected [1/s].
        fastest: the largest rate of the delay, as a share of time.
        period: of the block [s].
    """
    rate = -gain * error / max(push, LEAST_PUSH)
    return min(max(rate, -fastest), fastest) * period
