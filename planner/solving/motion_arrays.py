"""The arrays of a plan that follow from its positions, velocities and forces at the knots."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...blocks.signals import Phase
from ...mathematics.arrays import Array
from ..models.exact_dynamics import ExactDynamics
from ..problem.one_flight import joint_torques
from ..problem.program import Program


def motion_arrays(
    problem: Program, steps: Array, position: Array, velocity: Array, force: Array
) -> dict[str, Any]:
    """The motion at the knots, with accelerations by differences and torques by exact dynamics.

    Args:
        steps: the intervals' lengths [s], (knots - 1,).
        position: (knots, n_positions).
        velocity: (knots, n_velocities).
        force: of all contact points [N], (knots, 3 n_contacts).
    """
    times = np.concatenate([[0.0], np.cumsum(steps)])
    acceleration = np.diff(velocity, axis=0) / steps[:, None]
    phases = [*problem.grid.phases, problem.grid.phases[-1]]
    contact = np.array([phase != Phase.FLIGHT for phase in phases])
    forces = force.reshape(len(times), -1, 3)
    dynamics = ExactDynamics(problem.model.robot)
    return {
        "time": times,
        "position": position,
        "velocity": velocity,
        "acceleration": np.vstack([acceleration, acceleration[-1:]]),
        "contact_force": forces,
        "contact": np.repeat(contact[:, None], forces.shape[1], axis=1),
        "phase": np.array([int(phase) for phase in phases], dtype=np.int64),
        "joint_torque": joint_torques(dynamics, times, position, velocity, forces),
    }
