"""Identification of motors, joints, links and pack from a run in which the robot sways over standing feet.

The equations of motion are linear in what is unknown: masses, first moments and inertias of all links, a factor
on the rotors, friction and damping of the joints, the torque constants of the motors, and what iron and
gears lose of their torque. As contact forces are unknown, all equations are projected onto the null
space of the loaded points' Jacobian. The scale of all terms is not told by a motion: twice the masses with
twice the torque constants move alike. So the mean of the torque constants is taken for nominal, which is
better known than each of them, or follows from the mass if the robot has been weighed. Links are
known beforehand to some ``Spreads``: the fit is that of the greatest posterior probability.

A constant torque of every joint is fitted, too: it takes up offsets of the encoders and a tilt of the IMU.
So is torque that comes again with the motor's angle, as ripple and cogging do. How often in a turn is not known: it is
found from what is left, and fitted as long as that explains much. Without it this torque hides the rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....mathematics.arrays import Array
from ....mathematics.constants import GRAVITY
from ....robots.pinocchio_model import build_pinocchio_model
from ....robots.robot_description import RobotDescription
from ....robots.transmission import SLIDING_SPEED
from .identification import Estimate, IdentificationError, MeasuredRun
from .sensor_identification import (
    CUTOFF,
    EDGE,
    IdentifiedSensors,
    contact_jacobians,
    fit,
    play_positions,
    shifted,
    slope,
    smooth,
    standing_span,
)

EVERY = 8
"""Stride of the filtered ticks that are used."""
SOFT_SPEED = 0.08
"""The joint speed at which most of the Coulomb friction acts [rad/s]."""
CORRELATED = 0.6
"""Time over which the model's errors are correlated [s]."""
PERIODS = np.arange(20.0, 181.0, 2.0)
"""The periods in a turn of the output that are looked for in what motors give beside their torque."""
RIPPLE = 0.01
"""The size of such torque beforehand, as a share of the peak torque."""
MOST_PERIODS, EXPLAINED = 3, 0.1
"""Greatest number of waves that are fitted, and the share of the residual that each must explain."""
_DRAWS = 600
_LINK = 10


@dataclass(frozen=True)
class Spreads:
    """Standard deviations of what is known beforehand, relative unless a unit is named."""

    mass: float = 0.03
    link_mass: float = 0.06
    link_com: float = 0.004
    link_inertia: float = 0.12
    torque_constant: float = 0.03
    saturation: float = 0.1
    load_friction: float = 0.05
    rotor_inertia: float = 0.1
    friction: float = 0.8


@dataclass(frozen=True)
class IdentifiedMotors:
    """Identified motors, joints and links.

    Attributes:
        torque_constant: factor on the nominal one, by motor.
        saturation: share of the torque that is missing at the peak.
        load_friction: share of the torque that gears lose.
        rotor_inertia: factor on all rotors.
        friction, damping: by joint [N m, N m s/rad].
        mass: of the robot [kg].
        residuals: root mean square of the torque that is not explained, by joint [N m].
        ripple_periods: of torque that comes again with the motor's angle, in a turn of the output.
    """

    torque_constant: dict[str, Estimate]
    saturation: Estimate
    load_friction: Estimate
    rotor_inertia: Estimate
    friction: dict[str, Estimate]
    damping: dict[str, Estimate]
    mass: Estimate
    residuals: dict[str, float]
    ripple_periods: tuple[float, ...]


@dataclass(frozen=True)
class IdentifiedPack:
    """The pack's open voltage [V] and resistance [ohm]."""

    open_voltage: Estimate
    resistance: Estimate


def identify_motors(
    robot: RobotDescription, motion: MeasuredRun, sensors: IdentifiedSensors,
    spreads: Spreads = Spreads(), weighed: Estimate | None = None,
) -> IdentifiedMotors:  # fmt: skip
    """Fit motors, joints and links to a run in which the robot sways on standing feet.

    Args:
        weighed: the robot's mass by a balance [kg].

    Raises:
        IdentificationError: the base is not free, or the robot does not stand for long enough.
    """
    if robot.base_joint != "floating":
        raise IdentificationError(f"{robot.name} has a {robot.base_joint} base")
    n, links = len(robot.joints), len(robot.links)
    nominal, spread = _link_spread(robot, spreads)
    rows, right, free = _equations(robot, motion, sensors, nominal, spread)
    known = robot.motors
    differences = _differences(n)
    prior = np.concatenate([
        np.ones(_LINK * links), [spreads.rotor_inertia],
        np.maximum(spreads.friction * known.friction, 1e-4),
        np.maximum(spreads.friction * known.damping, 1e-5), np.full(n, 0.15),
        np.full(n - 1, spreads.torque_constant), [spreads.saturation, spreads.load_friction],
    ])  # fmt: skip
    places = np.cumsum([_LINK * links, 1, n, n, n, n])
    constants = slice(int(places[-2]), int(places[-1]))
    with_mean = np.concatenate([rows[..., : constants.start], rows[..., constants] @ differences, rows[..., constants.stop :]], axis=2)  # fmt: skip
    told, turned = len(prior), _motor_angles(robot, motion, sensors)
    step = EVERY * motion.period
    solution, covariance, _ = fit(with_mean, right, prior, step, CORRELATED)
    error, periods = right - with_mean @ solution, []
    ripple = np.tile(RIPPLE * np.asarray(known.peak_torque), 2)
    waves = {float(often): waves_of(turned, float(often), motion.period) for often in PERIODS}
    for _ in range(MOST_PERIODS):
        often = most_alike(error[:, 6:] @ robot.joint_to_motor.T, waves)
        columns = np.zeros((*right.shape, 2 * n))
        columns[:, 6:] = -np.hstack([robot.joint_to_motor.T] * 2) * waves[often][:, None, :]
        wider = np.concatenate([with_mean, free @ columns], axis=2)
        more = fit(wider, right, np.concatenate([prior, ripple]), step, CORRELATED)
        left = right - wider @ more[0]
        if (left**2).mean() > (1.0 - EXPLAINED) * (error**2).mean():
            break
        with_mean, prior, error = wider, np.concatenate([prior, ripple]), left
        solution, covariance, _ = more
        periods.append(often)
    solution, covariance = solution[:told], covariance[:told, :told]
    size = np.sqrt((error**2).mean(axis=0))
    back = np.zeros((rows.shape[2], len(solution)))
    back[: constants.start, : constants.start] = np.eye(constants.start)
    back[constants, constants.start : -2] = differences
    back[-2:, -2:] = np.eye(2)
    base = np.concatenate([
        np.zeros(_LINK * links), [1.0], known.friction, known.damping, np.zeros(n), np.ones(n),
        np.zeros(2),
    ])  # fmt: skip
    found, std = base + back @ solution, np.sqrt(np.diag(back @ covariance @ back.T))
    masses = spread[::_LINK].sum(axis=0)
    mass = robot.total_mass + float(masses @ solution[: len(masses)])
    mass_std = float(np.sqrt(masses @ covariance[: len(masses), : len(masses)] @ masses))
    scale, scale_std = 1.0, spreads.torque_constant / np.sqrt(n)
    if weighed is not None:
        scale, scale_std = weighed.value / mass, np.hypot(weighed.std, mass_std) / mass
    scaled = np.ones(len(found), dtype=np.bool_)
    scaled[-2:] = False  # shares of the torque
    found = np.where(scaled, scale * found, found)
    std = np.where(scaled, np.hypot(std, scale_std * np.abs(found)), std)
    parts = np.split(np.arange(len(found)), [*places, int(places[-1]) + 1])
    _, rotor, friction, damping, _, motors, saturation, load = parts
    names = [joint.name for joint in robot.joints]

    def one(k: int) -> Estimate:
        return Estimate(float(found[k]), float(std[k]))

    def each(labels: Sequence[str], at: NDArray[np.int64]) -> dict[str, Estimate]:
        return {label: one(int(k)) for label, k in zip(labels, at, strict=True)}

    return IdentifiedMotors(
        each(robot.transmission.motors, motors), one(int(saturation[0])), one(int(load[0])),
        one(int(rotor[0])), each(names, friction), each(names, damping),
        Estimate(scale * mass, float(np.hypot(scale * mass_std, scale_std * scale * mass))),
        {name: float(size[6 + k]) for k, name in enumerate(names)}, tuple(periods),
    )  # fmt: skip


def _differences(n: int) -> Array:
    """Return the directions in which torque constants differ and their mean stays, (n, n - 1)."""
    values, vectors = np.linalg.eigh(np.eye(n) - np.full((n, n), 1.0 / n))
    return np.asarray(vectors[:, values > 0.5])


def _motor_angles(
    robot: RobotDescription, motion: MeasuredRun, sensors: IdentifiedSensors
) -> Array:
    """Return the angles of the motors [rad], tick by tick while the robot stands."""
    return _seated(motion, sensors, standing_span(robot, motion)) @ robot.joint_to_motor.T


def waves_of(turned: Array, periods: float, period: float) -> Array:
    """Return the sines of the motors' angles, then cosines, filtered as all signals are, at the ticks of the equations,
    (ticks, 2 n).
    """
    edge = round(EDGE / period)
    waves = smooth(np.hstack([np.sin(periods * turned), np.cos(periods * turned)]), period)
    return waves[edge : len(turned) - edge : EVERY]


def most_alike(error: Array, waves: Mapping[float, Array]) -> float:
    """Return the period whose waves are most like the errors of the motors' torques."""
    twice = np.tile(error, 2)
    scores = {
        often: float((((twice * wave).sum(axis=0)) ** 2 / (wave**2).sum(axis=0)).sum())
        for often, wave in waves.items()
    }
    return max(scores, key=lambda often: scores[often])


def _link_spread(robot: RobotDescription, spreads: Spreads) -> tuple[Array, Array]:
    """Return the links' nominal parameters in Pinocchio's order (10 each), and how these change with independent
    numbers of variance one.
    """
    import pinocchio as pin

    rng = np.random.default_rng(0)

    def parameters(common: float, masses: Array, moves: Array, inertias: Array) -> Array:
        out = []
        for k, link in enumerate(robot.links):
            xx, yy, zz, xy, xz, yz = link.inertia
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            scale = common * masses[k]
            inertia = pin.Inertia(
                scale * link.mass, np.array(link.com) + moves[k], scale * inertias[k] * tensor
            )
            out.append(inertia.toDynamicParameters())
        return np.concatenate(out)

    count = len(robot.links)
    nominal = parameters(1.0, np.ones(count), np.zeros((count, 3)), np.ones(count))
    draws = np.array([
        parameters(
            1.0 + spreads.mass * rng.normal(), 1.0 + spreads.link_mass * rng.normal(size=count),
            spreads.link_com * rng.normal(size=(count, 3)),
            1.0 + spreads.link_inertia * rng.normal(size=count),
        )
        for _ in range(_DRAWS)
    ])  # fmt: skip
    values, vectors = np.linalg.eigh(np.cov((draws - nominal).T))
    return nominal, vectors * np.sqrt(np.maximum(values, 0.0))


def _equations(
    robot: RobotDescription, motion: MeasuredRun, sensors: IdentifiedSensors, nominal: Array,
    spread: Array,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Return the projected equations: (ticks, n_velocities, n_unknowns), (ticks, n_velocities), and the projections
    (ticks, n_velocities, n_velocities).
    """
    import pinocchio as pin

    built = build_pinocchio_model(robot)
    model: Any = pin.Model(built.model)
    model.gravity.linear = np.zeros(3)  # the specific force stands for it
    data = model.createData()
    carriers = [0 if link.name == robot.base else -1 for link in robot.links]
    for k, link in enumerate(robot.links):
        if carriers[k] < 0:
            joint = next(j.name for j in robot.joints if j.child == link.name)
            carriers[k] = model.getJointId(joint) - 1
    angles, speeds, bends, turning, turns, force, torque = filtered_motion(
        motion, sensors, standing_span(robot, motion)
    )
    to_motor, rotors = robot.joint_to_motor, robot.rotor_matrix
    peak = np.asarray(robot.motors.peak_torque)
    coulomb, viscous = np.asarray(robot.motors.friction), np.asarray(robot.motors.damping)
    n = len(robot.joints)
    edge = round(EDGE / motion.period)
    q, v, a = np.zeros(7 + n), np.zeros(6 + n), np.zeros(6 + n)
    q[6] = 1.0
    all_rows, all_right = [], []
    used = range(edge, len(angles) - edge, EVERY)
    for k in used:
        q[7:], v[3:6], v[6:] = angles[k], turning[k], speeds[k]
        a[:3], a[3:6], a[6:] = force[k], turns[k], bends[k]
        regressor = pin.computeJointTorqueRegressor(model, data, q, v, a)
        by_link = np.hstack([regressor[:, _LINK * c : _LINK * (c + 1)] for c in carriers])
        sign = np.tanh(speeds[k] / SOFT_SPEED)
        motors = robot.torque_to_motor @ torque[k]
        slides = np.abs(motors) * np.tanh(to_motor @ speeds[k] / SLIDING_SPEED)
        of_joints = np.hstack([
            (rotors @ bends[k])[:, None], np.diag(sign), np.diag(speeds[k]), np.eye(n),
            -to_motor.T * motors, (to_motor.T @ (motors**3 / peak**2))[:, None],
            (to_motor.T @ slides)[:, None],
        ])  # fmt: skip
        rows = np.zeros((6 + n, by_link.shape[1] + of_joints.shape[1]))
        rows[:, : by_link.shape[1]] = by_link @ spread
        rows[6:, by_link.shape[1] :] = of_joints
        right = -by_link @ nominal
        right[6:] += torque[k] - rotors @ bends[k] - coulomb * sign - viscous * speeds[k]
        all_rows.append(rows)
        all_right.append(right)
    free = free_projection(contact_jacobians(robot, angles[np.array(used)])[0])
    return free @ np.array(all_rows), (free @ np.array(all_right)[..., None])[..., 0], free


def _seated(motion: MeasuredRun, sensors: IdentifiedSensors, span: slice) -> Array:
    """Return the joints' angles without the play of their gears."""
    width = np.array([each.value for each in sensors.play.values()])
    return motion.position[span] - 0.5 * width * play_positions(motion.torque[span], motion.period)


def free_projection(jacobians: Array) -> Array:
    """Return the projections that take the contact forces out of the equations of motion, (n, n_velocities,
    n_velocities): onto what Jacobians of contact points (n, rows, n_velocities) map to zero.
    """
    _, sizes, directions = np.linalg.svd(jacobians, full_matrices=False)
    used = directions * (sizes > 1e-6 * sizes[:, :1])[..., None]
    return np.asarray(np.eye(jacobians.shape[2]) - used.transpose(0, 2, 1) @ used)


def filtered_motion(
    motion: MeasuredRun, sensors: IdentifiedSensors, span: slice,
    cutoff: float = CUTOFF,
) -> tuple[Array, ...]:  # fmt: skip
    """Return the filtered motion at the time of the tick: joint angles, velocities and accelerations, the base's
    angular velocity and acceleration, the specific force of its origin, and the joints' torques.

    The robot ends as it began, so its mean angular velocity is the gyroscope's bias; it stands still at first.
    """
    period = motion.period
    torque = motion.torque[span]
    angles = smooth(_seated(motion, sensors, span), period, cutoff)
    speeds = smooth(motion.velocity[span], period, cutoff)
    speeds = shifted(speeds, sensors.velocity_age.value / period)
    rotation = np.array([each.value for each in sensors.imu_rotation])
    place = np.array([each.value for each in sensors.imu_position])
    turning = shifted(
        smooth(motion.angular_velocity[span], period, cutoff), sensors.gyro_age.value / period
    )
    turning = turning - turning.mean(axis=0)
    turning = turning - np.cross(turning, rotation)
    # A mean over the tick before is half a tick older than a sample.
    late = sensors.accelerometer_age.value / period + 0.5
    force = shifted(smooth(motion.specific_force[span], period, cutoff), late)
    force = force - np.cross(force, rotation)
    force = force * (GRAVITY / np.linalg.norm(force[: round(0.8 / period)], axis=1).mean())
    turns = slope(turning, period)
    force = force - np.cross(turns, place) - np.cross(turning, np.cross(turning, place))
    torque = shifted(smooth(torque, period, cutoff), 0.5)
    return angles, speeds, slope(speeds, period), turning, turns, force, torque


def identify_pack(
    robot: RobotDescription, motion: MeasuredRun, voltage: Array, recovery_time: float = 10.0
) -> IdentifiedPack | None:
    """Fit the pack to the voltage that the drives report; None where they report none, or the description gives no
    supply of the motors.

    Args:
        voltage: at the drives (n,) [V].
        recovery_time: in which a part of the voltage comes back after a load [s].
    """
    supply = robot.supply
    if supply is None or float(voltage.max()) < 1.0 or float(np.ptp(voltage)) < 1e-3:
        return None
    motors = motion.torque @ robot.torque_to_motor.T
    speeds = motion.velocity @ robot.joint_to_motor.T
    power = supply.board_power + (motors * (speeds + supply.heating(robot.motors) * motors)).sum(
        axis=1
    )
    current = power / np.maximum(voltage, 1.0)
    period, slow = motion.period, np.zeros(len(current))
    for k in range(1, len(current)):
        slow[k] = slow[k - 1] + period / recovery_time * (current[k] - slow[k - 1])
    charge = np.cumsum(current) * period
    window = max(1, round(0.02 / period))
    smoothed = [
        np.convolve(each, np.ones(window) / window, mode="valid")[::window]
        for each in (current, slow, charge, voltage)
    ]
    ones = np.ones_like(smoothed[0])
    rows = np.stack([ones, -smoothed[0], -smoothed[1], -smoothed[2] / 3600.0], axis=1)[:, None, :]
    prior = np.array([100.0, 1.0, 0.05, 2.0])
    found, covariance, _ = fit(rows, smoothed[3][:, None], prior, window * period)
    std = np.sqrt(np.diag(covariance))
    return IdentifiedPack(
        Estimate(float(found[0]), float(std[0])), Estimate(float(found[1]), float(std[1]))
    )
