"""Joint feedback as pure functions: blending, soft stops, friction compensation, stance targets.

A feedback is a stiffness [N m/rad] towards an angle [rad] and a damping [N m s/rad] towards a
velocity [rad/s], with one element for each joint (n,). No function here allocates memory.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .arrays import Array1D, Array2D
from .kernel import kernel


class Feedback(NamedTuple):
    """Stiffness towards an angle and damping towards a velocity, (n,) each."""

    stiffness: Array1D
    position: Array1D
    damping: Array1D
    velocity: Array1D


class SoftStops(NamedTuple):
    """Springs and dampers that begin ``margin`` [rad] inside joint limits (n, 2).

    The springs have ``gain`` times ``stiffness``. The damping grows linearly from zero at the
    margin to ``gain`` times ``damping`` at the limit. ``margin`` and ``gain`` are (1,).
    """

    limits: Array2D
    margin: Array1D
    gain: Array1D
    stiffness: Array1D
    damping: Array1D


class Motion(NamedTuple):
    """Joint angles [rad] and velocities [rad/s], (n,) each."""

    position: Array1D
    velocity: Array1D


@kernel
def blend_feedback(
    weight: Array1D, first: Feedback, second: Feedback, measured: Motion, out: Feedback
) -> None:
    """Blend two feedbacks into one, whose torque is the weighted mean of both torques.

    With the weights w (n,) of the first feedback the gain is K = w K1 + (1 - w) K2 and the target
    (w K1 x1 + (1 - w) K2 x2) / K. Where K = 0 the target is the measured value.
    """
    blend_gain(
        weight, first.stiffness, first.position, second.stiffness, second.position,
        measured.position, out.stiffness, out.position,
    )  # fmt: skip
    blend_gain(
        weight, first.damping, first.velocity, second.damping, second.velocity,
        measured.velocity, out.damping, out.velocity,
    )  # fmt: skip


@kernel
def blend_gain(
    weight: Array1D,
    first_gain: Array1D,
    first_target: Array1D,
    second_gain: Array1D,
    second_target: Array1D,
    measured: Array1D,
    gain: Array1D,
    target: Array1D,
) -> None:
    """Blend one pair of gains and targets, stiffness or damping, as ``blend_feedback`` does."""
    for i in range(gain.shape[0]):
        first = weight[i] * first_gain[i]
        second = (1.0 - weight[i]) * second_gain[i]
        total = first + second
        gain[i] = total
        if total > 0.0:
            share = first / total
            target[i] = share * first_target[i] + (1.0 - share) * second_target[i]
        else:
            target[i] = measured[i]


@kernel
def add_soft_stops(measured: Array1D, stops: SoftStops, out: Feedback) -> None:
    """Add soft stops to a feedback where a measured angle (n,) is near its joint's limit."""
    margin, gain = stops.margin[0], stops.gain[0]
    for i in range(measured.shape[0]):
        angle = measured[i]
        edge = min(max(angle, stops.limits[i, 0] + margin), stops.limits[i, 1] - margin)
        depth = abs(angle - edge) / margin
        if depth > 0.0:
            spring = gain * stops.stiffness[i]
            total = spring + out.stiffness[i]
            if total > 0.0:
                pulled = spring * edge + out.stiffness[i] * out.position[i]
                out.position[i] = pulled / total
            out.stiffness[i] = total
            damper = gain * min(depth, 1.0) * stops.damping[i]
            total = damper + out.damping[i]
            if total > 0.0:
                out.velocity[i] = out.damping[i] * out.velocity[i] / total
            out.damping[i] = total


@kernel
def add_friction(
    velocity: Array1D, friction: Array1D, damping: Array1D, speed: float, torque: Array1D
) -> None:
    """Add the torque that compensates joint friction to ``torque`` [N m], (n,).

    It is friction tanh(velocity / speed) + damping velocity, with Coulomb ``friction`` [N m] and
    viscous ``damping`` [N m s/rad]. The first term is zero at rest and has three quarters of its
    full value at ``speed`` [rad/s].
    """
    torque[:] = torque + math.tanh(velocity / speed) * friction
    torque[:] = torque + velocity * damping


@kernel
def integrate_accelerations(
    period: float, leak: float, acceleration: Array1D, measured: Motion, targets: Motion
) -> None:
    """Integrate accelerations [rad/s^2] (n,) to ``targets`` that leak towards the measured joints.

    x' = v + (q - x) / leak and v' = a + (q' - v) / leak. Below the corner frequency 1/leak the
    targets follow the measured joints, so the feedback vanishes; above it they follow the
    integrated accelerations.
    """
    share = min(period / leak, 1.0)
    for i in range(acceleration.shape[0]):
        speed = targets.velocity[i]
        x = targets.position[i] + period * speed
        targets.velocity[i] = (
            speed + period * acceleration[i] + share * (measured.velocity[i] - speed)
        )
        targets.position[i] = x + share * (measured.position[i] - x)
