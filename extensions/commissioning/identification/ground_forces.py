"""Forces of the ground in a floating base's equations of motion, and what they leave of these.

A loaded foot adds its wrench, J' w: J is its Jacobian at the sole's centre, w is about there, in its link's axes. A measured
wrench goes to the known side. Of one that was not measured, or only along the normal, the directions that its loaded points
can have are projected out, so what is left does not depend on them. In flight everything is left. So logs with force sensors
in the feet, logs of flight and logs with contact switches only are one kind.

Without torques only the first six equations, the base's, hold. A flat foot whose wrench is not measured leaves none of them, a foot on a
line one, and one on a point three.
"""

from __future__ import annotations

import numpy as np

from ....mathematics.arrays import Array, Flags1D, Flags2D
from ....robots.robot_description import RobotDescription
from .band import cutoff_of, step_of
from .base_parameters import LinkRegressor
from .motion_log import MotionLog
from .sensor_identification import cross_matrices, smooth

NEGLIGIBLE = 1e-6
"""Directions of the ground's forces this much weaker than the strongest are none."""


def equations_left(
    log: MotionLog, band: float, links: LinkRegressor, position: Array, count: int
) -> tuple[Array, Array]:
    """Return what projects the first ``count`` equations (n, count, count), and the measured forces' part of them (n, count).

    Args:
        log: with ``closed`` if the robot has contacts.
        band: of the fit [Hz].
        links: the equations.
        position: of the joints where equations are formed (n, n_joints).
        count: of equations: six, or as many as velocities.
    """
    robot, instants, step = links.robot, len(position), step_of(log, band)
    through = np.tile(np.eye(count), (instants, 1, 1))
    known = np.zeros((instants, count))
    if not robot.contacts or log.closed is None:
        return through, known
    # Smoothed motion has a share of an impact's acceleration before and after it.
    near = round(1.0 / (cutoff_of(log, band) * log.period))
    loaded = _widened(log.closed, near)[::step]
    wrenches = None
    if log.wrenches is not None:
        shape = log.wrenches.shape
        flat = log.wrenches.reshape(len(log.wrenches), -1)
        seen = np.isfinite(flat).all(axis=0)
        smoothed = np.full_like(flat, np.nan)
        if seen.any():
            smoothed[:, seen] = smooth(flat[:, seen], log.period, cutoff_of(log, band))
        wrenches = smoothed.reshape(shape)[::step]
    spans = _FootSpans(robot)
    for k in range(instants):
        jacobians, free = links.jacobians(position[k]), []
        for foot, jacobian in enumerate(jacobians):
            measured = np.full(6, np.nan) if wrenches is None else wrenches[k, foot]
            span, wrench = spans.of(foot, loaded[k], measured)
            known[k] += jacobian.T[:count] @ wrench
            free.append(jacobian.T[:count] @ span)
        directions = np.hstack(free)
        if directions.size:
            left, sizes, _ = np.linalg.svd(directions, full_matrices=False)
            used = left[:, sizes > NEGLIGIBLE * sizes[0]]
            through[k] -= used @ used.T
    return through, (through @ known[:, :, None])[:, :, 0]


class _FootSpans:
    """The wrenches that a foot's loaded points can have."""

    def __init__(self, robot: RobotDescription) -> None:
        self.of_foot = [
            [
                (index, np.array(contact.position) - np.array(foot.sole))
                for index, contact in enumerate(robot.contacts)
                if contact.foot == foot.name
            ]
            for foot in robot.feet
        ]

    def of(self, foot: int, loaded: Flags1D, measured: Array) -> tuple[Array, Array]:
        """Return the directions (6, m) of what is not measured of a foot's wrench, and what is known of it (6,)."""
        if np.isfinite(measured).all():
            return np.zeros((6, 0)), measured
        places = [place for index, place in self.of_foot[foot] if loaded[index]]
        if not places:
            return np.zeros((6, 0)), np.zeros(6)
        span = np.hstack([np.vstack([np.eye(3), cross_matrices(place)]) for place in places])
        if not np.isfinite(measured[2]):
            return span, np.zeros(6)
        x, y, _ = np.mean(places, axis=0)
        wrench = measured[2] * np.array([0.0, 0.0, 1.0, y, -x, 0.0])
        # forces of the points whose sum has no normal part
        rest = np.linalg.svd(span[2:3])[2][1:].T
        return span @ rest, wrench


def _widened(closed: Flags2D, near: int) -> Flags2D:
    """Return which points are loaded within so many samples."""
    whole = np.vstack([np.zeros((1, closed.shape[1])), np.cumsum(closed, axis=0)])
    at = np.arange(len(closed))
    late = np.minimum(at + near + 1, len(closed))
    found: Flags2D = whole[late] - whole[np.maximum(at - near, 0)] > 0
    return found
