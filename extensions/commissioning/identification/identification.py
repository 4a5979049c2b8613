"""Identification of a robot from a recorded run: its mass, its torso, its friction, and its delay.

Mass, the torso's centre of mass and joint friction follow by least squares on inverse dynamics. The delay is
that from a tick's instant to the torques computed in it, from commanded and measured torques.

Between two ticks the motion is taken as uniformly accelerated, so velocities are the means of both ticks
and accelerations their differences, as torques and specific forces are means over the same time. With
the specific force in place of gravity and of the base's acceleration, the equations of motion are

    s Y(q, v, a) + dY/dc (s d) + R a_j + C tanh(v_j / v_0) + B v_j = tau + J_c' f,

for the factor s on all masses and inertias, the offset d of the torso's centre of mass, and Coulomb and
viscous friction C and B of every joint; R are the rotors. The contact forces f are unknown, so everything
is projected onto the null space of the loaded points' Jacobian J_c: what is left does not depend on them.
In flight nothing is projected. Equations are averaged over blocks of ticks, weighted by the residuals
of their row, and solved by least squares; blocks far off are left out.

Uncertainty: that of the residuals, which are correlated for some blocks (the sandwich of clustered
residuals), and what an unknown offset of every encoder and an unknown tilt would change.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ....mathematics.arrays import Array
from ....mathematics.constants import GRAVITY
from ....robots.pinocchio_model import build_pinocchio_model
from ....robots.robot_description import RobotDescription

MARGIN = 8
"""Ticks before and after a change of the contacts that are not used: impacts, and switches that bounce."""
STILL = 0.15
"""The mean joint speed of a robot that stands still, noise included [rad/s]."""


@dataclass(frozen=True)
class MeasuredRun:
    """The measurements of a run, one row a tick, as ``hal.Robot`` publishes them.

    Attributes:
        period: from tick to tick [s].
        position, velocity: of the joints at the tick [rad, rad/s], (n, n_joints).
        torque: the mean over the tick before [N m], (n, n_joints).
        angular_velocity: of the base at the tick [rad/s, body], (n, 3).
        specific_force: the mean over the tick before [m/s^2, body], (n, 3).
        up: the vertical by the estimated orientation, in the body's frame, (n, 3).
        closed: the foot switches, (n, n_contacts).
    """

    period: float
    position: Array
    velocity: Array
    torque: Array
    angular_velocity: Array
    specific_force: Array
    up: Array
    closed: NDArray[np.bool_]

    def sensor_biases(self) -> tuple[Array, Array]:
        """Return the biases of accelerometer [m/s^2] and gyroscope [rad/s], from where the robot stands still at first;
        zero where it never does.
        """
        speeds = np.abs(self.velocity).mean(axis=1)
        moving = np.flatnonzero(speeds > STILL)
        still = slice(1, max(1, int(moving[0]) if len(moving) else len(speeds)))
        if len(self.up[still]) < 10:
            return np.zeros(3), np.zeros(3)
        force = self.specific_force[still].mean(axis=0) - GRAVITY * self.up[still].mean(axis=0)
        return force, self.angular_velocity[still].mean(axis=0)

    def usable(self) -> NDArray[np.int64]:
        """Return the ticks, each with the one before it, in which the contacts have been the same for a while and stay
        so for a while.
        """
        n = len(self.closed)
        changed = np.zeros(n, dtype=np.bool_)
        changed[1:] = (self.closed[1:] != self.closed[:-1]).any(axis=1)
        near = np.convolve(changed, np.ones(2 * MARGIN + 1), mode="same") > 0.5
        near[: MARGIN + 1] = True
        return np.flatnonzero(~near)


BLOCK = 8
"""Ticks that are averaged to one equation."""
CLUSTER = 6
"""Blocks whose residuals may be correlated."""
OUTLIER = 4.0
"""Blocks with an equation so many standard deviations off are left out."""
SOFT_SPEED = 0.15
"""The speed v_0 at which most of the Coulomb friction acts [rad/s]: above the velocities' noise."""
MOVING_SPEED, MOVING_SHARE = 0.5, 0.1
"""A joint's friction is fitted if it turns faster than this [rad/s] in this share of the ticks."""
_STEP = 1e-3
COM = slice(1, 4)


@dataclass(frozen=True)
class Estimate:
    """A value that was found, with the standard deviation of its error."""

    value: float
    std: float


@dataclass(frozen=True)
class IdentifiedBody:
    """Identified mass, torso and friction.

    Attributes:
        mass: of the robot [kg].
        com_offset: of the torso's CoM from the description's [m, base], three values.
        coulomb, viscous: friction of the joints that moved enough, by name [N m, N m s/rad].
        resting: the joints that did not; their friction was taken from the description.
        equations: how many were used.
    """

    mass: Estimate
    com_offset: tuple[Estimate, Estimate, Estimate]
    coulomb: dict[str, Estimate]
    viscous: dict[str, Estimate]
    resting: tuple[str, ...]
    equations: int


class IdentificationError(ValueError):
    """The run does not determine the wanted values; the text names what it lacks."""


def identify_rigid_body(
    robot: RobotDescription,
    motion: MeasuredRun,
    encoder_std: float = 0.003,
    tilt_std: float = 0.003,
) -> IdentifiedBody:
    """Fit mass, torso's CoM and friction to a run.

    Args:
        robot: the description that the values are relative to.
        motion: the measurements.
        encoder_std: standard deviation of the encoders' unknown offsets [rad].
        tilt_std: of the error of the vertical while the robot stands [rad].

    Raises:
        IdentificationError: the base is not free, or too few ticks can be used.
    """
    if robot.base_joint != "floating":
        raise IdentificationError(
            f"{robot.name} has a {robot.base_joint} base: its weight is not told by a run"
        )
    ticks = motion.usable()
    speeds = np.abs(motion.velocity[ticks])
    fastest = speeds.max(axis=1) > MOVING_SPEED
    ticks = ticks[fastest]
    if len(ticks) < 20 * BLOCK:
        raise IdentificationError(
            f"only {len(ticks)} ticks with moving joints and steady contacts; {20 * BLOCK} are needed: "
            "record a run with a squat or a jump"
        )
    moved = (speeds[fastest] > MOVING_SPEED).mean(axis=0) > MOVING_SHARE
    force_bias, gyro_bias = motion.sensor_biases()
    unbiased = replace(
        motion,
        specific_force=motion.specific_force - force_bias,
        angular_velocity=motion.angular_velocity - gyro_bias,
    )
    assembly = _Assembly(robot, moved)
    rows, right, where = assembly.blocks(unbiased, ticks)
    scale, kept = np.ones(rows.shape[1]), np.ones(len(rows), dtype=np.bool_)
    found = np.zeros(rows.shape[2])
    for _ in range(4):
        found = _solve(rows[kept] / scale[:, None], right[kept] / scale)
        error = right - rows @ found
        scale = np.maximum(np.sqrt((error[kept] ** 2).mean(axis=0)), 1e-6)
        kept = (np.abs(error) < OUTLIER * scale).all(axis=1)
    rows, right, error, where = rows[kept], right[kept], error[kept], where[kept]
    covariance = _clustered(rows / scale[:, None], error / scale, where)
    covariance += assembly.systematic(
        unbiased, ticks, rows / scale[:, None], scale, kept, encoder_std, tilt_std
    )
    std = np.sqrt(np.diag(covariance))
    s, n = float(found[0]), int(moved.sum())
    names = [joint.name for joint, moves in zip(robot.joints, moved, strict=True) if moves]
    offsets = [Estimate(float(found[k]) / s, float(std[k]) / s) for k in range(1, 4)]
    return IdentifiedBody(
        Estimate(s * robot.total_mass, float(std[0]) * robot.total_mass),
        (offsets[0], offsets[1], offsets[2]),
        {name: Estimate(float(found[4 + k]), float(std[4 + k])) for k, name in enumerate(names)},
        {name: Estimate(float(found[4 + n + k]), float(std[4 + n + k])) for k, name in enumerate(names)},
        tuple(j.name for j, moves in zip(robot.joints, moved, strict=True) if not moves),
        len(rows),
    )  # fmt: skip


class _Assembly:
    """Maker of the averaged, projected equations of a motion."""

    def __init__(self, robot: RobotDescription, moved: NDArray[np.bool_]) -> None:
        import pinocchio as pin

        self._pin = pin
        built = build_pinocchio_model(robot)
        self._frames = built.contact_frames
        self._models = []
        for axis in range(4):
            model = pin.Model(built.model)
            model.armature = np.zeros(model.nv)  # the rotors are added apart: they do not scale
            model.gravity.linear = np.zeros(3)  # the specific force stands for it
            if axis:
                base = model.inertias[1]
                moment = base.lever.copy()
                torso = next(link.mass for link in robot.links if link.name == robot.base)
                moment[axis - 1] += _STEP * torso / base.mass
                model.inertias[1] = pin.Inertia(base.mass, moment, base.inertia)
            self._models.append((model, model.createData()))
        self._rotors = robot.rotor_matrix
        self._moved = np.flatnonzero(moved)
        resting = ~moved
        self._known_coulomb = robot.motors.friction * resting
        self._known_viscous = robot.motors.damping * resting
        self._joints = len(robot.joints)

    def blocks(
        self, motion: MeasuredRun, ticks: NDArray[np.int64]
    ) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return the equations (n_blocks, n_velocities, n_unknowns), their right sides (n_blocks, n_velocities), and
        the first tick of each block.
        """
        groups = [
            run[start : start + BLOCK]
            for run in np.split(ticks, np.flatnonzero(np.diff(ticks) != 1) + 1)
            for start in range(0, len(run) - BLOCK + 1, BLOCK)
        ]
        rows, right = [], []
        for group in groups:
            made = [self._tick(motion, int(k)) for k in group]
            rows.append(np.mean([row for row, _ in made], axis=0))
            right.append(np.mean([side for _, side in made], axis=0))
        return np.array(rows), np.array(right), np.array([group[0] for group in groups])

    def _tick(self, motion: MeasuredRun, k: int) -> tuple[Array, Array]:
        pin, n, period = self._pin, self._joints, motion.period
        q = np.zeros(7 + n)
        q[6], q[7:] = 1.0, 0.5 * (motion.position[k - 1] + motion.position[k])
        v, a = np.zeros(6 + n), np.zeros(6 + n)
        v[3:6] = 0.5 * (motion.angular_velocity[k - 1] + motion.angular_velocity[k])
        v[6:] = 0.5 * (motion.velocity[k - 1] + motion.velocity[k])
        a[:3] = motion.specific_force[k]
        a[3:6] = (motion.angular_velocity[k] - motion.angular_velocity[k - 1]) / period
        a[6:] = (motion.velocity[k] - motion.velocity[k - 1]) / period
        nominal, *shifted = (pin.rnea(model, data, q, v, a).copy() for model, data in self._models)
        rows = np.zeros((6 + n, 4 + 2 * len(self._moved)))
        rows[:, 0] = nominal
        for axis, force in enumerate(shifted):
            rows[:, 1 + axis] = (force - nominal) / _STEP
        sign = np.tanh(v[6:] / SOFT_SPEED)
        for column, joint in enumerate(self._moved):
            rows[6 + joint, 4 + column] = sign[joint]
            rows[6 + joint, 4 + len(self._moved) + column] = v[6 + joint]
        right = np.zeros(6 + n)
        right[6:] = motion.torque[k] - self._rotors @ a[6:]
        right[6:] -= self._known_coulomb * sign + self._known_viscous * v[6:]
        loaded = [frame for frame, on in zip(self._frames, motion.closed[k], strict=True) if on]
        if not loaded:
            return rows, right
        model, data = self._models[0]
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = np.vstack([pin.getFrameJacobian(model, data, f, world)[:3] for f in loaded])
        _, sizes, directions = np.linalg.svd(jacobian, full_matrices=False)
        used = directions[sizes > 1e-6 * sizes[0]]
        return rows - used.T @ (used @ rows), right - used.T @ (used @ right)

    def systematic(
        self, motion: MeasuredRun, ticks: NDArray[np.int64], weighted: Array, scale: Array,
        kept: NDArray[np.bool_], encoder_std: float, tilt_std: float,
    ) -> Array:  # fmt: skip
        """Return the covariance that unknown offsets of the encoders and an unknown tilt add."""
        inverse = np.linalg.pinv(weighted.reshape(-1, weighted.shape[2]))
        found: Array = np.zeros((weighted.shape[2],) * 2)
        nominal, side, _ = self.blocks(motion, ticks)
        best = inverse @ (side[kept] / scale).ravel()
        changed = [
            replace(motion, position=motion.position + encoder_std * np.eye(self._joints)[joint])
            for joint in range(self._joints)
        ]
        for axis in np.eye(3)[:2]:
            turned = motion.specific_force + tilt_std * np.cross(axis, motion.specific_force)
            changed.append(replace(motion, specific_force=turned))
        for each in changed:
            rows, right, _ = self.blocks(each, ticks)
            left = (right - rows @ best)[kept] / scale
            shift = inverse @ (left - ((side - nominal @ best)[kept] / scale)).ravel()
            found = found + np.outer(shift, shift)
        return found


def _solve(rows: Array, right: Array) -> Array:
    solution = np.linalg.lstsq(rows.reshape(-1, rows.shape[2]), right.ravel(), rcond=None)[0]
    return np.asarray(solution, dtype=np.float64)


def _clustered(rows: Array, error: Array, where: NDArray[np.int64]) -> Array:
    """Return the covariance of a least-squares solution whose residuals are correlated within clusters."""
    flat = rows.reshape(-1, rows.shape[2])
    inverse = np.linalg.pinv(flat.T @ flat)
    cluster = (where - where[0]) // (BLOCK * CLUSTER)
    middle = np.zeros_like(inverse)
    for one in np.unique(cluster):
        inside = cluster == one
        score = np.einsum("brk,br->k", rows[inside], error[inside])
        middle += np.outer(score, score)
    count = len(np.unique(cluster))
    result: Array = inverse @ middle @ inverse * (count / max(1, count - 1))
    return result


LONGEST = 20
"""Delays up to so many ticks are looked for."""
_FEWEST = 50
_RESOLUTION = 0.05
"""The smallest standard deviation that is claimed, in ticks: commands may come a little earlier or later."""
_PARTS = 10
"""The parts of a run whose delays are compared."""


@dataclass(frozen=True)
class IdentifiedDelay:
    """Identified delay.

    Attributes:
        delay: from a tick's instant until its command acts [s].
        correlation: between the changes of the measured torques and those expected with this delay.
        ticks: how many were used.
    """

    delay: Estimate
    correlation: float
    ticks: int


def identify_delay(
    period: float, commanded: Array, measured: Array, feedback: NDArray[np.bool_]
) -> IdentifiedDelay:
    """Find the delay between commands and torques.

    The command of tick k acts from t_k + d until the next one acts. A measured torque is the mean over
    the tick before, so with d = (j + share) T its change is ``(1 - share)`` of the command's change
    j + 1 ticks earlier and ``share`` of the one before that. Of all whole j and shares that pair is
    taken for which expected and measured changes correlate most.

    Args:
        period: T [s].
        commanded: feedforward torques [N m], (n, n_joints).
        measured: mean torques over the tick before [N m], (n, n_joints).
        feedback: the ticks whose commands have joint feedback; they are not used, (n,).

    Raises:
        IdentificationError: too few ticks have torques without joint feedback.
    """
    lags = LONGEST + 2
    clean = np.convolve(feedback, np.ones(lags + 1))[: len(feedback)] < 0.5
    clean[: lags + 1] = False
    used = np.flatnonzero(clean)
    if len(used) < _FEWEST:
        raise IdentificationError(
            f"only {len(used)} ticks have commands without joint feedback; {_FEWEST} are needed to find "
            "the delay: record a run in which the robot stands or squats"
        )
    changes = np.diff(commanded, axis=0, prepend=commanded[:1])
    best = (-1.0, 0, 0.0)
    for j in range(LONGEST):
        correlation, share = _fit(changes, measured, used, j)
        if correlation > best[0]:
            best = (correlation, j, share)
    correlation, j, share = best
    if correlation < 0.3:
        raise IdentificationError(
            "the measured torques do not follow the commanded ones at any delay up to "
            f"{1e3 * LONGEST * period:g} ms (correlation {correlation:.2f})"
        )
    parts = [_fit(changes, measured, part, j)[1] for part in np.array_split(used, _PARTS)]
    std = max(float(np.std(parts, ddof=1)) / math.sqrt(_PARTS), _RESOLUTION)
    return IdentifiedDelay(Estimate((j + share) * period, std * period), correlation, len(used))


def _fit(changes: Array, measured: Array, used: NDArray[np.int64], j: int) -> tuple[float, float]:
    """Return the correlation of measured changes with those of the commands j + 1 and j + 2 ticks earlier, and the
    share of the latter.
    """
    seen = (measured[used] - measured[used - 1]).ravel()
    first = changes[used - 1 - j].ravel()
    step = changes[used - 2 - j].ravel() - first
    square = float(step @ step)
    if square <= 0.0:
        return 0.0, 0.0
    share = min(1.0, max(0.0, float(step @ (seen - first)) / square))
    expected = first + share * step
    size = float(np.linalg.norm(expected) * np.linalg.norm(seen))
    return (float(expected @ seen) / size if size > 0.0 else 0.0), share
