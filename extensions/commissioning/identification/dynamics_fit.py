"""Identification of a robot's dynamics from logs of motion and torque, of whatever robot and by whomever.

The torque that a log has of joint j is taken to be

    u_j(t) = (Y_j b + R_j a_j + C_j s(v_j) + B_j v_j + L_j s(v_j) |Y_j b + R_j a_j|) / k_j + o_j,  t by an age d late,

with the base parameters b (``base_parameters``), rotors R, Coulomb friction C, viscous friction B, friction with load L,
s(v) = tanh(v / v_0), a torque constant k relative to that with which the log was made, and an offset o.

A floating base has six equations more, without a torque, and forces of the ground in all of them: measured ones are known,
others are projected out (``ground_forces``), and k (u - o) stands on the known side, for the projection mixes joints; all are
divided by the mean k, or noise would be least with all unknowns at zero. Without
torques the six are all, with the base parameters as unknowns, and the accelerometer's offset, which acts as weight does. If nothing but gravity acts on such a robot, in
flight, all six scale together, so its mass is taken from the description.

Both sides are low-passed in the band that the motors drive (``band``). Unknowns are found by instrumental variables: equations by
even samples, instruments by odd ones, and the other way round, so noise of the encoders biases nothing. Gauss and Newton's
iteration, rows weighted by the noise of their joint, those far off less.

What data do not tell stays at the description: each unknown has a prior, wide but for the torque constants, which
are 1 within ``CONSTANT_STD``. A common factor on all torque constants, inertias and frictions is told by no motion, so it is
known no better than by these priors, or by a joint whose torque is trusted.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ....mathematics.arrays import Array
from ....robots.robot_description import RobotDescription
from .band import LowPass, band_of, halves, torque_at
from .base_parameters import LinkRegressor, Motion
from .ground_forces import equations_left
from .identification import Estimate, IdentificationError
from .motion_log import MotionLog, missing

BASE_EQUATIONS = (
    *(f"force {axis} of the base" for axis in "xyz"),
    *(f"moment {axis} of the base" for axis in "xyz"),
)
"""Names of a floating base's equations, in its axes [N, N m]."""
SPEED = 0.05
"""The speed v_0 at which most of the Coulomb friction acts [rad/s, m/s]."""
CONSTANT_STD, LOAD_STD, AGE_STD = 0.1, 0.1, 0.004
"""Standard deviations, beforehand, of torque constants, of friction with load, and of the torques' age [s]."""
LINK_STD = 1.0
"""Standard deviation of masses, moments and inertias, relative to the description's sizes."""
FLOATING_LINK_STD = 0.3
"""The same of a floating base, whose many links most logs leave open, and many could take up what a log's errors are."""
ROUNDS = 8
MASS_STD = 0.002
"""Standard deviation of the whole mass, relative, where nothing weighs the robot."""
LEAST_LEFT = 0.02
"""The share of a floating base's six equations that the ground's forces have to leave."""
TOLD = 2.0
"""Friction with load of fewer standard deviations from zero is left out."""
NO_LOAD_STD, TRUSTED_STD = 1e-5, 0.005
OUTLYING = 2.5
"""Residuals of more standard deviations count less."""
CLUSTER = 6.0
"""Residuals may be correlated for so many periods of the band's end."""
FEWEST = 40
"""The fewest instants that are fitted."""
VARIANTS = ((0.6, 1.0), (1.0, 0.4))
"""The fit is repeated with these factors on the band and on ``SPEED``, which nothing tells: how far values move belongs
to their uncertainty."""


@dataclass
class Unknowns:
    """The places of the unknowns in one vector, with their priors."""

    names: list[str] = field(default_factory=list)
    mean: list[float] = field(default_factory=list)
    at: dict[str, slice] = field(default_factory=dict)

    def add(self, kind: str, names: list[str], mean: Array | float) -> None:
        """Add those of one kind."""
        start = len(self.names)
        self.names += [f"{kind} {name}".strip() for name in names]
        self.mean += np.broadcast_to(mean, (len(names),)).tolist()
        self.at[kind] = slice(start, len(self.names))


@dataclass
class FormedLog:
    """The equations of one log: motion and rows by both halves, the measured torques, these with what is known of the ground's forces and the latter,
    low-passed, what the base's specific force adds, what projects the equations, and what it leaves of each (n_equations)."""

    log: MotionLog
    low: LowPass
    motions: tuple[Motion, Motion]
    rows: tuple[Array, Array]
    measured: Array
    torque: Array
    known: Array
    lifting: Array
    through: Array | None
    share: Array

    def left(self, values: Array) -> Array:
        """Return what the ground's forces leave of equations (n, n_equations, ...)."""
        if self.through is None:
            return values
        wide = self.through @ values.reshape(*values.shape[:2], -1)
        return np.asarray(wide.reshape(values.shape))

    def left_of_joints(self, columns: Array, joints: Iterable[int], first: int) -> Array:
        """Return what they leave of one column (n,) a joint, each as an equation of its own, (n, n_equations, n_columns)."""
        chosen = list(joints)
        whole = np.zeros((len(columns), len(self.share), len(chosen)))
        for k, j in enumerate(chosen):
            if self.through is None:
                whole[:, first + j, k] = columns[:, j]
            else:
                whole[:, :, k] = self.through[:, :, first + j] * columns[:, j, None]
        return whole


@dataclass(frozen=True)
class FittedDynamics:
    """Result of a fit: the vector of all unknowns, its covariance, and the band [Hz].

    ``noise`` is that of every equation [N m], (n_velocities,); ``prior_std`` what was known beforehand.
    """

    unknowns: Unknowns
    value: Array
    covariance: Array
    prior_std: Array
    noise: Array
    band: float
    equations: int

    def estimates_at(self, part: slice) -> list[Estimate]:
        """Return the values at a part of the vector, each with its standard deviation."""
        std = np.sqrt(np.diag(self.covariance))[part]
        return [Estimate(float(v), float(s)) for v, s in zip(self.value[part], std, strict=True)]


class DynamicsModel:
    """The equations of a robot and its unknowns; without ``torques`` those of a floating base alone.

    Attributes:
        joints: those whose equations are used.
        equations: names of all, the base's first.
        weighed: whether forces of the ground or torques tell the whole mass.
    """

    def __init__(self, robot: RobotDescription, torques: bool = True, weighed: bool = True) -> None:
        self.robot, self.links, self.weighed = robot, LinkRegressor(robot), weighed
        self.joints = [joint.name for joint in robot.joints] if torques else []
        self.first, n = self.links.first, len(self.joints)
        self.equations = [*(BASE_EQUATIONS if self.first else ()), *self.joints]
        self.rotors = np.diag(robot.rotor_matrix)[:n].copy()
        coupling = robot.rotor_matrix - np.diag(np.diag(robot.rotor_matrix))
        self.coupling = coupling[:n, :n]
        self.unknowns = unknowns = Unknowns()
        unknowns.add("", self.links.names, self.links.described_base)
        unknowns.at["base"] = unknowns.at.pop("")
        self.told_rotors = told = [j for j in self.links.told_rotors if j < n]
        unknowns.add("rotor inertia of", [self.joints[j] for j in told], self.rotors[told])
        for kind in ("coulomb", "viscous", "load", "log constant", "offset"):
            unknowns.add(f"{kind} of", self.joints, 0.0)
        unknowns.add("age of torques", [""] if n else [], 0.0)
        unknowns.add("accelerometer offset of", [*"xyz"] if self.first else [], 0.0)
        self.mean, self.n, self.speed = np.array(unknowns.mean), n, SPEED
        self.without_load = np.zeros(0, np.int64)
        self.constant_std = np.full(n, CONSTANT_STD)

    def part(self, kind: str) -> slice:
        """Return where the unknowns of a kind are."""
        at = self.unknowns.at
        return at[kind] if kind in at else at[f"{kind} of"]

    def form(self, log: MotionLog, band: float) -> FormedLog:
        """Return the equations of a log.

        Raises:
            IdentificationError: it is too short.
        """
        motions = halves(log, band)
        count = len(motions[0].position)
        period = (len(log.position) - 1) / max(1, count - 1) * log.period
        low = LowPass.of(count, period, band)
        if len(low.centres) < FEWEST:
            raise IdentificationError(
                f"{log.name} has {log.duration:.3g} s, and {(FEWEST + 9.0) / (3.0 * band):.2g} s are needed in "
                f"a band of {band:.2g} Hz"
            )
        torque = np.zeros((count, self.first + self.n))
        measured = torque_at(log, band) if self.n else np.zeros((count, 0))
        torque[:, self.first :] = measured
        width = len(self.equations)
        first, second = (self.links.rows(motion)[:, :width] for motion in motions)
        through, share, known = None, np.ones(width), np.zeros((count, width))
        lifting = np.zeros((count, width, 0))
        if self.first:
            middle = 0.5 * (motions[0].position + motions[1].position)
            lifting = self.links.lifting(middle)[:, :width]
            through, known = equations_left(log, band, self.links, middle, width)
            torque = (through @ torque[:, :, None])[:, :, 0] + known
            share = np.diagonal(through, axis1=1, axis2=2).mean(axis=0)
        return FormedLog(
            log, low, motions, (first, second), measured, low(torque), low(known), lifting,
            through, share,
        )  # fmt: skip

    def prior_std(self, logs: list[FormedLog]) -> Array:
        """Return the standard deviations beforehand, by the sizes of links, torques and speeds."""
        tensors = self.links.described.reshape(-1, 10)
        mass = np.maximum(tensors[:, 0], 1e-6)
        size = np.sqrt(np.maximum(tensors[:, [4, 6, 9]].sum(axis=1) / mass, 1e-6))
        powers = np.array([0, *(1,) * 3, *(2,) * 6])
        relative = FLOATING_LINK_STD if self.first else LINK_STD
        links = relative * (mass[:, None] * size[:, None] ** powers).reshape(-1)
        self.base_prior = (self.links.lumped * links**2) @ self.links.lumped.T
        if not self.weighed:
            whole = self.links.whole_mass
            along = self.base_prior[:, whole].copy()
            given = (MASS_STD * self.links.described_base[whole]) ** 2
            self.base_prior -= np.outer(along, along) / (along[whole] + given)
        torque = np.concatenate([each.torque[:, self.first :] for each in logs])
        speed = np.concatenate([each.motions[0].velocity[:, : self.n] for each in logs])
        typical = np.maximum(np.sqrt((torque**2).mean(axis=0)), 1e-6)
        moving = np.maximum(np.sqrt((speed**2).mean(axis=0)), 1e-3)
        std = np.zeros(len(self.mean))
        std[self.part("base")] = np.sqrt(np.diag(self.base_prior))
        told = self.told_rotors
        inertia = np.array([np.abs(np.concatenate([e.rows[0][:, self.first + j] for e in logs])
                                   @ self.links.described_base).mean() for j in range(self.n)])  # fmt: skip
        accelerations = np.concatenate([each.motions[0].acceleration[:, : self.n] for each in logs])
        inertia /= np.maximum(np.abs(accelerations).mean(axis=0), 1e-6)
        std[self.part("rotor inertia")] = np.maximum(self.rotors, 0.1 * inertia)[told]
        std[self.part("coulomb")] = typical
        std[self.part("viscous")] = typical / moving
        std[self.part("load")] = LOAD_STD
        std[self.part("load").start + self.without_load] = NO_LOAD_STD
        std[self.part("log constant")] = self.constant_std
        std[self.part("offset")] = 0.1 * typical
        std[self.part("age of torques")] = AGE_STD
        std[self.part("accelerometer offset")] = max(each.log.base_std for each in logs)
        return std

    def predicted(self, value: Array, formed: FormedLog, half: int) -> tuple[Array, Array]:
        """Return the low-passed torques (m, n_velocities) by the unknowns, and their derivatives by each of these."""
        motion, rows, low = formed.motions[half], formed.rows[half], formed.low
        first, n, part, left = self.first, self.n, self.part, formed.left
        speed, acceleration = motion.velocity[:, :n], motion.acceleration[:, :n]
        sign = np.tanh(speed / self.speed)
        drive = rows @ value[part("base")]
        rotors = self.rotors.copy()
        rotors[self.told_rotors] = value[part("rotor inertia")]
        turning = self._padded(rotors * acceleration + acceleration @ self.coupling)
        drive = drive + turning
        loaded = drive[:, first:]
        load = sign * np.abs(loaded)
        friction = value[part("coulomb")] * sign + value[part("viscous")] * speed
        friction = friction + value[part("load")] * load
        whole = drive + self._padded(friction)
        whole = whole - formed.lifting @ value[part("accelerometer offset")]
        constant = np.exp(value[part("log constant")])
        mean = float(np.exp(value[part("log constant")].sum() / max(1, n)))
        scale = np.full(whole.shape[1], 1.0 / mean) if first else 1.0 / constant
        age = float(value[part("age of torques")].sum())
        whole = left(whole)
        out = scale * low(whole, age=age)
        jacobian = np.zeros((*out.shape, len(value)))
        with_load = 1.0 + value[part("load")] * sign * np.sign(loaded)
        base = rows.copy()
        base[:, first:] *= with_load[:, :, None]
        jacobian[:, :, part("base")] = low(left(base), age=age)
        told, every = self.told_rotors, range(n)
        for kind, columns, own in (
            ("rotor inertia", with_load * acceleration, told), ("coulomb", sign, every),
            ("viscous", speed, every), ("load", load, every),
        ):  # fmt: skip
            jacobian[:, :, part(kind)] = low(formed.left_of_joints(columns, own, first), age=age)
        jacobian[:, :, part("accelerometer offset")] = -low(left(formed.lifting), age=age)
        jacobian *= scale[:, None]
        offset, slope = value[part("offset")], scale * low(whole, derivative=True)
        jacobian[:, :, part("age of torques")] = -slope[:, :, None][:, :, : min(n, 1)]
        if not first:
            for j in every:
                jacobian[:, j, part("log constant").start + j] = -out[:, j]
                jacobian[:, j, part("offset").start + j] = 1.0
            out += offset
        elif n:
            driven = constant / mean * (formed.measured - offset)
            made = low(formed.left_of_joints(driven, every, first))
            # a common factor of all constants scales all but the torques
            common = out - made.sum(axis=2) - formed.known / mean
            jacobian[:, :, part("log constant")] = -made - common[:, :, None] / n
            ones = np.tile(constant / mean, (len(driven), 1))
            jacobian[:, :, part("offset")] = low(formed.left_of_joints(ones, every, first))
            out += low(left(self._padded(formed.measured - driven)))
            out += (1.0 - 1.0 / mean) * formed.known
        return out, jacobian

    def _padded(self, joints: Array) -> Array:
        """Return torques of joints (n, n_joints) as rows of all equations."""
        rows = np.zeros((len(joints), self.first + self.n))
        rows[:, self.first :] = joints
        return rows


def fit_dynamics(
    robot: RobotDescription, logs: list[MotionLog], band: float | None = None,
    trusted: tuple[str, ...] = (),
) -> tuple[DynamicsModel, FittedDynamics]:  # fmt: skip
    """Fit a robot's dynamics to logs.

    Args:
        robot: whose structure and values beforehand are taken.
        logs: all with torques.
        band: in which is fitted [Hz]; by default by the torques' spectra.
        trusted: joints whose torques are right, not only in proportion.

    Raises:
        IdentificationError: the logs do not tell it: too short, without torques, a base whose motion is unknown; or there is no such
            joint.
    """
    for log in logs:
        missing(log, robot)
    torques = same_measurements(logs)
    weighed = torques or any(log.wrenches is not None for log in logs)
    model = DynamicsModel(robot, torques, weighed)
    for name in trusted:
        if name not in model.joints:
            raise IdentificationError(
                f"{robot.name} has no joint {name} to trust; it has {', '.join(model.joints)}"
            )
        model.constant_std[model.joints.index(name)] = TRUSTED_STD
    chosen = band_of(logs) if band is None else band
    found, moved = _with_variants(model, logs, chosen)
    load = model.part("load")
    std = np.sqrt(np.diag(found.covariance + moved))
    weak = np.flatnonzero(np.abs(found.value[load]) < TOLD * std[load])
    covariance = found.covariance + moved
    if len(weak):
        # Left free, what a log does not tell of it is traded against Coulomb friction, and fails where torques are larger.
        model.without_load = weak
        again, moved = _with_variants(model, logs, chosen)
        covariance = again.covariance + moved
        at = load.start + weak
        covariance[at, at] = std[at] ** 2
        found = again
    return model, FittedDynamics(
        found.unknowns, found.value, covariance, found.prior_std, found.noise, chosen, found.equations
    )  # fmt: skip


def same_measurements(logs: list[MotionLog]) -> bool:
    """Return whether logs have torques. Raises ``IdentificationError`` if only some of them have."""
    with_them = [log.name for log in logs if log.torque is not None]
    if len(with_them) not in (0, len(logs)):
        raise IdentificationError(
            f"of these logs only {', '.join(with_them)} have torques; fit those with and those without each on their own"
        )
    return bool(with_them)


def _with_variants(
    model: DynamicsModel, logs: list[MotionLog], band: float
) -> tuple[FittedDynamics, Array]:
    """Return a fit, and the covariance that its variants add."""
    found = _fitted(model, logs, band)
    added = np.zeros_like(found.covariance)
    for narrower, sharper in VARIANTS:
        model.speed = sharper * SPEED
        moved = _fitted(model, logs, narrower * band).value - found.value
        added += np.outer(moved, moved)
    model.speed = SPEED
    return found, added


def _fitted(model: DynamicsModel, logs: list[MotionLog], band: float) -> FittedDynamics:
    formed = [model.form(log, band) for log in logs]
    share = np.maximum(np.mean([each.share for each in formed], axis=0), 1e-9)
    if share.mean() < LEAST_LEFT:
        raise IdentificationError(
            f"the ground's forces leave {share.mean():.1%} of the equations of {logs[0].name}: its feet stand all the time, and without "
            "torques or whole wrenches nothing is told. Log forces and moments of the feet (contacts: force), torques, or jumps"
        )
    value = model.mean.copy()
    std = model.prior_std(formed)
    prior = np.diag(std**2)
    prior[model.part("base"), model.part("base")] = model.base_prior
    known = np.linalg.inv(prior + 1e-12 * np.diag(std**2))
    noise = np.concatenate([each.torque for each in formed]).std(axis=0) + 1e-9
    if model.first:
        noise = (
            np.concatenate(
                [each.torque - model.predicted(value, each, 0)[0] for each in formed]
            ).std(axis=0)
            / np.sqrt(share)
            + 1e-9
        )
    thinned = 0.5  # instants are a little closer than the band's errors are independent
    count = len(value)
    normal, middle = known, np.zeros((count, count))
    for _ in range(ROUNDS):
        normal, side = known.copy(), known @ (model.mean - value)
        middle, errors = np.zeros((count, count)), []
        for each in formed:
            made = [model.predicted(value, each, half) for half in (0, 1)]
            error = each.torque - 0.5 * (made[0][0] + made[1][0])
            errors.append(error)
            weight = np.minimum(1.0, OUTLYING * noise / np.maximum(np.abs(error), 1e-12)) / noise**2
            scores = np.zeros((len(error), count))
            for half in (0, 1):
                instruments = made[1 - half][1] * weight[:, :, None] * (0.5 * thinned)
                normal += np.einsum("mrk,mrl->kl", instruments, made[half][1])
                scores += np.einsum("mrk,mr->mk", instruments, each.torque - made[half][0])
            side += scores.sum(axis=0)
            period = (each.low.centres[1] - each.low.centres[0]) * _period(each)
            size = max(1, round(CLUSTER / (band * period)))
            for start in range(0, len(scores), size):
                one = scores[start : start + size].sum(axis=0)
                middle += np.outer(one, one)
        value = value + np.linalg.solve(normal, side)
        noise = np.concatenate(errors).std(axis=0) / np.sqrt(share) + 1e-9
    inverse = np.linalg.inv(normal)
    if model.first:  # many unknowns fit some of the noise of the equations that are left
        independent = thinned * sum(len(each.torque) for each in formed) * float(share.sum())
        free = count - float(np.trace(inverse @ known))  # what is not held by the prior
        middle *= independent / max(independent - free, 0.1 * independent)
    covariance = inverse @ (middle + known) @ inverse.T
    equations = sum(each.torque.size for each in formed)
    return FittedDynamics(model.unknowns, value, covariance, std, noise, band, equations)


def _period(formed: FormedLog) -> float:
    log = formed.log
    return (len(log.position) - 1) / max(1, len(formed.motions[0].position) - 1) * log.period
