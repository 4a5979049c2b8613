"""Default joint gains, from a robot's inertia and motors."""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.kept_arrays import code_digest, kept_arrays
from ...mathematics.linear_algebra import product
from ...robots.description import RobotDescription
from ...robots.pinocchio_model import build_pinocchio_model

NATURAL_FREQUENCY = 60.0
"""Natural frequency [rad/s] of a joint with the default gains, if its motor is strong enough."""
DAMPING_RATIO = 0.8
SATURATION_ERROR = 0.2
"""The joint error [rad] at which the default stiffness may at most ask for the peak torque."""


def default_gains(robot: RobotDescription) -> tuple[Array, Array]:
    """Stiffness [N m/rad] and damping [N m s/rad] of every joint, (n_joints,) each.

    Let I be the inertia of a joint in the standing pose with the base held, rotors included, and w
    the ``NATURAL_FREQUENCY``. Then K = I w^2, but at most the peak torque per ``SATURATION_ERROR``,
    and D = 2 ``DAMPING_RATIO`` sqrt(K I).
    """
    inertia = kept_arrays(
        robot.model_dump_json().encode() + code_digest("mathematics", "robots", "blocks/control"),
        lambda: {"inertia": _joint_inertia(robot)},
    )["inertia"]
    peak = product(np.abs(robot.joint_to_motor).T, robot.motors.peak_torque)
    stiffness = np.minimum(inertia * NATURAL_FREQUENCY**2, peak / SATURATION_ERROR)
    return stiffness, 2.0 * DAMPING_RATIO * np.sqrt(stiffness * inertia)


def _joint_inertia(robot: RobotDescription) -> Array:
    """The inertia of every joint in the standing pose [kg m^2], (n_joints,)."""
    import pinocchio

    built = build_pinocchio_model(robot)
    position = np.array(pinocchio.neutral(built.model))
    position[-len(robot.joints) :] = robot.standing_position
    matrix = pinocchio.crba(built.model, built.model.createData(), position)
    return np.diag(matrix + built.rotor_coupling)[-len(robot.joints) :]
