"""Motion of the base of a robot under constant contact forces, in stretches of some steps.

How the base turns under constant contact forces F follows from the momentum: the centre of mass flies a parabola, and
with the angular momentum k about it, the inertia I and the angular momentum h of the joints' motion in the base's axes,

    w = I^-1 (R' k - h),    dk/dt = sum (r - c) x F.

I, h and r - c depend on the joints only, and are known for every instant beforehand. Runge and Kutta's method of order
four integrates the orientation R and k.

The base follows from the centre of mass and what the joints' motion shows of it, seen from the base.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .arrays import Array1D, Array2D, Array3D, Indices1D, Matrix3, Rows3, Vector3
from .body_dynamics import (
    BodyTree,
    add_carried_inertias,
    body_inertia,
    point_position,
    set_body_poses,
)
from .euler_motion import turn_ahead, turn_back
from .kernel import kernel
from .rotations import to_matrix
from .whole_body_motion import FixedPoints, MotionMemory, momentum_terms


class SeenMotion(NamedTuple):
    """The joints' motion at n instants, seen from the base: ``com`` [m], ``com_velocity`` [m/s] and ``momentum``, the
    angular one about it, (n, 3); its ``inertia`` (n, 6), as in ``MotionTerms``, and the ``inverse`` of that (n, 3, 3);
    the contact ``points`` (n, n_contacts, 3), of balls the centres.

    A step has three instants, at its beginning, middle and end: instant 2 s + j of stretch j begins its step s.
    """

    com: Rows3
    com_velocity: Rows3
    momentum: Rows3
    inertia: Array2D
    inverse: Array3D
    points: Array3D


class Stretches(NamedTuple):
    """Stretches of motion under constant forces, each of some steps.

    ``step`` (n_steps,) [s]; ``passed`` (n_steps,), the time from the stretch's beginning to the step's end [s]; ``first``
    (n_stretches + 1,) are the stretches' first steps. ``base`` (n_stretches, 7) and ``twist`` (n_stretches, 6) are their
    starts, place and quaternion, and velocity in the base's axes; ``force`` (n_stretches, n_contacts, 3) [N, world] with
    the ``moment`` (n_stretches, 3) [N m, world] that balls add to it, and the ``fall`` (n_stretches, 3) [m/s^2] of the
    centre of mass.
    """

    step: Array1D
    passed: Array1D
    first: Indices1D
    base: Array2D
    twist: Array2D
    force: Array3D
    moment: Rows3
    fall: Rows3


class PushedTurns(NamedTuple):
    """How the base turns: ``own`` (n, 3), what the joints' motion takes off the turn [rad/s], and ``lever`` (n, 3, 3), the
    sum over the contacts of (r - c) F', with r - c in the base's axes [m] and F in the world [N], at n instants; and
    ``orientation`` (n_steps, 4) and angular ``momentum`` about the centre of mass (n_steps, 3) after every step.
    """

    own: Rows3
    lever: Array3D
    orientation: Array2D
    momentum: Rows3


class TurnMemory(NamedTuple):
    """Scratch: ``turn`` (3, 3); ``body``, ``speed`` and ``start`` (3,); ``now`` and ``there`` (7,), quaternion and
    momentum, and the four ``rates`` (4, 7) of a step."""

    turn: Array2D
    body: Vector3
    speed: Vector3
    start: Vector3
    now: Array1D
    there: Array1D
    rates: Array2D


def turn_memory() -> TurnMemory:
    """Allocate the memory of one step."""
    return TurnMemory(
        np.zeros((3, 3)), np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(7), np.zeros(7), np.zeros((4, 7))
    )  # fmt: skip


@kernel
def see_motion(
    tree: BodyTree, points: FixedPoints, angles: Array2D, speeds: Array2D, memory: MotionMemory, seen: SeenMotion
) -> None:  # fmt: skip
    """Compute all of ``seen`` but ``inverse`` at the joints' angles and speeds, both (n, n_joints)."""
    motion, composite = memory.motion, memory.composite
    for i in range(angles.shape[0]):
        set_body_poses(tree, angles[i], motion)
        for body in range(composite.mass.shape[0]):
            body_inertia(tree, motion, body, composite)
        add_carried_inertias(tree, composite)
        momentum_terms(
            speeds[i], memory, seen.com[i], seen.com_velocity[i], seen.momentum[i], seen.inertia[i]
        )
        for k in range(points.body.shape[0]):
            point_position(motion, points.body[k], points.place[k], seen.points[i, k])


@kernel
def turn_rate(
    inverse: Matrix3, moment: Vector3, own: Vector3, lever: Matrix3, state: Array1D, memory: TurnMemory, out: Array1D
) -> None:  # fmt: skip
    """Compute the derivative (7,) of quaternion and momentum at an instant."""
    turn, body = memory.turn, memory.body
    x, y, z, w = state[0], state[1], state[2], state[3]
    size = 1.0 / np.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = x * size, y * size, z * size, w * size
    out[0], out[1], out[2], out[3] = x, y, z, w
    to_matrix(out[0:4], turn)
    for axis in range(3):
        body[axis] = (turn[0, axis] * state[4] + turn[1, axis] * state[5]) + turn[2, axis] * state[
            6
        ]
    p = ((inverse[0, 0] * body[0] + inverse[0, 1] * body[1]) + inverse[0, 2] * body[2]) - own[0]
    q = ((inverse[1, 0] * body[0] + inverse[1, 1] * body[1]) + inverse[1, 2] * body[2]) - own[1]
    r = ((inverse[2, 0] * body[0] + inverse[2, 1] * body[1]) + inverse[2, 2] * body[2]) - own[2]
    # Of turn times lever the sum over the contacts of R (r - c) x F is the antisymmetric part.
    for axis in range(3):
        after, before = (axis + 1) % 3, (axis + 2) % 3
        change = moment[axis]
        for k in range(3):
            change += turn[after, k] * lever[k, before] - turn[before, k] * lever[k, after]
        out[4 + axis] = change
    out[0] = 0.5 * (w * p + y * r - z * q)
    out[1] = 0.5 * (w * q + z * p - x * r)
    out[2] = 0.5 * (w * r + x * q - y * p)
    out[3] = -0.5 * (x * p + y * q + z * r)


@kernel
def follow_turns(
    seen: SeenMotion, given: Stretches, j: int, memory: TurnMemory, pushed: PushedTurns
) -> None:
    """Orientation and angular momentum after every step of stretch ``j``, from the momentum in ``memory.now``."""
    now, there, rates = memory.now, memory.there, memory.rates
    inverse, moment, own, lever = seen.inverse, given.moment[j], pushed.own, pushed.lever
    now[0:4] = given.base[j, 3:7]
    for s in range(given.first[j], given.first[j + 1]):
        i, step = 2 * s + j, given.step[s]
        turn_rate(inverse[i], moment, own[i], lever[i], now, memory, rates[0])
        for k in range(7):
            there[k] = now[k] + 0.5 * step * rates[0, k]
        turn_rate(inverse[i + 1], moment, own[i + 1], lever[i + 1], there, memory, rates[1])
        for k in range(7):
            there[k] = now[k] + 0.5 * step * rates[1, k]
        turn_rate(inverse[i + 1], moment, own[i + 1], lever[i + 1], there, memory, rates[2])
        for k in range(7):
            there[k] = now[k] + step * rates[2, k]
        turn_rate(inverse[i + 2], moment, own[i + 2], lever[i + 2], there, memory, rates[3])
        for k in range(7):
            now[k] = now[k] + step / 6.0 * (
                (rates[0, k] + 2.0 * (rates[1, k] + rates[2, k])) + rates[3, k]
            )
        size = np.sqrt((now[0] * now[0] + now[1] * now[1]) + (now[2] * now[2] + now[3] * now[3]))
        for k in range(4):
            now[k] = now[k] / size
            pushed.orientation[s, k] = now[k]
        pushed.momentum[s, :] = now[4:7]


@kernel
def set_pushes(seen: SeenMotion, given: Stretches, j: int, pushed: PushedTurns) -> None:
    """Compute ``own`` and ``lever`` at the instants of stretch ``j``."""
    force = given.force[j]
    for i in range(2 * given.first[j] + j, 2 * given.first[j + 1] + j + 1):
        turn_ahead(seen.inverse[i], seen.momentum[i], pushed.own[i])
        for row in range(3):
            for column in range(3):
                total = 0.0
                for k in range(force.shape[0]):
                    total += (seen.points[i, k, row] - seen.com[i, row]) * force[k, column]
                pushed.lever[i, row, column] = total


@kernel
def follow_stretches(
    seen: SeenMotion, given: Stretches, memory: TurnMemory, pushed: PushedTurns, place: Rows3, velocity: Array2D
) -> None:  # fmt: skip
    """Compute the base's place (n_steps, 3) and its velocity in its axes (n_steps, 6) after every step, and
    ``pushed.orientation``."""
    turn, vector, speed, start = memory.turn, memory.body, memory.speed, memory.start
    for j in range(given.base.shape[0]):
        i = 2 * given.first[j] + j
        twist, com, rate, carried, parts = given.twist[j], seen.com[i], seen.com_velocity[i], seen.momentum[i], seen.inertia[i]  # fmt: skip
        to_matrix(given.base[j, 3:7], turn)
        p, q, r = twist[3], twist[4], twist[5]
        vector[0] = ((parts[0] * p + parts[3] * q + parts[4] * r) + 0.0) + carried[0]
        vector[1] = ((parts[3] * p + parts[1] * q + parts[5] * r) + 0.0) + carried[1]
        vector[2] = ((parts[4] * p + parts[5] * q + parts[2] * r) + 0.0) + carried[2]
        turn_ahead(turn, vector, memory.now[4:7])
        vector[0] = (twist[0] + (q * com[2] - r * com[1])) + rate[0]
        vector[1] = (twist[1] + (r * com[0] - p * com[2])) + rate[1]
        vector[2] = (twist[2] + (p * com[1] - q * com[0])) + rate[2]
        turn_ahead(turn, vector, speed)
        turn_ahead(turn, com, start)
        for axis in range(3):
            start[axis] = given.base[j, axis] + start[axis]
        set_pushes(seen, given, j, pushed)
        follow_turns(seen, given, j, memory, pushed)
        # The centre of mass flies a parabola; the base follows from it.
        for s in range(given.first[j], given.first[j + 1]):
            i, time = 2 * (s + 1) + j, given.passed[s]
            com, rate, carried = seen.com[i], seen.com_velocity[i], seen.momentum[i]
            to_matrix(pushed.orientation[s], turn)
            turn_back(turn, pushed.momentum[s], vector)
            for axis in range(3):
                vector[axis] = vector[axis] - carried[axis]
            spin, linear = velocity[s, 3:6], velocity[s, 0:3]
            turn_ahead(seen.inverse[i], vector, spin)
            for axis in range(3):
                vector[axis] = speed[axis] + time * given.fall[j, axis]
            turn_back(turn, vector, linear)
            linear[0] = (linear[0] - (spin[1] * com[2] - spin[2] * com[1])) - rate[0]
            linear[1] = (linear[1] - (spin[2] * com[0] - spin[0] * com[2])) - rate[1]
            linear[2] = (linear[2] - (spin[0] * com[1] - spin[1] * com[0])) - rate[2]
            turn_ahead(turn, com, vector)
            for axis in range(3):
                flown = (start[axis] + time * speed[axis]) + 0.5 * (time * time) * given.fall[
                    j, axis
                ]
                place[s, axis] = flown - vector[axis]
