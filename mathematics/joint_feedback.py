"""The torques that commands with joint feedback ask for."""

from __future__ import annotations

import math

from .arrays import Array1D
from .kernel import kernel


@kernel
def expected_torques(
    torque: Array1D,
    stiffness: Array1D,
    damping: Array1D,
    position: Array1D,
    velocity: Array1D,
    measured_position: Array1D,
    measured_velocity: Array1D,
    most: Array1D,
    out: Array1D,
) -> None:
    """Write what a command asks of each joint, tau + k (q - q_measured) + d (q' - q'_measured), no more than it has.

    Each is (n_joints,).

    Args:
        torque, stiffness, damping, position, velocity: the command.
        measured_position, measured_velocity: of the joints.
        most: the largest torque of each joint [N m].
        out: the torques [N m]; zero where the command is not finite.
    """
    for k in range(out.shape[0]):
        asked = torque[k]
        asked += stiffness[k] * (position[k] - measured_position[k])
        asked += damping[k] * (velocity[k] - measured_velocity[k])
        out[k] = min(max(asked, -most[k]), most[k]) if math.isfinite(asked) else 0.0
