"""What ``MassEstimator`` does in every tick, as kernels: filters, and the equations' corrections."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Array2D,
    Array3D,
    Flags0D,
    Flags1D,
    Indices0D,
    Indices1D,
    Indices2D,
    Matrix3,
    Rows3,
    Vector3,
    Vector4,
)
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ...mathematics.linear_algebra import multiply_vector
from ...mathematics.mass_filter import (
    BaseForceScratch,
    base_force_map,
    correct_row,
    fade,
    split_friction,
    torso_moment,
)
from ..signals import Phase

SCALE, COM, TILT, FRICTION = 0, 1, 4, 6
"""Where the unknowns begin: the factor on all masses; the offset of the torso's CoM [m] (3); the
error of the estimated tilt [rad] (2); by joint its unknown friction, as a share of its friction."""

_SQUAT = int(Phase.SQUAT)


class Measured(NamedTuple):
    """The fields of ``DynamicsTerms``, ``JointState`` and ``PhaseState`` that the equations take."""

    phase: Indices0D
    stance: Flags1D
    velocity: Array1D
    torque: Array1D
    mass_matrix: Array2D
    nonlinear: Array1D
    jacobian: Array3D
    base_rotation: Matrix3
    com: Vector3
    foot_position: Rows3


class Memory(NamedTuple):
    """The fields of ``MassMemory``."""

    velocity: Array1D
    torque: Array1D
    unknowns: Array1D
    covariance: Array2D
    published: Vector4
    ticks: Indices0D
    over: Flags0D


class Model(NamedTuple):
    """Of the robot: masses of all links and of the torso [kg], the joints' friction [N m] and damping
    [N m s/rad], the foot of each contact point, and the joints of each foot's leg."""

    mass: float
    torso: float
    friction: Array1D
    damping: Array1D
    foot_of_point: Indices1D
    chains: Indices2D


class Settings(NamedTuple):
    """Numbers of the filter.

    ``every`` and ``settled`` are ticks, ``filter`` and ``follow`` shares in a tick, ``kept`` the share of
    the unknown friction that stays between two measurements; ``noise`` (6,) [N, N m];
    ``rotation_noise`` the standard deviation of the base's filtered angular acceleration [rad/s^2].
    """

    period: float
    every: int
    settled: int
    filter: float
    follow: float
    kept: float
    friction_share: float
    friction_speed: float
    friction_left: float
    gate: float
    noise: Array1D
    rotation_noise: float


class Scratch(NamedTuple):
    """For n joints and s unknowns: ``map`` (6, n), ``rows`` (6, s), ``acceleration`` and ``force``
    (6 + n,), ``known``, ``unknown`` and ``joint`` (n,), ``base`` and ``residual`` (6,), ``seen`` (s,)."""

    leg: BaseForceScratch
    map: Array2D
    rows: Array2D
    acceleration: Array1D
    force: Array1D
    known: Array1D
    unknown: Array1D
    joint: Array1D
    base: Array1D
    residual: Array1D
    seen: Array1D


@kernel
def publish_mass(
    mass: float,
    memory: Memory,
    out: Array0D,
    deviation: Array0D,
    offset: Vector3,
    offset_std: Vector3,
) -> None:
    """Write the estimate's ``mass`` and ``deviation`` () [kg], and the torso's offset (3,) [m]."""
    # Rounding may leave a variance that is all but zero just below it.
    out[()] = mass * memory.published[0]
    deviation[()] = mass * math.sqrt(max(memory.covariance[SCALE, SCALE], 0.0))
    for k in range(3):
        offset[k] = memory.published[1 + k]
        offset_std[k] = math.sqrt(max(memory.covariance[COM + k, COM + k], 0.0))


@kernel
def follow_mass(
    measured: Measured, memory: Memory, model: Model, settings: Settings, scratch: Scratch
) -> None:
    """One tick: filter velocity and torque, correct the estimate where it is due, publish it."""
    joints, ticks = memory.torque.shape[0], memory.ticks[()]
    if ticks == 0:
        memory.velocity[:] = measured.velocity
        for i in range(joints):
            memory.torque[i] = measured.torque[i]
    if measured.phase[()] > _SQUAT:
        memory.over[()] = True
    if not memory.over[()]:
        ticks += 1
        memory.ticks[()] = ticks
        for i in range(memory.velocity.shape[0]):
            change = (measured.velocity[i] - memory.velocity[i]) * settings.filter
            memory.velocity[i] = memory.velocity[i] + change
            scratch.acceleration[i] = change / settings.period
        for i in range(joints):
            change = (measured.torque[i] - memory.torque[i]) * settings.filter
            memory.torque[i] = memory.torque[i] + change
        stands = False
        for point in range(measured.stance.shape[0]):
            stands = stands or bool(measured.stance[point])
        if stands and ticks % settings.every == 0 and ticks >= settings.settled:
            correct_mass(measured, memory, model, settings, scratch)
    for k in range(4):
        change = (memory.unknowns[k] - memory.published[k]) * settings.follow
        memory.published[k] = memory.published[k] + change


@kernel
def correct_mass(
    measured: Measured, memory: Memory, model: Model, settings: Settings, scratch: Scratch
) -> None:
    """Correct the estimate by the six equations of this instant."""
    share = settings.friction_share
    fade(memory.unknowns, memory.covariance, FRICTION, settings.kept, share * share)
    form_rows(measured, memory, model, settings, scratch)
    for k in range(6):
        expected = 0.0
        for i in range(memory.unknowns.shape[0]):
            value = memory.unknowns[i]
            if i < TILT:
                value -= memory.published[i]
            expected += value * scratch.rows[k, i]
        # The gyroscope's noise moves the residual by the inertia times the noise of the acceleration.
        variance = settings.noise[k] * settings.noise[k]
        for j in range(3, 6):
            moved = measured.mass_matrix[k, j] * settings.rotation_noise
            variance += moved * moved
        correct_row(
            memory.unknowns, memory.covariance, scratch.rows[k],
            -scratch.residual[k] - expected, math.sqrt(variance), settings.gate,
            scratch.seen,
        )  # fmt: skip


@kernel
def form_rows(
    measured: Measured, memory: Memory, model: Model, settings: Settings, scratch: Scratch
) -> None:
    """The equations' residual at the published estimate without the unknown parts of tilt and
    friction, and its derivative by the unknowns.

    The derivatives are those at rest: noise of the acceleration in them would bias the result.
    """
    joints, rows, force = memory.torque.shape[0], scratch.rows, scratch.force
    base_force_map(
        measured.jacobian, measured.stance, model.foot_of_point, model.chains, scratch.leg,
        scratch.map,
    )  # fmt: skip
    split_friction(
        memory.velocity[6:], model.friction, model.damping, settings.friction_speed,
        settings.friction_left, scratch.known, scratch.unknown,
    )  # fmt: skip
    multiply_vector(measured.mass_matrix, scratch.acceleration, force)
    force[:] = force + measured.nonlinear
    for j in range(joints):
        left = memory.torque[j] - scratch.known[j]
        scratch.joint[j] = left - force[6 + j]
    multiply_vector(scratch.map, scratch.joint, scratch.residual)
    multiply_vector(scratch.map, measured.nonlinear[6:], scratch.base)
    scale = memory.published[0]
    for k in range(6):
        scratch.residual[k] = scratch.residual[k] + force[k]
        rows[k, SCALE] = (measured.nonlinear[k] - scratch.base[k]) / scale
    torso_moment(measured.base_rotation, scale * model.torso * GRAVITY, rows[3:, COM:TILT])
    lowest = measured.foot_position[0, 2]
    for foot in range(1, measured.foot_position.shape[0]):
        lowest = min(lowest, measured.foot_position[foot, 2])
    moment = scale * model.mass * GRAVITY * (measured.com[2] - lowest)
    rows[3, TILT], rows[4, TILT + 1] = moment, moment
    for k in range(6):
        for j in range(joints):
            friction = scratch.unknown[j] * model.friction[j]
            rows[k, FRICTION + j] = -(scratch.map[k, j] * friction)
