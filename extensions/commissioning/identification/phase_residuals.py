"""Residuals of a calibrated model in each phase of a run: the equations of motion, joint by joint.

The model is what a controller is told: the description's links scaled to the robot's mass, and torque
constants, losses, friction and rotors as they were found. Contact forces are unknown, so the equations are
projected onto the null space of the loaded points' Jacobian. In flight nothing is projected, and the rows of
the base say what accelerometer and gyroscope contradict.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....mathematics.arrays import Array
from ....robots.pinocchio_model import build_pinocchio_model
from ....robots.robot_description import RobotDescription
from ....robots.transmission import SLIDING_SPEED
from .calibration import Calibration, Value
from .identification import Estimate, MeasuredRun
from .motor_identification import SOFT_SPEED, filtered_motion, free_projection
from .sensor_identification import EDGE, IdentifiedSensors, contact_jacobians

CUTOFF = 25.0
"""Cutoff of the filter [Hz]: a thrust lasts for some 0.2 s."""
BOUNCE = 0.012
"""A point whose switch was closed within this time is taken for loaded [s]."""
MARGIN = 0.03
"""Ticks so near another phase are not judged, as the filter mixes both [s]."""
FEWEST = 5
"""Phases with fewer ticks are not judged."""


def phase_residuals(
    robot: RobotDescription, motion: MeasuredRun, phase: NDArray[np.int64],
    names: Mapping[int, str], standing: frozenset[int], found: Calibration,
) -> dict[str, dict[str, float]]:  # fmt: skip
    """Return the root mean squares of what the model does not explain, by phase, then by ``force`` [N] and ``moment``
    [N m] of the base and by joint [N m].

    Args:
        motion: of a robot that stands still at first and ends as it began.
        phase: of each tick (n,).
        names: of the phases that are judged, in their order.
        standing: phases in which all points are loaded, whatever a switch says.
    """
    errors = _errors(robot, motion, np.isin(phase, list(standing)), found)
    inner = np.zeros(len(phase), dtype=np.bool_)
    edge, margin = round(EDGE / motion.period), round(MARGIN / motion.period)
    inner[edge : len(phase) - edge] = True
    for change in np.flatnonzero(np.diff(phase)):
        inner[max(0, change + 1 - margin) : change + 1 + margin] = False
    left = {}
    for number, name in names.items():
        chosen = errors[inner & (phase == number)]
        if len(chosen) < FEWEST:
            continue
        mean = np.sqrt((chosen**2).mean(axis=0))
        of_joints = {joint.name: float(mean[6 + k]) for k, joint in enumerate(robot.joints)}
        left[name] = {
            "force": float(np.linalg.norm(mean[:3])), "moment": float(np.linalg.norm(mean[3:6])),
            **of_joints,
        }  # fmt: skip
    return left


def _errors(
    robot: RobotDescription, motion: MeasuredRun, stands: NDArray[np.bool_], found: Calibration
) -> Array:  # fmt: skip
    """Return the residuals of the equations of motion, (n, n_velocities)."""
    import pinocchio as pin

    built = build_pinocchio_model(robot)
    model: Any = pin.Model(built.model)
    model.armature = np.zeros(model.nv)  # rotors are added apart: they do not scale
    model.gravity.linear = np.zeros(3)  # the specific force stands for it
    scale = found.mass.value / robot.total_mass
    for k in range(1, model.njoints):
        link = model.inertias[k]
        model.inertias[k] = pin.Inertia(scale * link.mass, link.lever.copy(), scale * link.inertia)
    data = model.createData()
    whole = slice(0, len(motion.position))
    angles, speeds, bends, turning, turns, force, torque = filtered_motion(
        motion, _sensors(found), whole, CUTOFF
    )
    window = 2 * round(BOUNCE / motion.period) + 1
    loaded = np.array([
        np.convolve(column, np.ones(window), mode="same") > 0.5
        for column in motion.closed.astype(np.float64).T
    ]).T | stands[:, None]  # fmt: skip
    given = _given(robot, found, speeds, torque)
    inertia = found.rotor_inertia.value * robot.rotor_matrix
    friction = np.array([each.value for each in found.friction.values()])
    damping = np.array([each.value for each in found.damping.values()])
    needed = bends @ inertia.T + friction * np.tanh(speeds / SOFT_SPEED) + damping * speeds
    n = len(robot.joints)
    q, v, a = np.zeros(7 + n), np.zeros(6 + n), np.zeros(6 + n)
    q[6], errors = 1.0, np.empty((len(angles), 6 + n))
    for k in range(len(angles)):
        q[7:], v[3:6], v[6:] = angles[k], turning[k], speeds[k]
        a[:3], a[3:6], a[6:] = force[k], turns[k], bends[k]
        errors[k] = pin.rnea(model, data, q, v, a)
    errors[:, 6:] += needed - given
    # what carries nothing takes nothing out of the equations
    jacobians = contact_jacobians(robot, angles)[0] * np.repeat(loaded, 3, axis=1)[..., None]
    return np.asarray((free_projection(jacobians) @ errors[..., None])[..., 0])


def _sensors(found: Calibration) -> IdentifiedSensors:
    """Return the identified sensors of a calibration."""

    def one(value: Value) -> Estimate:
        return Estimate(value.value, value.std)

    return IdentifiedSensors(
        tuple(map(one, found.imu_position)), tuple(map(one, found.imu_rotation)),
        one(found.gyro_age), one(found.accelerometer_age), one(found.velocity_age),
        {name: one(value) for name, value in found.play.items()}, one(found.gear_compliance), {},
    )  # fmt: skip


def _given(robot: RobotDescription, found: Calibration, speeds: Array, torque: Array) -> Array:
    """Return the torques that motors give the joints of those that they report, (n, n_joints)."""
    constant = np.array([each.value for each in found.torque_constant.values()])
    peak = np.asarray(robot.motors.peak_torque)
    reported = torque @ robot.torque_to_motor.T
    turning = speeds @ robot.joint_to_motor.T
    given = constant * reported - found.saturation.value * reported**3 / peak**2
    given -= found.load_friction.value * np.abs(reported) * np.tanh(turning / SLIDING_SPEED)
    return np.asarray(given @ robot.joint_to_motor)
