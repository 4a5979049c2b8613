"""The equations by which a standing robot's torques tell its mass, as pure functions.

With base rows b and joint rows j of the equations of motion, and the forces f of the feet,

    M_b a + n_b = J_b' f,        M_j a + n_j = tau - c + J_j' f,

where c is the joints' friction. If the torques of the legs' joints determine the wrench of each
foot, f can be eliminated by the map G = J_b' (J_j')^+ from joint torques to forces on the base:

    (M_b a + n_b) - G (M_j a + n_j) + G (tau - c) = 0,

six equations that are linear in the masses. No function here allocates memory.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .arrays import Array1D, Array2D, Array3D, Indices1D, Indices2D
from .kernel import kernel
from .linear_algebra import multiply_vector, solve_rows

DAMPING = 1e-8
"""Added to the squared levers [m^2] of the joints, so that a straight leg has a finite inverse."""


class BaseForceScratch(NamedTuple):
    """Scratch for ``base_force_map``: ``normal`` (n, n) and ``right`` (6, n) for legs of up to n
    joints."""

    normal: Array2D
    right: Array2D


@kernel
def base_force_map(
    jacobian: Array3D,
    stance: NDArray[np.bool_],
    foot_of_point: Indices1D,
    chains: Indices2D,
    scratch: BaseForceScratch,
    out: Array2D,
) -> None:
    """The map G (6, n_joints) from joint torques to the generalised force on a floating base.

    Args:
        jacobian: of the contact points, (n_contacts, 3, 6 + n_joints).
        stance: which points carry load.
        foot_of_point: the foot of each point.
        chains: the joints of each foot's leg, (n_feet, n), filled up with -1.
    """
    normal, right = scratch
    out[:] = 0.0
    longest = chains.shape[1]
    for foot in range(chains.shape[0]):
        normal[:] = 0.0
        right[:] = 0.0
        loaded = False
        for point in range(foot_of_point.shape[0]):
            if foot_of_point[point] != foot or not stance[point]:
                continue
            loaded = True
            for axis in range(3):
                row = jacobian[point, axis]
                for i in range(longest):
                    if chains[foot, i] < 0:
                        continue
                    lever = row[6 + chains[foot, i]]
                    for k in range(i + 1):
                        normal[i, k] += lever * row[6 + chains[foot, k]]
                    for k in range(6):
                        right[k, i] += lever * row[k]
        if not loaded:
            continue
        for i in range(longest):
            normal[i, i] += DAMPING
        solve_rows(normal, right)
        for i in range(longest):
            joint = chains[foot, i]
            if joint >= 0:
                for k in range(6):
                    out[k, joint] = float(right[k, i])


@kernel
def split_friction(
    speed: Array1D, friction: Array1D, damping: Array1D, threshold: float, left: float,
    known: Array1D, unknown: Array1D,
) -> None:  # fmt: skip
    """The part of the joints' friction that their speed tells, and the share that stays unknown.

    Args:
        speed: of the joints [rad/s], low-pass filtered.
        friction, damping: of the joints [N m, N m s/rad].
        threshold: speed [rad/s] above which friction surely acts against the motion.
        left: the share of friction that stays unknown in a fast joint.
        known: becomes the known torque [N m], positive against positive motion.
        unknown: becomes the share, 1 for a joint at rest.
    """
    for i in range(speed.shape[0]):
        share = math.tanh(speed[i] / threshold)
        known[i] = friction[i] * share + damping[i] * speed[i]
        unknown[i] = 1.0 - (1.0 - left) * abs(share)


@kernel
def torso_moment(rotation: Array2D, weight: float, out: Array2D) -> None:
    """How the moment on the base (3) changes with the torso's centre of mass (3): out, (3, 3).

    At rest the weight at d needs the moment d x (R' e_z) weight, in the base's axes.

    Args:
        rotation: R, from the base to the world, (3, 3).
        weight: of the torso [N].
    """
    x, y, z = (
        weight * rotation[2, 0], weight * rotation[2, 1],
        weight * rotation[2, 2],
    )  # fmt: skip
    out[0, 0], out[0, 1], out[0, 2] = 0.0, z, -y
    out[1, 0], out[1, 1], out[1, 2] = -z, 0.0, x
    out[2, 0], out[2, 1], out[2, 2] = y, -x, 0.0


@kernel
def fade(
    estimate: Array1D, covariance: Array2D, first: int, factor: float, variance: float
) -> None:
    """One step in which the unknowns from ``first`` on are forgotten towards zero.

    Each follows a process whose correlation over the step is ``factor`` and whose stationary
    variance is ``variance``; the unknowns before ``first`` are constant.
    """
    n = estimate.shape[0]
    fresh = (1.0 - factor * factor) * variance
    for i in range(first, n):
        estimate[i] *= factor
        for k in range(n):
            covariance[i, k] *= factor
            covariance[k, i] *= factor
        covariance[i, i] += fresh


@kernel
def correct_row(
    estimate: Array1D, covariance: Array2D, row: Array1D, residual: float, noise: float, gate: float,
    seen: Array1D,
) -> bool:  # fmt: skip
    """Correct the estimate by one measured number, unless it is an outlier; whether it was used.

    Args:
        estimate, covariance: of the unknowns x, (n,) and (n, n).
        row: h in residual = h x_error + noise, (n,).
        residual: the measurement minus what the estimate gives.
        noise: its standard deviation.
        gate: a residual of more standard deviations than this is not used.
        seen: scratch (n,).
    """
    multiply_vector(covariance, row, seen)
    variance = noise * noise
    for i in range(row.shape[0]):
        variance += row[i] * seen[i]
    if residual * residual > gate * gate * variance:
        return False
    for i in range(row.shape[0]):
        estimate[i] += seen[i] * residual / variance
    for i in range(row.shape[0]):
        for k in range(row.shape[0]):
            share = seen[i] * seen[k] / variance
            covariance[i, k] = covariance[i, k] - share
    return True
