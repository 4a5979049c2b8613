"""Gross errors of an IMU that ``FaultDetector`` finds before the thrust: units, signs, axes; and their words."""

from __future__ import annotations

import math

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ..signals import DynamicsTerms, FootLoad, ImuReading, JointState, Phase, PhaseState
from .fault_detector_state import (
    FaultDetectorConstants,
    FaultDetectorParams,
    FaultDetectorScratch,
    FaultDetectorState,
    Stop,
)

_SPREAD = 0.05
"""Points with a smaller share of their greatest distance from their middle across than along are in a line, or nearly."""
DEGREES = 180.0 / np.pi


def looks_like(read: float, right: float) -> str:
    """Say which error of a driver a rate looks like, if the base turns fast enough to tell."""
    if abs(right) < 0.05:  # as much as noise
        return ""
    ratio = read / right
    if -2.0 < ratio < -0.5:
        return ": its sign looks wrong"
    if 0.5 * DEGREES < ratio < 2.0 * DEGREES:
        return ": it looks like degrees per second"
    return ""


def gravity_looks_like(read: Array, right: Array) -> str:
    """Say which error of a driver a reading at rest looks like."""
    length = float(np.sqrt(read @ read)) / GRAVITY
    if 0.8 / GRAVITY < length < 1.2 / GRAVITY:
        return ": it looks like g in place of m/s^2"
    if not 0.8 < length < 1.2:
        return f": its length is {length:.2f} g"
    changes = {"the sign of all axes": -read}
    for axis in range(3):
        turned = read.copy()
        turned[axis] = -turned[axis]
        changes[f"the sign of {'xyz'[axis]}"] = turned
    for first, second in ((0, 1), (0, 2), (1, 2)):
        turned = read.copy()
        turned[[first, second]] = turned[[second, first]]
        changes[f"the order of {'xyz'[first]} and {'xyz'[second]}"] = turned
    near = {name: float(np.abs(turned - right).max()) for name, turned in changes.items()}
    best = min(near.values())
    found = [name for name, off in near.items() if off < best + 0.1 * GRAVITY]
    return f": {' or '.join(found)} looks wrong" if best < 0.3 * GRAVITY else ""


def push_looks_like(read: Array, right: Array) -> str:
    """Say which error of a driver a reading in squat or thrust looks like."""
    along = float(read @ right / (right @ right))
    if -2.0 < along < -0.5:
        return ": its sign looks wrong"
    if 0.5 / GRAVITY < along < 2.0 / GRAVITY:
        return ": it looks like g in place of m/s^2"
    return ""


def vector_text(values: Array) -> str:
    return f"({', '.join(f'{value:+.2f}' for value in values)})"


# Gross errors before the thrust


@kernel
def find_gross_rate(
    judged: bool,
    most: float,
    largest: float,
    imu: ImuReading,
    state: FaultDetectorState,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
) -> None:
    """Count the ticks in which an axis of the gyroscope reads by more than ``most`` [rad/s] otherwise than the base turns
    over its feet. A rate beyond the ``largest`` [rad/s] that
    any gyroscope reads ends the run at once, in every phase."""
    for axis in range(3):
        off = abs(imu.angular_velocity[axis] - scratch.turning[1, axis])
        gross = judged and most > 0.0 and not off <= most
        state.gross[axis] = state.gross[axis] + 1 if gross else 0
        if largest > 0.0 and not abs(imu.angular_velocity[axis]) <= largest:
            state.gross[axis] = constants.gross_ticks[0] + 1
        if state.gross[axis] > constants.gross_ticks[0]:
            state.stop = Stop.GYROSCOPE
            state.reading[:] = imu.angular_velocity
            state.right[:] = scratch.turning[1]


@kernel
def find_gross_gravity(
    imu: ImuReading,
    joints: JointState,
    terms: DynamicsTerms,
    phase: PhaseState,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
) -> None:
    """Count the ticks in which the accelerometer of a robot that stands still does not read gravity."""
    still = phase.phase == Phase.STAND and params.gross_gravity > 0.0
    for k in range(joints.velocity.shape[0]):
        still = still and abs(joints.velocity[k]) < params.rest_speed
    gross, off = False, 0.0
    if still and away_from_feet(terms, phase, scratch):
        for axis in range(3):
            d = imu.specific_force[axis] - GRAVITY * scratch.up[axis]
            off += d * d
        most = params.gross_gravity * GRAVITY
        gross = not off <= most * most
    # an IMU that is upside down makes joints move within some ticks, which clears it of nothing
    if still:
        state.gross[3] = state.gross[3] + 1 if gross else 0
        state.rested += 1
    # upside down it makes the robot jerk at the third tick: the first two are enough for so large an error
    upside_down = still and state.rested == 2 and state.gross[3] == 2 and off > GRAVITY * GRAVITY
    if upside_down or (gross and state.gross[3] > constants.gross_ticks[1]):
        state.stop = Stop.GRAVITY
        state.reading[:] = imu.specific_force
        state.right[:] = GRAVITY * scratch.up


@kernel
def find_gross_push(
    judged: bool,
    imu: ImuReading,
    load: FootLoad,
    terms: DynamicsTerms,
    phase: PhaseState,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
) -> None:
    """Count the ticks of squat, thrust, landing and recovery in which the accelerometer reads less than a share of what the legs push.

    Feet only push, and what they push by the legs' torques is what a mass on them feels. Judged is where
    they carry more than ``open_load``.
    """
    pushed = 0.0
    for foot in range(load.force.shape[0]):
        pushed += load.force[foot] / constants.weight
    gross, read = False, 0.0
    heavy = judged and params.gross_push > 0.0 and pushed > params.open_load
    if heavy and away_from_feet(terms, phase, scratch):
        for axis in range(3):
            read += imu.specific_force[axis] * scratch.up[axis]
        gross = not read > params.gross_push * GRAVITY * pushed
    state.gross[4] = state.gross[4] + 1 if gross else 0
    if state.gross[4] > constants.gross_ticks[0]:
        state.stop = Stop.PUSH
        state.reading[:] = imu.specific_force
        state.right[:] = GRAVITY * pushed * scratch.up


@kernel
def away_from_feet(terms: DynamicsTerms, phase: PhaseState, scratch: FaultDetectorScratch) -> bool:
    """Compute the normal of the plane through the points that should carry the robot, in the base's axes, towards the
    base; false where they are in a line."""
    arm, mean, up = scratch.arm, scratch.mean, scratch.up
    count = 0
    mean[0] = 0.0
    for point in range(arm.shape[0]):
        if phase.stance[point]:
            count += 1
            for axis in range(3):
                total = 0.0
                for k in range(3):
                    away = terms.contact_position[point, k] - terms.base_position[k]
                    total += terms.base_rotation[k, axis] * away
                arm[point, axis] = total
                mean[0, axis] += total
    if count < 3:
        return False
    mean[0] /= count
    largest, width = 0.0, 0.0
    for first in range(arm.shape[0]):
        for second in range(first):
            if phase.stance[first] and phase.stance[second]:
                a0, a1, a2 = (
                    arm[first, 0] - mean[0, 0],
                    arm[first, 1] - mean[0, 1],
                    arm[first, 2] - mean[0, 2],
                )
                b0, b1, b2 = (
                    arm[second, 0] - mean[0, 0],
                    arm[second, 1] - mean[0, 1],
                    arm[second, 2] - mean[0, 2],
                )
                width = max(width, a0 * a0 + a1 * a1 + a2 * a2)
                x, y, z = a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
                area = x * x + y * y + z * z
                if area > largest:
                    largest = area
                    up[0] = x
                    up[1] = y
                    up[2] = z
    if not largest > _SPREAD * _SPREAD * width * width:
        return False
    size = math.sqrt(largest)
    # the base is on the other side of the plane than the feet
    if up[0] * mean[0, 0] + up[1] * mean[0, 1] + up[2] * mean[0, 2] > 0.0:
        size = -size
    for axis in range(3):
        up[axis] /= size
    return True
