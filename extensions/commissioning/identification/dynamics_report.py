"""A judgement of a fit of a robot's dynamics: what it leaves on every log, whether the motors agree, and what to beware of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....mathematics.arrays import Array
from ....robots.robot_description import RobotDescription
from .band import LowPass
from .consistent_body import ConsistentDynamics, consistent_dynamics
from .dynamics_fit import (
    CONSTANT_STD,
    DynamicsModel,
    FittedDynamics,
    fit_dynamics,
    same_measurements,
)
from .identification import Estimate, IdentificationError
from .motion_log import MotionLog, missing

JUDGED = 10.0
"""Residuals are those below this frequency [Hz], as far as a log's rate allows."""
POSITION_SHARE = 0.05
"""A torque whose part that no function of the positions explains is smaller than this share of it is one of position alone."""
DISAGREE = 2.0
"""Standard deviations between the torque constants of two motors from which on they disagree."""
UNTOLD = 0.7
"""A value whose standard deviation is above this share of that beforehand is not told."""
TYPICAL = 1.4826
PARTS, FEWEST_OF_PART = 4, 15
"""The parts of a log whose delays are compared, and the fewest instants of one."""
LATEST = 0.1
"""The largest delay that is looked for [s]."""


@dataclass(frozen=True)
class LogResidual:
    """Root mean squares on one log, by joint or equation of the base [N m or N]: of the torque or the ground's measured force, of what the
    fit does not explain, and of what the description does not."""

    log: str
    held_out: bool
    torque: dict[str, float]
    fitted: dict[str, float]
    described: dict[str, float]


@dataclass(frozen=True)
class IdentifiedDynamics:
    """A robot's dynamics by its logs.

    Attributes:
        model, fit: the equations, and what the fit found.
        body: the nearest values that bodies can have, which ``value`` and the residuals are of.
        residuals: of every log, the held-out ones last.
        delay: from command to torque, where the logs tell it.
        warnings: what to beware of.
        untold: what the logs cannot tell, and why.
    """

    model: DynamicsModel
    fit: FittedDynamics
    body: ConsistentDynamics
    residuals: tuple[LogResidual, ...]
    delay: Estimate | None
    warnings: tuple[str, ...]
    untold: tuple[str, ...]

    def values(self, kind: str) -> dict[str, Estimate]:
        """Return by name the values of a kind: ``base``, ``rotor inertia``, ``coulomb``, ``viscous``, ``load``,
        ``torque constant``, ``offset`` or ``age of torques``."""
        constants = kind == "torque constant"
        part = self.model.part("log constant" if constants else kind)
        std = np.sqrt(np.diag(self.fit.covariance))[part]
        names = [name.partition(" of ")[2] or name for name in self.fit.unknowns.names[part]]
        if kind == "base":
            names = self.fit.unknowns.names[part]
        found = self.body.value[part]
        if constants:
            found, std = np.exp(found), np.exp(found) * std
        return {n: Estimate(float(v), float(s)) for n, v, s in zip(names, found, std, strict=True)}


def identify_dynamics(
    robot: RobotDescription, logs: list[MotionLog], held_out: list[MotionLog] | None = None,
    band: float | None = None, trusted: tuple[str, ...] = (),
) -> IdentifiedDynamics:  # fmt: skip
    """Fit a robot's dynamics to logs and say what the fit is worth.

    Args:
        robot: whose structure and values beforehand are taken.
        logs: that are fitted.
        held_out: that judge the fit.
        band: in which is fitted [Hz]; by default by the torques' spectra.
        trusted: joints whose torques are right, not only in proportion.

    Raises:
        IdentificationError: the logs do not tell it, or there is no such joint.
    """
    judges = held_out or []
    untold = [text for log in logs for text in missing(log, robot)]
    for log in judges:
        missing(log, robot)
    same_measurements([*logs, *judges])
    model, fit = fit_dynamics(robot, logs, band, trusted)
    body = consistent_dynamics(model, fit)
    residuals = [residual_of(model, body.value, log, False) for log in logs]
    residuals += [residual_of(model, body.value, log, True) for log in judges]
    part = model.part("base")
    before = fit.prior_std[part]
    if (np.sqrt(np.diag(fit.covariance))[part] > UNTOLD * before).all():
        raise IdentificationError(
            f"{logs[0].name} has too little motion: it tells no mass, moment or inertia better than the description"
        )
    warnings = [
        *_of_position_alone(model, logs), *_disagreeing(model, fit), *_inconsistent(body),
        *_not_extrapolating(residuals, model.joints),
    ]  # fmt: skip
    forces = any(log.wrenches is not None for log in logs)
    untold += _not_told(model, fit, bool(trusted) or forces)
    return IdentifiedDynamics(
        model, fit, body, tuple(residuals), _delay(logs), tuple(warnings),
        tuple(dict.fromkeys(untold)),
    )  # fmt: skip


def residual_of(model: DynamicsModel, value: Array, log: MotionLog, held_out: bool) -> LogResidual:
    """Return what unknowns leave of a log's torques below ``JUDGED`` Hz, beside what the description leaves."""
    formed = model.form(log, min(JUDGED, 0.1 / log.period))
    described = model.mean.copy()
    described[model.part("coulomb")] = model.robot.motors.friction[: model.n]
    described[model.part("viscous")] = model.robot.motors.damping[: model.n]

    def rms(rows: Array) -> dict[str, float]:
        sizes = np.sqrt((rows**2).mean(axis=0))
        return dict(zip(model.equations, sizes.tolist(), strict=True))

    left = []
    for each in (value, described):
        made = [model.predicted(each, formed, half)[0] for half in (0, 1)]
        left.append(rms(formed.torque - 0.5 * (made[0] + made[1])))
    return LogResidual(log.name, held_out, rms(formed.torque), left[0], left[1])


def _of_position_alone(model: DynamicsModel, logs: list[MotionLog]) -> list[str]:
    """Warn of torques that follow from the positions alone: a controller is identified, not the robot."""
    found = []
    for log in logs:
        if log.torque is None:
            continue
        q = log.position[:: max(1, len(log.position) // 4000)]
        torque = log.torque[:: max(1, len(log.position) // 4000)]
        columns = [np.ones(len(q))]
        for a in range(q.shape[1]):
            if np.ptp(q[:, a]) < 1e-6:
                continue
            columns += [q[:, a], q[:, a] ** 2, q[:, a] ** 3, np.sin(q[:, a]), np.cos(q[:, a])]
            columns += [f(q[:, a] + q[:, b]) for b in range(a) for f in (np.sin, np.cos)][:20]
        basis = np.stack(columns, axis=1)
        basis = basis / np.maximum(np.linalg.norm(basis, axis=0), 1e-12)
        left = torque - basis @ np.linalg.lstsq(basis, torque, rcond=1e-9)[0]
        for j, name in enumerate(model.joints):
            size = float(torque[:, j].std())
            if size > 1e-9 and left[:, j].std() < POSITION_SHARE * size:
                found.append(
                    f"{log.name}: the torque of {name} is a function of the positions alone, to {100 * left[:, j].std() / size:.1f} "
                    "%: a controller is identified, not the robot. Fit a log with other torques, such as a swing by hand or "
                    "by sines"
                )
            elif size > 1e-9 and np.ptp(log.torque[:, j]) < 1e-9 * abs(float(torque[0, j])):
                found.append(f"{log.name}: the torque of {name} is constant")
    return found


def _disagreeing(model: DynamicsModel, fit: FittedDynamics) -> list[str]:
    part = model.part("log constant")
    value, covariance = fit.value[part], fit.covariance[part, part]
    found = []
    for a in range(len(value)):
        for b in range(a):
            apart = value[a] - value[b]
            std = np.sqrt(covariance[a, a] + covariance[b, b] - 2.0 * covariance[a, b])
            if abs(apart) > DISAGREE * std:
                found.append(
                    f"the motors disagree about the same body: the torque constant of {model.joints[a]} is "
                    f"{np.exp(apart):.3g} +- {np.exp(apart) * std:.2g} times that of {model.joints[b]}, relative to the log's"
                )
    return found


def _inconsistent(body: ConsistentDynamics) -> list[str]:
    return [
        f"{name} had to move by {far:.1f} standard deviations to be that of a body: the model lacks something"
        for name, far in body.moved.items()
    ]


def _not_extrapolating(residuals: list[LogResidual], joints: list[str]) -> list[str]:
    """Warn where a held-out log leaves much more than the training ones, relative to its torque."""
    found = []
    for each in residuals:
        if not each.held_out:
            continue
        for joint in joints:
            trained = [
                r.fitted[joint] / max(r.torque[joint], 1e-9) for r in residuals if not r.held_out
            ]
            share = each.fitted[joint] / max(each.torque[joint], 1e-9)
            if share > 1.5 * max(trained):
                found.append(
                    f"{each.log}: {share:.0%} of the torque of {joint} is not explained, and at most {max(trained):.0%} of the "
                    "fitted logs': the fit does not hold for such motion"
                )
    return found


def _not_told(model: DynamicsModel, fit: FittedDynamics, scaled: bool) -> list[str]:
    std = np.sqrt(np.diag(fit.covariance))
    untold = [
        f"{name}: near the description's, for the logs do not tell it"
        for name, found, before in zip(fit.unknowns.names, std, fit.prior_std, strict=True)
        if found > UNTOLD * before
        and not name.startswith(("load", "log constant", "offset", "accelerometer"))
    ]
    untold += [
        f"friction with load of {model.joints[j]}: left out, for the logs do not tell it from none"
        for j in model.without_load.tolist()
    ]
    if not model.weighed:
        untold.append(
            "the whole mass: in flight nothing weighs the robot, so it is the description's, and all else is relative to it"
        )
    elif not scaled:
        untold.append(
            "a common factor on torque constants, inertias and friction: torque and motion scale together, so it is as "
            "known as the torque constants beforehand, to "
            f"{CONSTANT_STD / np.sqrt(len(model.joints)):.0%}; a joint whose torque is trusted tells it"
        )
    return untold


def _delay(logs: list[MotionLog]) -> Estimate | None:
    """Return the delay from command to measured torque, and how far logs, joints and parts of them differ."""
    found, within = [], []
    for log in logs:
        if log.asked is None or log.torque is None:
            continue
        for asked, seen in zip(log.asked.T, log.torque.T, strict=True):
            parts = [
                late
                for a, b in zip(
                    np.array_split(asked, PARTS), np.array_split(seen, PARTS), strict=True
                )
                if (late := _lateness(a, b, log.period)) is not None
            ]
            if len(parts) > PARTS // 2:
                found.append(float(np.median(parts)))
                within.append(TYPICAL * float(np.median(np.abs(np.array(parts) - found[-1]))))
    if not found:
        return None
    among = float(np.std(found, ddof=1)) if len(found) > 1 else 0.0
    return Estimate(float(np.mean(found)), float(np.hypot(np.mean(within), among)))


def _lateness(asked: Array, seen: Array, period: float) -> float | None:
    """Return by how much one torque follows another [s], where the one explains the other."""
    band = min(JUDGED, 0.1 / period)
    low, late = LowPass.of(len(asked), period, band), 0.0
    if len(low.centres) < FEWEST_OF_PART or not asked.any():
        return None
    index, passed = np.arange(len(asked)), low(seen[:, None])[:, 0]
    for _ in range(4):
        moved = np.interp(index - late / period, index, asked)[:, None]
        columns = np.stack(
            [low(moved)[:, 0], -low(moved, derivative=True)[:, 0], np.ones(len(passed))], axis=1
        )
        share, slope, _ = np.linalg.lstsq(columns, passed, rcond=None)[0].tolist()
        if share < 0.2:
            return None
        late = float(np.clip(late + slope / share, 0.0, LATEST))
    left = passed - columns @ np.linalg.lstsq(columns, passed, rcond=None)[0]
    return late if left.std() < 0.5 * passed.std() else None
