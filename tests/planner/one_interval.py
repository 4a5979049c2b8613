"""A plan's motion over one interval, as plain NumPy has it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from aloft.mathematics.arrays import Array
from aloft.planner.models.exact_dynamics import ExactDynamics, Motion, Segments


class JointMotion(NamedTuple):
    """The joints between two knots: the cubics through both ends' angles and velocities. Between many
    pairs of knots at once all of it has a row for each, the durations (n, 1).
    """

    start: Array
    end: Array
    start_velocity: Array
    end_velocity: Array
    duration: float | Array

    def at(self, time: float | Array) -> Motion:
        """Return the angles, velocities and accelerations [rad] at ``time`` since the first knot [s]; at n times (n, 1)
        each is (n, n_joints).
        """
        t, u = self.duration, time / self.duration
        way = self.end - self.start
        bend = 3.0 * way - t * (2.0 * self.start_velocity + self.end_velocity)
        twist = t * (self.start_velocity + self.end_velocity) - 2.0 * way
        position = self.start + u * (t * self.start_velocity + u * (bend + u * twist))
        velocity = self.start_velocity + u / t * (2.0 * bend + 3.0 * u * twist)
        return position, velocity, (2.0 * bend + 6.0 * u * twist) / (t * t)


def joint_motion(position: Array, velocity: Array, time: Array, knot: int) -> JointMotion:
    """The joints of a plan between that knot and the next."""
    return JointMotion(
        position[knot, 7:], position[knot + 1, 7:], velocity[knot, 6:], velocity[knot + 1, 6:],
        float(time[knot + 1] - time[knot]),
    )  # fmt: skip


def integrate(
    dynamics: ExactDynamics,
    q: Array,
    v: Array,
    joints: JointMotion,
    force: Array,
    longest_step: float,
) -> list[tuple[float, Array, Array]]:
    """Return the motion over one interval from the state (q, v) under constant contact forces (n_contacts, 3).

    Returns time since the interval began [s], q and v after every step; ``q`` is followed as
    position and quaternion, and the joints' part of both is the planned one.
    """
    duration = float(joints.duration)
    count = max(1, int(np.ceil(duration / longest_step - 1e-9)))
    h = duration / count
    angles, speeds, _ = joints.at(np.asarray(0.5 * h * np.arange(2 * count + 1)[:, None]))
    segment = Segments(
        q[None, :7],
        v[None, :6],
        angles,
        speeds,
        force[None],
        np.full(count, h),
        np.array([count]),
    )
    places, rates = dynamics.follow(segment)
    return [(h * (i + 1), places[i], rates[i]) for i in range(count)]
