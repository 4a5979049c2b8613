"""The state and the parameters of the invariant Kalman filter."""

from __future__ import annotations

from typing import Literal

from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal


class InvariantEstimate(Signal):
    """The state of the filter. The order of the error is that of ``mathematics/invariant_filter``."""

    orientation = Field(4, unit="", text="quaternion x, y, z, w from body to world")
    vectors = Field(
        ("n_vectors", 3), frame="world",
        text="velocity [m/s], position [m], centres of the contacts' rubber [m]",
    )  # fmt: skip
    present = Field("n_contacts", dtype="bool", text="which contact points are in the state")
    gyro_bias = Field(3, unit="rad/s", frame="body", text="reading minus true value")
    accelerometer_bias = Field(3, unit="m/s^2", frame="body", text="reading minus true value")
    encoder_offset = Field("n_joints", unit="rad", text="joint readings minus true angles")
    covariance = Field(("n_errors", "n_errors"), text="of the error")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="at the last tick, without bias")
    started = Field(dtype="bool", text="whether the first sample has been seen")
    saturated_ticks = Field(dtype="int64", text="ticks with a saturated sample")
    saturated_run = Field(
        6,
        dtype="int64",
        text="ticks in a row that each axis of gyroscope, accelerometer is saturated",
    )


class InvariantFilterParameters(Parameters):
    """Noise of the sensors and of the contacts, and how the filter uses them.

    The noise of a sample is that at the block's rate. The defaults are the noise of the standard
    trial, whose uniform biases and offsets have these standard deviations.
    """

    gyro_noise: float = parameter(0.02, unit="rad/s", gt=0, text="noise of a gyroscope sample")
    gyro_aliasing: float = parameter(
        0.29,
        ge=0,
        text="further noise of a sample, as a share of the rate's change since the last sample",
    )
    accelerometer_noise: float = parameter(
        0.1, unit="m/s^2", gt=0, text="noise of an accelerometer sample"
    )
    gyro_bias: float = parameter(
        0.006, unit="rad/s", ge=0, text="uncertainty of the gyroscope's bias at the start"
    )
    accelerometer_bias: float = parameter(
        0.06, unit="m/s^2", ge=0, text="uncertainty of the accelerometer's bias at the start"
    )
    gyro_bias_walk: float = parameter(
        1e-4, unit="rad/s^2", ge=0, text="random walk of the gyroscope's bias, per root second"
    )
    accelerometer_bias_walk: float = parameter(
        1e-3, unit="m/s^3", ge=0, text="random walk of the accelerometer's bias, per root second"
    )
    encoder_offset: float = parameter(
        0.0017, unit="rad", ge=0, text="uncertainty of the encoders' offsets"
    )
    kinematics_noise: float = parameter(
        2e-4, unit="m", gt=0, text="noise of a contact point's place by leg kinematics, per axis"
    )
    contact_noise: float = parameter(
        1e-4, unit="m", ge=0, text="how far a contact point drifts by itself in a second, per axis"
    )
    slide_noise: float = parameter(
        1e-3, unit="m", ge=0, text="how far a foot slides as a whole in a second, per axis"
    )
    impact_slide: float = parameter(
        0.0,
        unit="s^2",
        ge=0,
        text="further sliding of a foot per specific force beyond gravity",
    )
    gate: float = parameter(
        16.3, gt=0, text="largest normalised squared residual of a contact that is accepted"
    )
    support: float = parameter(
        4.0, unit="m/s^2", text="upward specific force below which no contact is accepted"
    )
    ground: Literal["level", "flat", "unknown"] = parameter(
        "level", text="whether contacts are at equal heights, at height zero, or at any height"
    )
    ground_noise: float = parameter(2e-4, unit="m", gt=0, text="noise of a contact point's height")
    ground_time: float = parameter(
        0.2, unit="s", gt=0, text="correlation time of errors of the ground's height"
    )
    gyro_range: float | None = parameter(
        None, unit="rad/s", gt=0, text="the gyroscope saturates here; none: never"
    )
    accelerometer_range: float | None = parameter(
        None, unit="m/s^2", gt=0, text="the accelerometer saturates here; none: never"
    )
    saturated_rate: float = parameter(
        10.0, unit="rad/s", gt=0, text="standard deviation of a saturated axis of the gyroscope"
    )
    saturated_force: float = parameter(
        100.0, unit="m/s^2", gt=0, text="standard deviation of a saturated accelerometer axis"
    )
