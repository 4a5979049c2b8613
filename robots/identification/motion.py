"""What was measured in a run, and which of its ticks tell something about the robot's model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY

MARGIN = 8
"""Ticks before and after a change of the contacts that are not used: impacts, and switches that bounce."""
STILL = 0.15
"""The mean joint speed of a robot that stands still, noise included [rad/s]."""


@dataclass(frozen=True)
class Motion:
    """The measurements of a run, one row a tick, as ``hal.Robot`` publishes them.

    Attributes:
        period: from tick to tick [s].
        position, velocity: of the joints at the tick [rad, rad/s], (n, n_joints).
        torque: the mean over the tick before [N m], (n, n_joints).
        angular_velocity: of the base at the tick [rad/s, body], (n, 3).
        specific_force: the mean over the tick before [m/s^2, body], (n, 3).
        up: the vertical by the estimated orientation, in the body's frame, (n, 3).
        closed: the foot switches, (n, n_contacts).
    """

    period: float
    position: Array
    velocity: Array
    torque: Array
    angular_velocity: Array
    specific_force: Array
    up: Array
    closed: NDArray[np.bool_]

    def sensor_biases(self) -> tuple[Array, Array]:
        """The biases of accelerometer [m/s^2] and gyroscope [rad/s], from where the robot stands
        still at first; zero where it never does."""
        speeds = np.abs(self.velocity).mean(axis=1)
        moving = np.flatnonzero(speeds > STILL)
        still = slice(1, max(1, int(moving[0]) if len(moving) else len(speeds)))
        if len(self.up[still]) < 10:
            return np.zeros(3), np.zeros(3)
        force = self.specific_force[still].mean(axis=0) - GRAVITY * self.up[still].mean(axis=0)
        return force, self.angular_velocity[still].mean(axis=0)

    def usable(self) -> NDArray[np.int64]:
        """The ticks, each with the one before it, in which the contacts have been the same for a while
        and stay so for a while."""
        n = len(self.closed)
        changed = np.zeros(n, dtype=np.bool_)
        changed[1:] = (self.closed[1:] != self.closed[:-1]).any(axis=1)
        near = np.convolve(changed, np.ones(2 * MARGIN + 1), mode="same") > 0.5
        near[: MARGIN + 1] = True
        return np.flatnonzero(~near)
