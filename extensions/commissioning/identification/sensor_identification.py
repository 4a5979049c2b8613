"""Identification of IMU and encoders from a run in which the robot sways over standing feet.

The feet stand still, so the joints' velocities say how the base moves, and the IMU's readings follow::

    w(t) = w_b + w_b x p - d w_b' + b              p: the IMU's angle, d: its age, b: its bias
    f(t) = f_b + f_b x p + w' x r + w x (w x r) - d f_b' + s f_b + b

for the velocity w_b and the specific force f_b of the base's origin; r is the IMU's place, s are errors
of scale. An encoder on the motor, before a gear with play, differs from the joint by half of the play on the side
of the torque, and turns once a turn by its eccentricity. A gear that yields turns the joint by its torque times a
compliance, so the base moves by what no encoder before the gear tells, and the gyroscope does. Everything is linear in what is unknown, and
all signals pass the same filter, forwards and backwards, which takes noise away and no time.

The IMU's angle is found from the gyroscope. The accelerometer's vertical is the gyroscope's, integrated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....mathematics.arrays import Array
from ....mathematics.constants import GRAVITY
from ....mathematics.linear_systems import first_order, second_order
from ....robots.kinematics import ball_feet
from ....robots.pinocchio_model import build_pinocchio_model
from ....robots.robot_description import RobotDescription
from ....robots.transmission import PLAY_TIME, PLAY_TORQUE
from .identification import Estimate, IdentificationError, MeasuredRun

CUTOFF = 6.0
"""Cutoff of the filter that all signals pass [Hz]."""
PADDING = 12
"""Ticks by which columns go on at both ends while they are filtered."""
EDGE = 0.3
"""The time at both ends that the filter spoils [s]."""
ROUNDS = 2
"""The fit is repeated with what was found, so that what was neglected is small."""
CORRELATED = 3.0 / (2.0 * CUTOFF)
"""Errors are independent after this time [s]: three times that of filtered noise, as feet rock and rotors
cross their play for some 0.1 s. Robots that were drawn lie within the standard deviations that follow."""
ITERATIONS = 8
"""Iterations of a fit, as the weights follow from the residuals."""
TYPICAL = 1.4826
"""The standard deviation of normal numbers over the median of their sizes."""
OUTLYING = 1.5
"""Ticks with errors beyond so many standard deviations count less, as when a foot rocks on the ground."""
NOISE_CUTOFF = 20.0
"""Frequency above which velocities are noise alone [Hz]."""
SAMPLED = 0.02
"""The time between samples of the angles that are fitted [s]."""
HIDDEN_TORQUE = 0.1
"""Torque that currents do not show, such as ripple [N m]: with no more than this a rotor may be anywhere in its
play.
"""
USUAL_PLAY, RESOLVED = 0.01, 2e-4
"""Play by which the error of an unseated rotor is weighted, and an encoder's best resolution [rad]."""
USUAL_COMPLIANCE = 2e-3
"""The compliance of gears is of this size beforehand [rad/(N m)]."""
LEAST_COMPLIANCE = 3e-4
"""Least standard deviation of a compliance [rad/(N m)]: play that is not seated looks like one."""
LEAST_AGE, LEAST_PLAY = 1.5e-4, 1.5e-3
"""Least standard deviations of an age [s] and of a play [rad]."""

STOOD = 3.0
"""Shortest stance that suffices [s]."""


@dataclass(frozen=True)
class IdentifiedSensors:
    """Identified sensors.

    Attributes:
        imu_position: from the base's origin [m, base].
        imu_rotation: the rotation vector from the base's axes to the IMU's [rad].
        gyro_age, accelerometer_age, velocity_age: of the readings, beside those of the joints' angles [s].
        play: of the gear before each encoder, by joint [rad].
        gear_compliance: of all gears, behind the encoders [rad/(N m)].
        residuals: root mean squares of what is not explained, by sensor [rad/s, m/s^2].
    """

    imu_position: tuple[Estimate, ...]
    imu_rotation: tuple[Estimate, ...]
    gyro_age: Estimate
    accelerometer_age: Estimate
    velocity_age: Estimate
    play: dict[str, Estimate]
    gear_compliance: Estimate
    residuals: dict[str, float]


def smooth(values: Array, period: float, cutoff: float = CUTOFF) -> Array:
    """Filter columns by a Butterworth filter of the third order that goes forwards and backwards.

    At both ends they go on as their reflection through the end, as in SciPy's ``sosfiltfilt``, whose package takes 2 s to
    import. Each section is a banded system of equations in its outputs.
    """
    ends = 2.0 * values[0] - values[PADDING:0:-1], 2.0 * values[-1] - values[-2 : -PADDING - 2 : -1]
    columns = np.asfortranarray(np.concatenate([ends[0], values, ends[1]]))
    low, resonant = np.empty(5), np.empty(5)
    first_order(cutoff, period, False, low)
    second_order(cutoff, 0.5, period, False, resonant)
    for _ in range(2):
        first = columns[0].copy()  # at rest at the first values
        columns = columns - first
        for section in (low, resonant):
            columns = _filtered(section[:3], np.array([1.0, *section[3:]]), columns)
        columns = np.asfortranarray((columns + first)[::-1])
    return np.ascontiguousarray(columns[PADDING:-PADDING])


def _filtered(numerator: Array, denominator: Array, columns: Array) -> Array:
    """Filter columns by a recursive filter that begins with zeros."""
    from scipy.linalg.lapack import dtbtrs

    right = numerator[0] * columns
    for late, factor in enumerate(numerator[1:], 1):
        right[late:] += factor * columns[:-late]
    band = np.repeat(denominator[:, None], len(columns), axis=1)
    return np.asarray(dtbtrs(band, right, uplo="L", overwrite_b=True)[0])


def slope(values: Array, period: float) -> Array:
    """Return the time derivatives of columns."""
    return np.asarray(np.gradient(values, period, axis=0))


def shifted(values: Array, ticks: float) -> Array:
    """Shift columns by a number of ticks, interpolated linearly between ticks."""
    n = np.arange(len(values), dtype=np.float64)
    return np.array([np.interp(n + ticks, n, column) for column in values.T]).T


def standing_span(robot: RobotDescription, motion: MeasuredRun) -> slice:
    """Return the longest time in which every foot has a closed switch, up to bounces of some ticks.

    Where that is too short the switches are too heavy for their loads, as a sway lifts no foot, and a closed
    switch of any foot counts.
    """
    owners = np.array([contact.foot for contact in robot.contacts])
    closed = [motion.closed[:, owners == foot].any(axis=1) for foot in dict.fromkeys(owners)]
    for loaded in (np.all(closed, axis=0), np.any(closed, axis=0)):
        start, end = _longest(loaded, motion.period)
        if (end - start) * motion.period >= STOOD:
            return slice(start, end)
    if end == start:
        raise IdentificationError("the robot never stands on its feet")
    raise IdentificationError(
        f"the robot stands for less than {STOOD:g} s on its feet: let it sway (blocks.SwayReference)"
    )


def _longest(loaded: NDArray[np.bool_], period: float) -> tuple[int, int]:
    """Return the first tick of the longest stance and the one after its last."""
    window = max(3, round(0.2 / period))
    share = np.convolve(loaded, np.ones(window) / window, mode="same")
    firm = np.concatenate([[False], share > 0.3, [False]])
    spans = np.flatnonzero(np.diff(firm.astype(np.int64))).reshape(-1, 2).tolist()
    start, end = max(spans, key=lambda span: int(span[1] - span[0]), default=(0, 0))
    return start, end


def identify_sensors(robot: RobotDescription, motion: MeasuredRun) -> IdentifiedSensors:
    """Fit the IMU's place, angle and ages, the age of the joints' velocities, and the encoders' play.

    Raises:
        IdentificationError: the robot does not sway on standing feet for long enough.
    """
    span = standing_span(robot, motion)
    torque = motion.torque[span]
    play, velocity_age, encoder_left = _encoders(robot, motion, span)
    ends = play_positions(torque, motion.period)
    width = np.array([each.value for each in play.values()])
    position = motion.position[span] - 0.5 * width * ends
    period = motion.period
    late = slope(smooth(torque, period), period)
    moves, yields, places = base_motion(robot, position, motion.velocity[span], late)
    base = smooth(np.hstack([moves, places]), period)
    gyro, force = (
        smooth(motion.angular_velocity[span], period),
        smooth(motion.specific_force[span], period),
    )
    turn, gyro_late, gyro_left, compliance = _gyroscope(base[:, 3:6], gyro, yields[:, 3:], period)
    angle = np.array([each.value for each in turn])
    place, force_late, force_left = _accelerometer(
        base, gyro, force, angle, gyro_late.value, period
    )
    joint = velocity_age
    # The base's velocity comes from the joints' and is as old as they are; the accelerometer's mean over a tick
    # is half a tick older than a sample.
    return IdentifiedSensors(
        place, turn, _sum(gyro_late, joint), _sum(force_late, joint, -0.5 * period), joint, play,
        compliance, {"velocity": encoder_left, "gyroscope": gyro_left, "accelerometer": force_left},
    )  # fmt: skip


def _sum(first: Estimate, second: Estimate, more: float = 0.0) -> Estimate:
    return Estimate(first.value + second.value + more, math.hypot(first.std, second.std, LEAST_AGE))


def play_positions(torque: Array, period: float) -> Array:
    """Return the place of each rotor in its play, from -1 to 1, by the torques."""
    ends = np.tanh(torque / PLAY_TORQUE)
    out, share = np.empty_like(ends), -math.expm1(-period / PLAY_TIME)
    here = ends[0]
    for k, end in enumerate(ends):
        here = here + share * (end - here)
        out[k] = here
    return out


def _encoders(
    robot: RobotDescription, motion: MeasuredRun, span: slice
) -> tuple[dict[str, Estimate], Estimate, float]:
    """Return the play of every joint and the age of the velocities beside the angles, and what is left [rad/s].

    The angles less the integrated velocities are fitted. Noise of the velocities makes a random walk of them; where
    a torque is so small that what is not measured of it may move the rotor across its play, they are
    uncertain. So the errors have a known covariance, by which the equations are whitened.
    """
    period, n = motion.period, len(robot.joints)
    every = round(SAMPLED / period)
    speed, angle = motion.velocity[span], motion.position[span]
    mean = 0.5 * period * (speed[1:] + speed[:-1])
    walked = np.concatenate([np.zeros((1, n)), np.cumsum(mean, axis=0)])
    ends = play_positions(motion.torque[span], period)
    torque = smooth(motion.torque[span], period)
    smoothed = smooth(speed, period)
    inner = _inner(len(angle), period)
    at = np.arange(inner.start, inner.stop, every)
    seat = 0.25 * USUAL_PLAY * (
        np.tanh((torque[at] + HIDDEN_TORQUE) / PLAY_TORQUE)
        - np.tanh((torque[at] - HIDDEN_TORQUE) / PLAY_TORQUE)
    )  # fmt: skip
    noise = (speed - smooth(speed, period, NOISE_CUTOFF))[inner].std(axis=0) * math.sqrt(period)
    time = period * (at - at[0])
    walk = np.minimum(time[:, None], time[None, :])
    count = 1 + 3 * n
    prior = np.array([0.01, *np.tile([0.01, 0.004, 0.004], n)])
    normal, right, squares = np.diag(prior**-2.0), np.zeros(count), 0.0
    for joint in range(n):
        rows = np.zeros((len(at), count))
        rows[:, 0] = smoothed[at, joint]
        own = 1 + 3 * joint
        rows[:, own] = 0.5 * ends[at, joint]
        rows[:, own + 1] = np.sin(angle[at, joint])
        rows[:, own + 2] = np.cos(angle[at, joint])
        left = (angle - walked)[at, joint]
        errors: Array = noise[joint] ** 2 * walk + np.diag(seat[:, joint] ** 2 + RESOLVED**2)
        # angle and integral have no common zero: a constant may be anything
        white = np.linalg.cholesky(errors + (left.max() - left.min() + 1.0) ** 2)
        unit = np.linalg.solve(white, np.column_stack([rows, left - left.mean()]))
        rows, left = unit[:, :-1], unit[:, -1]
        own_normal = rows.T @ rows + np.diag(prior**-2.0)
        found = np.linalg.solve(own_normal, rows.T @ left)
        size = max(1.0, float(np.mean((left - rows @ found) ** 2)))
        normal, right = normal + rows.T @ rows / size, right + rows.T @ left / size
        squares += size
    covariance = np.linalg.inv(normal)
    found, std = covariance @ right, np.sqrt(np.diag(covariance))
    play = {
        joint.name: Estimate(
            max(0.0, float(found[1 + 3 * k])), math.hypot(std[1 + 3 * k], LEAST_PLAY)
        )
        for k, joint in enumerate(robot.joints)
    }
    left = float(np.sqrt(squares / n) * noise.mean() / math.sqrt(period))
    return play, Estimate(float(found[0]), math.hypot(std[0], LEAST_AGE)), left


def base_motion(robot: RobotDescription, position: Array, *velocities: Array) -> tuple[Array, ...]:
    """Return the base over standing feet: for each of the joints' ``velocities`` (n, n_joints) its own, linear and
    angular in its own frame, (n, 6); last the middle of the contact points in that frame, (n, 3).
    """
    jacobians, places = contact_jacobians(robot, position)
    of_base, of_joints = jacobians[..., :6], jacobians[..., 6:]
    across = of_base.transpose(0, 2, 1)
    found = [
        np.linalg.solve(across @ of_base, across @ (of_joints @ -each[..., None]))[..., 0]
        for each in velocities
    ]
    return *found, places.mean(axis=1)


def contact_jacobians(robot: RobotDescription, position: Array) -> tuple[Array, Array]:
    """Return the Jacobians of all contact points, (n, 3 n_contacts, n_velocities), and their places in the base's
    frame, (n, n_contacts, 3), for the joints' angles (n, n_joints).

    A ball touches the ground below its centre and rolls. Where is below is told by three balls or more; with fewer
    the base is taken for level.
    """
    import pinocchio as pin

    built = build_pinocchio_model(robot)
    model: Any = built.model
    data: Any = model.createData()
    q, world = np.zeros(model.nq), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    count = len(built.contact_frames)
    jacobians = np.empty((len(position), count, 6, model.nv))
    places = np.empty((len(position), count, 3))
    turned = np.empty((len(position), count, 3, 3))
    q[6] = 1.0
    for k, angles in enumerate(position):
        q[7:] = angles
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        for point, frame in enumerate(built.contact_frames):
            jacobians[k, point] = pin.getFrameJacobian(model, data, frame, world)
            places[k, point] = data.oMf[frame].translation
            turned[k, point] = data.oMf[frame].rotation
    moving = jacobians[:, :, :3]
    if balls := ball_feet(robot):
        at = [ball.point for ball in balls]
        radius = np.array([ball.radius for ball in balls])
        to_centre = np.array([ball.centre - robot.contacts[ball.point].position for ball in balls])
        centres = places[:, at] + (turned[:, at] @ to_centre[..., None])[..., 0]
        lowest = centres - radius[:, None] * _up(centres)[:, None]
        lever = lowest - places[:, at]
        moving[:, at] -= cross_matrices(lever) @ jacobians[:, at, 3:]
        places[:, at] = lowest
    return moving.reshape(len(position), 3 * count, -1), places


def _up(centres: Array) -> Array:
    """Return the vertical by the plane through the centres (n, balls, 3), (n, 3)."""
    if centres.shape[1] < 3:
        return np.tile([0.0, 0.0, 1.0], (len(centres), 1))
    apart = centres - centres.mean(axis=1, keepdims=True)
    normal = np.linalg.eigh(apart.transpose(0, 2, 1) @ apart)[1][:, :, 0]
    return np.asarray(normal * np.sign(normal[:, 2:]))


def _gyroscope(
    base: Array, gyro: Array, yields: Array, period: float
) -> tuple[tuple[Estimate, ...], Estimate, float, Estimate]:
    """Return the angle and age of the gyroscope beside the joints' velocities, what is left, and the compliance of the
    gears; ``yields`` is how the base turns for a compliance of one.
    """
    inner = _inner(len(base), period)
    angle, late, compliance = np.zeros(3), 0.0, 0.0
    left, covariance = 0.0, np.eye(11)
    for _ in range(ROUNDS):
        moved = shifted(base - compliance * yields, -late / period)
        turned = moved + np.cross(moved, angle)
        rows = np.zeros((len(base), 3, 11))
        rows[:, :, :3] = -cross_matrices(moved).transpose(0, 2, 1)
        rows[:, :, 3] = -slope(moved, period)
        rows[:, :, 4:7] = np.eye(3)
        for axis in range(3):
            rows[:, axis, 7 + axis] = moved[:, axis]
        rows[:, :, 10] = -yields
        prior = np.array([0.03, 0.03, 0.03, 0.01, *[0.02] * 6, USUAL_COMPLIANCE])
        found, covariance, left = fit(rows[inner], (gyro - turned)[inner], prior, period)
        angle, late = angle + found[:3], late + float(found[3])
        compliance += float(found[10])
    std = np.sqrt(np.diag(covariance))
    return (
        _three(angle, std[:3]), Estimate(late, float(std[3])), left,
        Estimate(compliance, math.hypot(std[10], LEAST_COMPLIANCE)),
    )  # fmt: skip


def _accelerometer(
    base: Array, gyro: Array, force: Array, angle: Array, gyro_late: float, period: float
) -> tuple[tuple[Estimate, ...], Estimate, float]:
    """Return the place and age of the accelerometer beside the joints' velocities."""
    turning = shifted(gyro, gyro_late / period)
    turning = turning - np.cross(turning, angle)
    turning = turning - (turning - base[:, 3:6])[_inner(len(base), period)].mean(axis=0)
    up, tilts, drifts = vertical(turning, period)
    bend = slope(turning, period)
    # The feet rock a little on the ground: the gyroscope sees it, and the joints do not.
    moving = base[:, :3] - np.cross(turning - base[:, 3:6], base[:, 6:])
    linear = slope(moving, period) + np.cross(turning, moving)
    at_origin = smooth(linear + GRAVITY * up, period)
    inner = _inner(len(base), period)
    late, left, covariance, place = 0.0, 0.0, np.eye(15), np.zeros(3)
    for _ in range(ROUNDS):
        lever = cross_matrices(bend) + np.einsum(
            "kij,kjl->kil", cross_matrices(turning), cross_matrices(turning)
        )
        here = at_origin + lever @ place
        felt = shifted(here + np.cross(here, angle), -late / period)
        rows = np.zeros((len(base), 3, 15))
        rows[:, :, :3] = lever
        rows[:, :, 3] = -slope(felt, period)
        rows[:, :, 4:7] = np.eye(3)
        for axis in range(3):
            rows[:, axis, 7 + axis] = felt[:, axis]
        rows[:, :, 10:12] = GRAVITY * tilts
        rows[:, :, 12:15] = GRAVITY * drifts
        prior = np.array([0.02] * 3 + [0.01] + [0.1] * 3 + [0.02] * 3 + [0.1] * 2 + [0.005] * 3)
        found, covariance, left = fit(rows[inner], (force - felt)[inner], prior, period)
        place, late = place + found[:3], late + float(found[3])
    std = np.sqrt(np.diag(covariance))
    return _three(place, std[:3]), Estimate(late, float(std[3])), left


def vertical(turning: Array, period: float) -> tuple[Array, Array, Array]:
    """Return the vertical in the base's frame by integration from level; how it changes with the tilt at first (n, 3,
    2), and with biases of the gyroscope (n, 3, 3).
    """
    n = len(turning)
    middle = np.concatenate([0.5 * (turning[1:] + turning[:-1]), turning[-1:]]) * period
    steps = np.eye(3) + _rotation_beyond(middle)
    turned = np.empty((n, 3, 3))  # from the base's axes to the world's
    turned[0] = np.eye(3)
    for k in range(1, n):
        np.matmul(turned[k - 1], steps[k - 1], out=turned[k])
    drift = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(turned[:-1] * period, axis=0)])
    leaning = turned.transpose(0, 2, 1) @ cross_matrices(np.array([0.0, 0.0, 1.0]))
    return turned[:, 2], leaning[..., :2], leaning @ drift


def _rotation_beyond(vectors: Array) -> Array:
    """Return the matrices of rotation vectors (n, 3), less the identity, (n, 3, 3)."""
    angle = np.linalg.norm(vectors, axis=1)[:, None, None]
    safe = np.maximum(angle, 1e-9)
    across = cross_matrices(vectors)
    return np.asarray(
        np.sin(safe) / safe * across + 2.0 * (np.sin(0.5 * safe) / safe) ** 2 * (across @ across)
    )


def fit(
    rows: Array, right: Array, prior: Array, period: float, correlated: float = CORRELATED
) -> tuple[Array, Array, float]:
    """Solve least squares with a ``prior`` standard deviation of every unknown around zero.

    Residuals are ``correlated`` for that time [s] and have, row by row, a size of their own.

    Returns:
        What was found, its covariance, and the root mean square of what is left.
    """
    weight = np.ones(right.shape[1])
    trust = np.ones(len(right))
    share = min(1.0, period / correlated)
    found = np.zeros(rows.shape[2])
    inverse: Array = np.diag(prior**2)
    left = right
    for _ in range(ITERATIONS):
        size = np.sqrt(trust)[:, None] / weight
        flat: Array = (rows * size[..., None]).reshape(-1, rows.shape[2])
        inverse = np.asarray(np.linalg.inv(share * (flat.T @ flat) + np.diag(prior**-2.0)))
        found = inverse @ (share * (flat.T @ (right * size).ravel()))
        left = right - rows @ found
        weight = np.maximum(TYPICAL * np.median(np.abs(left), axis=0), 1e-9)
        trust = 1.0 / (1.0 + ((left / weight) ** 2).mean(axis=1) / OUTLYING**2)
    return found, inverse, float(np.sqrt((left**2).mean()))


def _inner(count: int, period: float) -> slice:
    edge = round(EDGE / period)
    return slice(edge, count - edge)


def _three(values: Array, std: Array) -> tuple[Estimate, ...]:
    return tuple(Estimate(float(a), float(b)) for a, b in zip(values, std, strict=True))


def cross_matrices(vectors: Array) -> Array:
    """Return the matrices of cross products with vectors (..., 3)."""
    out = np.zeros((*vectors.shape, 3))
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -z, y, -x
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = z, -y, x
    return out
