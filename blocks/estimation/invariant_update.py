"""The measurement update of the invariant Kalman filter: by the points that stand, and by the ground."""

from __future__ import annotations

from ...mathematics.arrays import Array2D, Matrix3
from ...mathematics.extended_pose import retract
from ...mathematics.invariant_filter import (
    add_contact,
    height_row,
    innovation,
    measurement_jacobian,
    position_jacobian,
    remove_contact,
    squared_distance,
    update_covariance,
    world_definition_jacobian,
)
from ...mathematics.kernel import kernel
from ...mathematics.rotations import rotate, to_matrix
from ...runtime.language.parameters import Parameters, TwoNumbers, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ContactState, EstimatorHealth

_EXACT = 1e-5
"""Standard deviation [m] of measurements that hold by the definition of the world frame."""
_OPENING = 1.0
"""Process noise of the velocity while no standing point agrees with it [m/s per root second]."""


class InvariantEstimate(Signal):
    """The state of the filter. The order of the error is that of ``mathematics/invariant_filter``."""

    orientation = Field(4, unit="", text="quaternion x, y, z, w from body to world")
    vectors = Field(
        ("n_vectors", 3), frame="world",
        text="velocity [m/s], position [m], centres of the contacts' rubber [m]",
    )  # fmt: skip
    present = Field("n_contacts", dtype="bool", text="contact points in the state")
    gyro_bias = Field(3, unit="rad/s", frame="body", text="reading minus true value")
    accelerometer_bias = Field(3, unit="m/s^2", frame="body", text="reading minus true value")
    encoder_offset = Field("n_joints", unit="rad", text="joint readings minus true angles")
    covariance = Field(("n_errors", "n_errors"), text="of the error")
    angular_velocity = Field(3, unit="rad/s", frame="body", text="at the last tick, without bias")
    started = Field(dtype="bool", text="the first sample has been seen")
    stood = Field(dtype="bool", text="a point has been accepted since the start")
    flown = Field(dtype="bool", text="all points have left the ground since then")
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

    slope: TwoNumbers = parameter(
        (0.0, 0.0),
        unit="rad",
        text="of the ground at the start: this filter begins on level ground only",
    )
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
        1e-4, unit="m", ge=0, text="drift of a contact point by itself in a second, per axis"
    )
    slide_noise: float = parameter(
        1e-3, unit="m", ge=0, text="slide of a foot as a whole in a second, per axis"
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
    level_ground: bool = parameter(
        False, text="also after the first flight all points that stand are at one height"
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


class InvariantConstants(Signal):
    """Constants of the robot's description and the parameters."""

    foot = Field("n_contacts", dtype="int64", text="the foot of each contact point")
    height = Field("n_contacts", unit="m", text="of the tracked points over the ground")
    gradient = Field(2, unit="", text="slope of the ground at the start: zero, it is level")
    heading_levers = Field(("n_contacts", 2), unit="m", text="see ``ContactKinematics``")
    place_noise = Field((3, 3), unit="m^2", text="covariance of a point's measured place")
    gyro_range = Field(unit="rad/s", text="the gyroscope saturates here; infinite: never")
    accelerometer_range = Field(unit="m/s^2", text="the accelerometer saturates here")
    transition = Field(
        ("n_errors", "n_errors"),
        text="F of the error; a tick writes the columns of the biases",
    )


class InvariantScratch(Signal):
    """Intermediate values of a tick; symbols are those of ``mathematics/invariant_filter``."""

    rate = Field(3, unit="rad/s", frame="body", text="the gyroscope's sample within limits")
    force = Field(3, unit="m/s^2", frame="body", text="the accelerometer's, without its bias")
    noise = Field(6, text="standard deviations of both samples")
    angles = Field("n_joints", unit="rad", text="joint angles without their offsets")
    used_offset = Field("n_joints", unit="rad", text="the offsets that were subtracted")
    offset_change = Field("n_joints", unit="rad", text="the present offsets minus these")
    last_rate = Field(3, unit="rad/s", frame="body", text="angular velocity of the tick before")
    middle = Field(4, text="orientation in the middle of the tick")
    middle_vectors = Field(("n_vectors", 3), frame="world", text="vectors in its middle")
    acceleration = Field(3, unit="m/s^2", frame="world", text="of the base")
    rotation = Field((3, 3), text="the orientation as a matrix")
    input_jacobian = Field(("n_errors", 6), text="effect of the samples' errors")
    scaled = Field(("n_errors", 6), text="the same times their noise")
    product = Field(("n_errors", "n_errors"), text="F P")
    centres = Field(("n_contacts", 3), unit="m", frame="body", text="the tracked points")
    centre_jacobians = Field(("n_contacts", 3, "n_joints"), unit="m", frame="body", text="theirs")
    world_jacobian = Field((3, "n_joints"), unit="m", frame="world", text="R J of one point")
    world_point = Field(3, unit="m", frame="world", text="from the base to one point")
    believed = Field("n_contacts", dtype="bool", text="active points while there is support")
    standing = Field("n_contacts", dtype="int64", text="points whose heights are used")
    jacobian = Field((3, "n_errors"), text="H")
    row_noise = Field((3, 3), text="N")
    residual = Field(3, text="r")
    cross_covariance = Field(("n_errors", 3), text="P H'")
    inverse = Field((3, 3), text="inverse of S")
    gain = Field(("n_errors", 3), text="K")
    correction = Field("n_errors", text="K r")
    rows = Field((3, "n_errors"), text="H P")
    block = Field((3, 3), text="a matrix")
    vector = Field(3, text="a vector")
    turn = Field(4, text="quaternion of a correction")


@kernel
def use_contacts(
    contacts: ContactState,
    estimate: InvariantEstimate,
    params: InvariantFilterParameters,
    constants: InvariantConstants,
    scratch: InvariantScratch,
    health: EstimatorHealth,
    period: float,
) -> None:
    """Correct by the points that stand; remove those that do not, and add those that come."""
    rotate(estimate.orientation, scratch.force, scratch.vector)
    supported = scratch.vector[2] >= params.support or health.accelerometer_saturated
    refused = agreed = False
    for point in range(constants.foot.shape[0]):
        scratch.believed[point] = supported and contacts.active[point]
        health.trusted[point] = False
        if not estimate.present[point]:
            continue
        if scratch.believed[point]:
            measure_point(point, estimate, scratch)
            measurement_jacobian(point, scratch.jacobian)
            innovation(point, scratch.world_point, estimate.vectors, scratch.residual)
            if weigh_residual(constants.place_noise, estimate, scratch) <= params.gate:
                correct_estimate(constants.place_noise, estimate, scratch)
                health.trusted[point] = agreed = True
                continue
            refused = True
        estimate.present[point] = False
        remove_contact(point, estimate.covariance)
    if refused and not agreed:
        for k in range(3, 6):
            estimate.covariance[k, k] += _OPENING * _OPENING * period
    add_contacts(estimate, constants, scratch)
    standing = False
    for point in range(constants.foot.shape[0]):
        standing = standing or estimate.present[point]
    estimate.flown = estimate.flown or (estimate.stood and not standing)
    estimate.stood = estimate.stood or agreed


@kernel
def measure_point(point: int, estimate: InvariantEstimate, scratch: InvariantScratch) -> None:
    """Measure a point's position relative to the base, in the world, and its Jacobian."""
    jacobian = scratch.centre_jacobians[point]
    scratch.world_jacobian[:] = scratch.rotation @ jacobian
    # Corrected for changes of the encoder offsets since the kinematics were evaluated.
    scratch.offset_change[:] = estimate.encoder_offset - scratch.used_offset
    scratch.vector[:] = scratch.centres[point] - jacobian @ scratch.offset_change
    scratch.world_point[:] = scratch.rotation @ scratch.vector
    offsets = estimate.covariance.shape[0] - estimate.encoder_offset.shape[0]
    position_jacobian(scratch.world_jacobian, offsets, scratch.jacobian)


@kernel
def add_contacts(
    estimate: InvariantEstimate, constants: InvariantConstants, scratch: InvariantScratch
) -> None:
    """Add the points that are believed and not yet in the state."""
    for point in range(constants.foot.shape[0]):
        if not scratch.believed[point] or estimate.present[point]:
            continue
        measure_point(point, estimate, scratch)
        add_contact(
            point, scratch.jacobian, constants.place_noise, estimate.covariance, scratch.rows,
            scratch.block,
        )  # fmt: skip
        estimate.vectors[2 + point, :] = estimate.vectors[1] + scratch.world_point
        estimate.present[point] = True


@kernel
def define_world(
    estimate: InvariantEstimate,
    params: InvariantFilterParameters,
    constants: InvariantConstants,
    scratch: InvariantScratch,
) -> None:
    """Apply the definition of the world frame as measurements: all points are at height zero,
    their mean is the origin, and x is the mean heading of the feet."""
    count, noise = constants.foot.shape[0], scratch.row_noise
    for point in range(count):
        scratch.standing[point] = point
    variance = params.ground_noise * params.ground_noise
    for first in range(0, count, 3):
        last = min(first + 3, count)
        correct_heights(first, last, -1, variance, estimate, constants, scratch)
    world_definition_jacobian(constants.heading_levers, estimate.vectors, scratch.jacobian)
    scratch.residual[:] = 0.0
    noise[:] = 0.0
    for k in range(3):
        noise[k, k] = _EXACT * _EXACT
    weigh_residual(noise, estimate, scratch)
    correct_estimate(noise, estimate, scratch)


@kernel
def use_ground(
    estimate: InvariantEstimate,
    params: InvariantFilterParameters,
    constants: InvariantConstants,
    scratch: InvariantScratch,
    health: EstimatorHealth,
    period: float,
) -> None:
    """Correct by the heights of the points that stand: they are equal."""
    count, reference = 0, -1
    for point in range(constants.foot.shape[0]):
        if not health.trusted[point]:
            continue
        if reference < 0:
            reference = point
            continue
        scratch.standing[count] = point
        count += 1
    variance = params.ground_noise * params.ground_noise
    variance *= max(params.ground_time / period, 1.0)
    for first in range(0, count, 3):
        last = min(first + 3, count)
        correct_heights(first, last, reference, variance, estimate, constants, scratch)


@kernel
def correct_heights(
    first: int,
    last: int,
    reference: int,
    variance: float,
    estimate: InvariantEstimate,
    constants: InvariantConstants,
    scratch: InvariantScratch,
) -> None:
    """Correct by the heights of up to three points, over the reference point or over zero.

    The points are those from ``first`` to before ``last`` in ``scratch.standing``.
    """
    noise = scratch.row_noise
    scratch.residual[:] = 0.0
    scratch.jacobian[:] = 0.0
    noise[:] = 0.0
    for row in range(3):
        noise[row, row] = 1.0
    shared = variance if reference >= 0 else 0.0
    for row in range(last - first):
        point = scratch.standing[first + row]
        height = constants.height[point]
        if reference >= 0:
            height -= constants.height[reference]
        height_row(
            row, point, reference, height, estimate.vectors, scratch.jacobian, scratch.residual
        )
        for column in range(last - first):
            noise[row, column] = shared + (variance if row == column else 0.0)
    weigh_residual(noise, estimate, scratch)
    correct_estimate(noise, estimate, scratch)


@kernel
def weigh_residual(noise: Array2D, estimate: InvariantEstimate, scratch: InvariantScratch) -> float:
    """Return the squared Mahalanobis distance of the residual."""
    return squared_distance(
        estimate.covariance, scratch.jacobian, noise, scratch.residual, scratch.cross_covariance,
        scratch.inverse, scratch.block,
    )  # fmt: skip


@kernel
def correct_estimate(
    noise: Matrix3, estimate: InvariantEstimate, scratch: InvariantScratch
) -> None:
    """Correct the estimate and its covariance by the residual that has just been weighed."""
    correction = scratch.correction
    update_covariance(
        estimate.covariance, scratch.jacobian, noise, scratch.residual, scratch.cross_covariance,
        scratch.inverse, scratch.gain, correction,
    )  # fmt: skip
    retract(correction, estimate.orientation, estimate.vectors, scratch.turn, scratch.vector)
    offsets = estimate.covariance.shape[0] - estimate.encoder_offset.shape[0]
    estimate.gyro_bias[:] += correction[offsets - 6 : offsets - 3]
    estimate.accelerometer_bias[:] += correction[offsets - 3 : offsets]
    estimate.encoder_offset[:] += correction[offsets:]
    to_matrix(estimate.orientation, scratch.rotation)
