"""Gross errors that ``FaultDetector`` ends a run for: units, signs and axes of an IMU, open switches, falls; and their words."""

from __future__ import annotations

import math

import numpy as np

from ...mathematics.arrays import Array, Flags1D
from ...mathematics.constants import GRAVITY
from ...mathematics.kernel import kernel
from ..signals import (
    ContactSwitches,
    DynamicsTerms,
    FootLoad,
    ImuReading,
    JointState,
    Phase,
    PhaseState,
)
from .fault_detector_state import (
    FaultDetectorConstants,
    FaultDetectorParams,
    FaultDetectorScratch,
    FaultDetectorState,
    Stop,
    Suspect,
)
from .leg_forces import force_along, solve_leg

_FAST = 5.0
"""How much larger ``gross_rate`` is in the thrust."""
_IMPACT = 0.04
"""For so long after a touchdown [s] any rate is that of the impact."""
_MOST = 5.0
"""A leg that is nearly straight seems to push more than so many weights, of which its torques say little."""
_LEANS = 0.05
"""Sine of a lean below which its direction is that of noise."""
_DUE = 0.05
"""Flights whose touchdown is due within this time [s] may end unseen; before, limbs that are drawn in move the base."""
_PUSH, _ACROSS, _LEAN, _OPEN, _LANDED, _FALL = range(4, 10)
"""Elements of ``FaultDetectorState.gross``; the first three are the gyroscope's axes, then gravity."""
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
    return axes_look_like(read, right)


def axes_look_like(read: Array, right: Array) -> str:
    """Say which axes of a reading have the wrong sign or order, where the rest is right."""
    most = 0.3 * float(np.sqrt(right @ right))
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
    found = [name for name, off in near.items() if off < best + most / 3.0]
    return f": {' or '.join(found)} looks wrong" if best < most else ""


def push_looks_like(read: Array, right: Array) -> str:
    """Say which error of a driver a reading in squat or thrust looks like."""
    along = float(read @ right / (right @ right))
    length = float(np.sqrt((read @ read) / (right @ right)))
    if -2.0 < along < -0.5:
        return ": its sign looks wrong"
    if 0.5 / GRAVITY < along <= length < 2.0 / GRAVITY:
        return ": it looks like g in place of m/s^2"
    return axes_look_like(read, right)


def vector_text(values: Array) -> str:
    return f"({', '.join(f'{value:+.2f}' for value in values)})"


def stop_text(state: FaultDetectorState, p: FaultDetectorParams, suspect: str) -> str:
    """Describe in words what ended the run: what was read, what is right, and what that looks like; ``suspect`` describes
    the first suspect."""
    read, right, stop = state.reading.copy(), state.right.copy(), Stop(int(state.stop))
    if stop == Stop.GYROSCOPE:
        axis = int(np.argmax(np.abs(read - right)))
        if not np.abs(read).max() <= p.largest_rate or not np.isfinite(read).all():
            axis = int(np.argmax(np.abs(read)))
            return (
                f"the gyroscope's axis {'xyz'[axis]} reads {read[axis]:+.2f} rad/s, beyond the range of any; is it in degrees per "
                f"second? Correct the driver (largest_rate is {p.largest_rate:g} rad/s)"
            )
        return (
            f"the gyroscope's axis {'xyz'[axis]} reads {read[axis]:+.2f} rad/s while the base turns over its feet by "
            f"{right[axis]:+.2f}{looks_like(read[axis], right[axis])}; correct the driver or the IMU's mounting "
            f"(gross_rate is {p.gross_rate:g} rad/s)"
        )
    if stop == Stop.PUSH:
        return (
            f"the accelerometer reads {vector_text(read)} m/s^2 while the legs push {vector_text(right)}"
            f"{push_looks_like(read, right)}; correct the driver or the IMU's mounting (gross_push is {p.gross_push:g}, "
            f"gross_across {p.gross_across:g})"
        )
    if stop == Stop.SUSPECT:
        return f"ended for what is suspected: {suspect} (suspects_end)"
    if stop == Stop.LEAN:
        turned = np.degrees(float(np.sqrt((read - right) @ (read - right))))
        return (
            f"the ground under the feet seems to have turned by {turned:.1f} deg since the robot stood up: its attitude is wrong, as by "
            f"a biased gyroscope (gross_lean is {np.degrees(p.gross_lean):.1f} deg)"
        )
    if stop == Stop.SWITCHES:
        return (
            f"no foot switch has been closed for {1e3 * p.gross_open:g} ms under feet that carry more than "
            f"{100.0 * p.open_load:g} % of the weight (gross_open)"
        )
    if stop == Stop.LANDED:
        return (
            f"the accelerometer reads {vector_text(read)} m/s^2 in flight: the robot has landed, and no foot switch is closed "
            f"(gross_landing is {p.gross_landing:g} g)"
        )
    if stop == Stop.FALL:
        return (
            f"the robot falls: its gyroscope reads {vector_text(read)} rad/s after the touchdown (falling_rate is {p.falling_rate:g} "
            f"rad/s)"
        )
    return (
        f"the accelerometer reads {vector_text(read)} m/s^2 at rest, where the legs say {vector_text(right)}"
        f"{gravity_looks_like(read, right)}; correct the driver or the IMU's mounting (gross_gravity is {p.gross_gravity:g} g)"
    )


@kernel
def find_gross_errors(
    rigid: bool,
    imu: ImuReading,
    joints: JointState,
    terms: DynamicsTerms,
    load: FootLoad,
    switches: ContactSwitches,
    phase: PhaseState,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
) -> None:
    """Find what ends the run in this tick; ``rigid``: enough points stand, and do not slide."""
    on_the_ground = phase.phase >= Phase.STAND and phase.phase <= Phase.THRUST
    jumps = phase.phase == Phase.SQUAT or phase.phase == Phase.THRUST
    landed = phase.phase == Phase.LANDING or phase.phase == Phase.RECOVER
    most = params.gross_rate * (_FAST if phase.phase == Phase.THRUST else 1.0)
    find_gross_rate(
        on_the_ground and rigid, most, params.largest_rate, imu, state, constants, scratch
    )
    find_gross_gravity(imu, joints, terms, phase, state, params, constants, scratch)
    pushed, open = 0.0, True
    for foot in range(load.force.shape[0]):
        pushed += load.force[foot] / constants.weight
    for point in range(switches.closed.shape[0]):
        open = open and not switches.closed[point]
    heavy = pushed > params.open_load and pushed < _MOST
    find_gross_push(
        (jumps or landed) and rigid and heavy, pushed, imu, terms, phase, state, params, constants, scratch,
    )  # fmt: skip
    find_gross_force_across(jumps and heavy, imu, joints, terms, state, params, constants, scratch)
    trusted = rigid and state.suspect != Suspect.ENCODER  # by the encoders the ground leans
    find_lean(on_the_ground, trusted, terms, state, params, constants, scratch)
    if persists(
        state, _OPEN, jumps and heavy and open and params.gross_open > 0.0, constants.gross_ticks[2]
    ):
        state.stop = Stop.SWITCHES
    flies = phase.phase == Phase.FLIGHT and phase.time_to_touchdown < _DUE
    most = params.gross_landing * GRAVITY
    strikes = flies and open and most > 0.0 and not imu.specific_force[2] <= most
    if persists(state, _LANDED, strikes, constants.gross_ticks[0]):
        state.stop = Stop.LANDED
        state.reading[:] = imu.specific_force
    landed = landed and phase.time_since_touchdown > _IMPACT
    # the base's z leans over by the rate across the direction in which it leans
    x, y = terms.base_rotation[2, 0], terms.base_rotation[2, 1]
    lean = math.sqrt(x * x + y * y)
    leaning = y * imu.angular_velocity[0] - x * imu.angular_velocity[1]
    most = params.falling_rate
    falls = landed and lean > _LEANS and most > 0.0 and not leaning <= most * lean
    if persists(state, _FALL, falls, constants.gross_ticks[3]):
        state.stop = Stop.FALL
        state.reading[:] = imu.angular_velocity
    suspected = state.suspect != Suspect.NONE and state.suspect != Suspect.ENCODER
    stands = on_the_ground or landed
    blind = phase.phase == Phase.STAND and state.suspect == Suspect.SWITCHES
    ends = (jumps and suspected) or blind or (stands and state.suspect == Suspect.GYROSCOPE)
    if state.stop == Stop.NONE and ends and params.suspects_end:
        state.stop = Stop.SUSPECT


@kernel
def persists(state: FaultDetectorState, place: int, gross: bool, ticks: int) -> bool:
    """Count the ticks in a row with a ``gross`` error; return whether they are more than are borne, and the first to end the run."""
    state.gross[place] = state.gross[place] + 1 if gross else 0
    found: bool = state.gross[place] > ticks and state.stop == Stop.NONE
    return found


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
    if still and away_from_feet(terms, phase.stance, scratch):
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
    pushed: float,
    imu: ImuReading,
    terms: DynamicsTerms,
    phase: PhaseState,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
) -> None:
    """Count the ticks of squat, thrust, landing and recovery in which the accelerometer reads less than a share of what the legs push.

    Feet only push, and what they push by the legs' torques, ``pushed`` weights, is what a mass on them feels.
    """
    gross, read = False, 0.0
    if judged and params.gross_push > 0.0 and away_from_feet(terms, phase.stance, scratch):
        for axis in range(3):
            read += imu.specific_force[axis] * scratch.up[axis]
        gross = not read > params.gross_push * GRAVITY * pushed
    if persists(state, _PUSH, gross, constants.gross_ticks[0]):
        state.stop = Stop.PUSH
        state.reading[:] = imu.specific_force
        state.right[:] = GRAVITY * pushed * scratch.up


@kernel
def find_gross_force_across(
    judged: bool,
    imu: ImuReading,
    joints: JointState,
    terms: DynamicsTerms,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
) -> None:
    """Count the ticks of squat and thrust in which the legs lack much of the force across that the accelerometer reads, and
    would lack little with the other sign of its x or y."""
    gross = False
    if judged and params.gross_across > 0.0:
        weigh(imu, joints, terms, constants, scratch)
        mass = constants.weight / GRAVITY
        for axis in range(2):
            off, mirrored = scratch.lacking[axis], 2.0 * mass * imu.specific_force[axis]
            fits = abs(off - mirrored) < 0.5 * abs(off)
            gross = gross or (fits and abs(off) > params.gross_across * constants.weight)
    if persists(state, _ACROSS, gross, constants.gross_ticks[0]):
        state.stop = Stop.PUSH
        state.reading[:] = imu.specific_force
        state.right[:] = imu.specific_force
        for axis in range(2):
            state.right[axis] -= scratch.lacking[axis] * GRAVITY / constants.weight


@kernel
def find_lean(
    judged: bool,
    rigid: bool,
    terms: DynamicsTerms,
    state: FaultDetectorState,
    params: FaultDetectorParams,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
) -> None:
    """Count the ticks before lift-off in which the plane of the points that stand is not what it was when they first stood."""
    if not judged:
        state.grounded = False
    elif rigid and params.gross_lean > 0.0 and away_from_feet(terms, scratch.stands, scratch):
        off = 0.0
        for axis in range(3):
            total = 0.0
            for k in range(3):
                total += terms.base_rotation[axis, k] * scratch.up[k]
            if not state.grounded:
                state.ground[axis] = total
            scratch.mean[0, axis] = total
            off += (total - state.ground[axis]) * (total - state.ground[axis])
        state.grounded = True
        gross = not off <= params.gross_lean * params.gross_lean
        if persists(state, _LEAN, gross, constants.gross_ticks[1]):
            state.stop = Stop.LEAN
            state.reading[:] = scratch.mean[0]
            state.right[:] = state.ground


@kernel
def weigh(
    imu: ImuReading,
    joints: JointState,
    terms: DynamicsTerms,
    constants: FaultDetectorConstants,
    scratch: FaultDetectorScratch,
) -> None:
    """Compute the force on the base at rest that the legs' torques leave unexplained: of M_b a - J_b' f the force, in
    the base's axes."""
    mass, a, lacking, force = terms.mass_matrix, imu.specific_force, scratch.lacking, scratch.force
    first = terms.velocity.shape[0] - joints.torque.shape[0]
    for row in range(mass.shape[0]):
        total = mass[row, 0] * a[0] + mass[row, 1] * a[1] + mass[row, 2] * a[2]
        if row < 3:
            lacking[row] = total
        elif row >= first:
            scratch.needed[row - first] = total - joints.torque[row - first]
    for foot in range(constants.leg_joints.shape[0]):
        leg = constants.leg_joints[foot]
        solve_leg(
            foot, terms.contact_jacobian, scratch.needed, leg, constants.foot_of_point, first,
            scratch.normal, scratch.solution,
        )  # fmt: skip
        for point in range(constants.foot_of_point.shape[0]):
            if constants.foot_of_point[point] == foot:
                for axis in range(3):
                    jacobian = terms.contact_jacobian[point, axis]
                    force[axis] = force_along(jacobian, leg, scratch.solution, first)
                for k in range(3):
                    for axis in range(3):
                        lacking[k] -= terms.contact_jacobian[point, axis, k] * force[axis]


@kernel
def away_from_feet(terms: DynamicsTerms, points: Flags1D, scratch: FaultDetectorScratch) -> bool:
    """Compute the normal of the plane through some ``points`` (n_contacts,), in the base's axes, towards the base; false
    where they are in a line."""
    arm, mean, up = scratch.arm, scratch.mean, scratch.up
    count = 0
    mean[0] = 0.0
    for point in range(arm.shape[0]):
        if points[point]:
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
            if points[first] and points[second]:
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
