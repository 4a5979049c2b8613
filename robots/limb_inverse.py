"""The inverse kinematics of a limb of any number of joints, by damped least squares within limits.

A foot's target is a place and an orientation. How much of the orientation counts follows from the
foot's kind: nothing for a point foot, the direction of its line for a line foot, all of it for a
flat one. With the error e(q) between target and foot, weighted, and J its negative derivative, the
joint angles solve

    min |e(q)|^2   within the limits,

by the Levenberg-Marquardt method: from the present angles, with L = mu |e|^2,

    dq = (J'J + L I)^-1 J'e,

the step is cut off at the limits and taken if it reduces the error. mu changes with the ratio of
the actual to the predicted reduction (Nielsen's rule), and grows if there was no reduction. A joint
that stands at its limit and would have to go beyond it is left out. As the damping is proportional
to the squared error, the last steps are those of Newton's method and converge quadratically.

Vectors are in the base's frame, in m and rad. The kernels allocate nothing, take a bounded number
of steps and return finite numbers for all finite arguments. They share one scratch array
``work``, see ``limb_scratch``.
"""

from __future__ import annotations

import math

import numpy as np

from ..mathematics.arrays import (
    Array,
    Array1D,
    Array2D,
)
from ..mathematics.kernel import kernel
from ..mathematics.linear_algebra import solve_positive
from .limb import (
    foot_error,
    limb_jacobian,
    set_limb_pose,
    weigh_rows,
)

FOUND = 1e-22
"""A squared error [m^2] below which no further step is taken."""
REACHED = 1e-18
"""A squared error [m^2] below which the target counts as reached: a nanometre."""
_FLOOR = 1e-13
"""The least damping [m^2]; it keeps the steps finite where a limb is singular."""
_STILL = 1e-18
"""Squared gradient over squared error [m^2] below which the error is at its minimum."""


def limb_scratch(joints: int) -> Array:
    """Return the scratch array that the kernels of this file need for a limb with that many joints."""
    return np.zeros((2 * joints + 16, max(joints, 6)))


@kernel
def approach(
    links: Array2D,
    tip: Array1D,
    limits: Array2D,
    target: Array2D,
    weights: Array1D,
    steps: int,
    work: Array2D,
    angles: Array1D,
) -> float:
    """Bring the foot as near to its target as possible, starting from the present joint angles.

    Args:
        links, tip, limits: of the ``Limb``.
        target: from ``aim``, (4, 3).
        weights: see ``foot_error``.
        steps: how many steps are tried at most.
        work: scratch, see ``limb_scratch``.
        angles: in, where to start, brought within the limits; out, the answer, (n,).

    Returns:
        The squared error that is left [m^2].
    """
    n = links.shape[0]
    anchors, pose = work[:n, :6], work[n : n + 4, :3]
    rows, normal = work[n + 4 : n + 10, :n], work[n + 10 : 2 * n + 10, :n]
    error, gradient = work[2 * n + 10, :6], work[2 * n + 11, :n]
    step, trial = work[2 * n + 12, :n], work[2 * n + 13, :n]
    points = 3 if tip[6] == 0.0 else 6
    for j in range(n):
        angles[j] = min(max(angles[j], limits[j, 0]), limits[j, 1])
    set_limb_pose(links, tip, angles, anchors, pose)
    square = foot_error(tip, pose, target, weights, error)
    ease, fresh = 0.1, True
    for _ in range(steps):
        if square <= FOUND:
            break
        if fresh:
            limb_jacobian(links, anchors, pose, rows)
            weigh_rows(tip, pose, target, weights, rows)
            slope = 0.0
            for j in range(n):
                value = 0.0
                for i in range(points):
                    value += rows[i, j] * error[i]
                if _stuck(limits, j, angles[j], value):
                    # Without its column the joint stays where it is.
                    value = 0.0
                    for i in range(points):
                        rows[i, j] = 0.0
                gradient[j] = value
                slope += value * value
            if slope <= _STILL * square:
                break
        damping = ease * square + _FLOOR
        for j in range(n):
            step[j] = gradient[j]
            for k in range(j + 1):
                value = 0.0
                for i in range(points):
                    value += rows[i, j] * rows[i, k]
                normal[j, k] = value
            normal[j, j] += damping
        solve_positive(normal, step)
        promised = 0.0
        for j in range(n):
            angle = angles[j] + min(max(step[j], -1.0), 1.0)
            trial[j] = min(max(angle, limits[j, 0]), limits[j, 1])
            moved = trial[j] - angles[j]
            promised += moved * (damping * moved + gradient[j])
        set_limb_pose(links, tip, trial, anchors, pose)
        found = foot_error(tip, pose, target, weights, error)
        fresh = found < square
        if fresh:
            # Nielsen's rule, by the ratio of the actual to the predicted reduction.
            ratio = 2.0 * min((square - found) / max(promised, 1e-300), 1.0) - 1.0
            ease, square = ease * max(0.1, 1.0 - ratio * ratio * ratio), found
            for j in range(n):
                angles[j] = trial[j]
        else:
            ease = 4.0 * max(ease, 1e-3)
    return square


@kernel
def reach(
    links: Array2D,
    tip: Array1D,
    limits: Array2D,
    target: Array2D,
    weights: Array1D,
    starts: Array2D,
    tries: int,
    steps: int,
    work: Array2D,
    angles: Array1D,
) -> float:
    """Reach a target from the first of several starts that leads there.

    The first start is tried first, then the others in the order of how near they are to the
    target. Where none leads there, the answer is the nearest that was found; a later one has to be
    nearer by a tenth, so that the answer does not jump to and fro between two that are equally
    good.

    Args:
        starts: joint angles to start from, one start a row; the last column is scratch, (k, n + 1).
        tries: how many of the starts are tried at most.
        steps: how many steps are tried from each of them at most.
        angles: out, the answer, (n,). The other arguments are as for ``approach``.

    Returns:
        The squared error that is left [m^2].
    """
    n = links.shape[0]
    anchors, pose, error = work[:n, :6], work[n : n + 4, :3], work[2 * n + 10, :6]
    attempt = work[2 * n + 14, :n]
    least, start = math.inf, 0
    for number in range(min(tries, starts.shape[0])):
        if number == 1:
            for k in range(1, starts.shape[0]):
                set_limb_pose(links, tip, starts[k], anchors, pose)
                starts[k, n] = foot_error(tip, pose, target, weights, error)
        if number > 0:
            start = 0
            for k in range(1, starts.shape[0]):
                fresh = starts[k, n] >= 0.0
                if fresh and (start == 0 or starts[k, n] < starts[start, n]):
                    start = k
            starts[start, n] = -1.0
        for j in range(n):
            attempt[j] = starts[start, j]
        square = approach(links, tip, limits, target, weights, steps, work, attempt)
        if square < 0.81 * least:
            least = square
            for j in range(n):
                angles[j] = attempt[j]
        if least <= REACHED:
            break
    return least


@kernel
def limb_velocity(
    links: Array2D,
    tip: Array1D,
    limits: Array2D,
    target: Array2D,
    weights: Array1D,
    angles: Array1D,
    twist: Array1D,
    damping: float,
    work: Array2D,
    speeds: Array1D,
) -> None:
    """Compute the joint velocities that move the foot as its target moves, by damped least squares.

    With J as for ``approach``, speeds = (J'J + damping^2)^-1 J'(twist, weighted). A joint at its
    limit that would have to go beyond it stands still, and the others do what they can.

    Args:
        twist: the target's linear velocity [m/s] and its angular velocity [rad/s], (6,).
        damping: in m.
        speeds: out, (n,). The other arguments are as for ``approach``.
    """
    n = links.shape[0]
    anchors, pose = work[:n, :6], work[n : n + 4, :3]
    rows, normal = work[n + 4 : n + 10, :n], work[n + 10 : 2 * n + 10, :n]
    task = work[2 * n + 10, :6]
    set_limb_pose(links, tip, angles, anchors, pose)
    limb_jacobian(links, anchors, pose, rows)
    # The twist is weighted as the rows are: as if it were one more column of the Jacobian.
    column = work[2 * n + 10 : 2 * n + 16, 0:1]
    for i in range(6):
        column[i, 0] = twist[i]
    weigh_rows(tip, pose, target, weights, column)
    tx, ty, tz = column[3, 0], column[4, 0], column[5, 0]
    x, y, z = column[0, 0], column[1, 0], column[2, 0]
    task[0], task[1], task[2], task[3], task[4], task[5] = x, y, z, tx, ty, tz
    weigh_rows(tip, pose, target, weights, rows)
    points = 3 if tip[6] == 0.0 else 6
    for _ in range(n + 1):
        for j in range(n):
            value = 0.0
            for i in range(points):
                value += rows[i, j] * task[i]
            speeds[j] = value
            for k in range(j + 1):
                value = 0.0
                for i in range(points):
                    value += rows[i, j] * rows[i, k]
                normal[j, k] = value
            normal[j, j] += damping * damping
        solve_positive(normal, speeds)
        again = False
        for j in range(n):
            speed = speeds[j]
            if speed != 0.0 and _stuck(limits, j, angles[j], speed):
                again = True
                for i in range(points):
                    rows[i, j] = 0.0
        if not again:
            break


@kernel
def _stuck(limits: Array2D, joint: int, angle: float, direction: float) -> bool:
    """Check whether a joint stands at a limit and ``direction`` points beyond it."""
    lower, upper = limits[joint, 0], limits[joint, 1]
    return (angle <= lower and direction <= 0.0) or (angle >= upper and direction >= 0.0)
