"""What the kernels of the invariant Kalman filter work on."""

from __future__ import annotations

from typing import NamedTuple

from ...mathematics.arrays import Array, Flags, Indices


class Estimate(NamedTuple):
    """The fields of ``InvariantEstimate``."""

    orientation: Array
    vectors: Array
    present: Flags
    gyro_bias: Array
    accelerometer_bias: Array
    encoder_offset: Array
    covariance: Array
    angular_velocity: Array
    started: Flags
    saturated_ticks: Indices
    saturated_run: Indices


class Tuning(NamedTuple):
    """The numbers of ``InvariantFilterParameters``, in which a missing range is infinite, and the
    block's ``period`` [s]."""

    gyro_noise: float
    gyro_aliasing: float
    accelerometer_noise: float
    gyro_bias: float
    accelerometer_bias: float
    gyro_bias_walk: float
    accelerometer_bias_walk: float
    encoder_offset: float
    kinematics_noise: float
    contact_noise: float
    slide_noise: float
    impact_slide: float
    gate: float
    support: float
    ground_noise: float
    ground_time: float
    gyro_range: float
    accelerometer_range: float
    saturated_rate: float
    saturated_force: float
    level: bool
    flat: bool
    period: float


class Points(NamedTuple):
    """The contact points of the robot: ``foot`` and ``radius`` [m] (N,); as the leg kinematics see
    them, ``places`` and ``centres`` (N, 3) [m, body] of their lowest points and of their rubber,
    ``jacobians`` (N, 3, n_joints) of these, ``soles`` (n_feet, 3), the direction ``forward`` (3,), and
    ``levers`` (N, 2): see ``ContactKinematics``."""

    foot: Indices
    radius: Array
    places: Array
    centres: Array
    jacobians: Array
    soles: Array
    forward: Array
    levers: Array


class Samples(NamedTuple):
    """The ``rate`` and the ``force`` of the IMU (3,), their standard deviations ``noise`` (6,), the
    joint ``angles`` without their offsets, and the offsets that were ``used`` for that (n_joints,)."""

    rate: Array
    force: Array
    noise: Array
    angles: Array
    used: Array


class Work(NamedTuple):
    """The constant ``transition`` (n, n) and scratch memory of the size that their uses show."""

    transition: Array
    reach: Array
    scaled: Array
    product: Array
    correction: Array
    sensitivity: Array
    rows: Array
    seen: Array
    gain: Array
    inverse: Array
    corner: Array
    residual: Array
    place_noise: Array
    row_noise: Array
    rotation: Array
    middle_vectors: Array
    world_jacobian: Array
    world_point: Array
    spare: Array
    last_rate: Array
    turn: Array
    middle: Array
    acceleration: Array
    shift: Array
    believed: Flags
    standing: Indices


class Health(NamedTuple):
    """The fields of ``EstimatorHealth``."""

    gyro_saturated: Flags
    accelerometer_saturated: Flags
    saturated_ticks: Indices
    trusted: Flags
    velocity_std: Array
    position_std: Array
    tilt_std: Array
    yaw_std: Array


class Base(NamedTuple):
    """The fields of ``BaseState`` that are estimated."""

    position: Array
    orientation: Array
    linear_velocity: Array
    angular_velocity: Array
