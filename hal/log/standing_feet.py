"""Stillness of the feet on the ground, if a log's columns are given to the robot's joints in some order.

While a foot is on the ground, it neither turns nor tilts, and two of them neither come nearer nor leave the level. By kinematics, a wrong order of
the columns makes them do so: its ``unrest`` is the mean of robust squares of these motions, each in units of what a real leg has.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ...mathematics.arrays import Array, Flags1D, Flags2D
from ...mathematics.rotations import axis_rotations, cross_products
from ...robots.limb import chain_to
from ...robots.robot_description import RobotDescription

RATE, SPEED, TILT, HEIGHT = 0.1, 0.05, 0.06, 0.02
"""Motion of a standing foot of a real leg, with its encoders' offsets: rad/s, m/s, rad and m."""
THIN = 0.005
"""A sole whose points are less off a line is one [m]."""
OUTLYING = 3.0
"""Times that, above which more counts hardly more."""
MOST_ROWS = 240
MOST_KEPT = 2000
"""Feet by order that are kept for further ones."""


@dataclass(frozen=True)
class LoggedMotion:
    """Rows of a log: what columns have, and what is known besides.

    Attributes:
        position, velocity: of the joints' columns [rad, rad/s], (n, n_columns).
        closed: which foot stands, (n, n_feet).
        rate: of the base, in its axes [rad/s], (n, 3).
        up: in the base's axes, (n, 3).
        speed: of the base's origin, in its axes [m/s], (n, 3).
    """

    position: Array
    velocity: Array
    closed: Flags2D
    rate: Array | None = None
    up: Array | None = None
    speed: Array | None = None


class StandingFeet:
    """The unrest of standing feet, by the columns of the joints that carry them."""

    def __init__(self, robot: RobotDescription, motion: LoggedMotion) -> None:
        self.robot = robot
        self.chains = [chain_to(robot, foot.link) for foot in robot.feet]
        self.joints = sorted({j for chain in self.chains for j in chain})
        """Indices of the joints that carry feet."""
        alone = motion.rate is not None or motion.up is not None
        rows = np.flatnonzero(motion.closed.sum(axis=1) >= (1 if alone else 2))
        self.rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), MOST_ROWS)).astype(int)]
        self.position, self.velocity = motion.position[self.rows], motion.velocity[self.rows]
        self.closed = motion.closed[self.rows]
        self.rate, self.up, self.speed = (
            None if each is None else each[self.rows]
            for each in (motion.rate, motion.up, motion.speed)
        )
        self._normals = [self._normal(foot) for foot in range(len(self.chains))]
        self._turned: dict[tuple[int, int], Array] = {}
        self._feet: dict[tuple[int, tuple[int, ...]], tuple[Array, ...]] = {}

    def _normal(self, foot: int) -> Array:
        """Return a sole's normal in its link's axes, by its points; of a line or a ball as it stands."""
        upright: Array = self._standing(foot)[0].T[:, 2]
        own = np.array(self.robot.foot_of_contact()) == foot
        points = np.array([each.position for each in self.robot.contacts])[own]
        if len(points) < 3:
            return upright
        _, sizes, axes = np.linalg.svd(points - points.mean(axis=0))
        return axes[2] * np.sign(axes[2] @ upright) if sizes[1] > THIN else upright

    def unrest(self, columns: Mapping[int, int]) -> float:
        """Return the unrest with the column of each joint in ``joints``."""
        feet = [
            self._foot(f, tuple(columns[j] for j in chain)) for f, chain in enumerate(self.chains)
        ]
        total = count = 0.0
        for residual, std, closed in self._residuals(feet):
            squares = (residual / std) ** 2
            squares = squares.sum(axis=1) if squares.ndim == 2 else squares
            total += float((squares / (1.0 + squares / OUTLYING**2))[closed].sum())
            count += float(closed.sum())
        return total / max(count, 1.0)

    def _residuals(self, feet: list[tuple[Array, ...]]) -> Iterator[tuple[Array, float, Flags1D]]:
        """Give what should be zero (n,) or (n, 3), what a real leg has of it, and where it should."""
        for f, (place, normal, rate, speed) in enumerate(feet):
            stands = self.closed[:, f]
            if self.rate is not None:
                yield rate + self.rate, RATE, stands
                if self.speed is not None:
                    yield speed + self.speed + cross_products(self.rate, place), SPEED, stands
            if self.up is not None:
                yield normal - self.up, TILT, stands
            for g in range(f):
                other, level, turning, moving = feet[g]
                both = stands & self.closed[:, g]
                base = -0.5 * (rate + turning) if self.rate is None else self.rate
                up = 0.5 * (normal + level) if self.up is None else self.up
                if self.rate is None:
                    yield rate - turning, RATE, both
                if self.up is None:
                    yield normal - level, TILT, both
                apart = place - other
                yield speed - moving + cross_products(base, apart), SPEED, both
                yield np.einsum("ni,ni->n", apart, up), HEIGHT, both

    def _foot(self, foot: int, columns: tuple[int, ...]) -> tuple[Array, ...]:
        """Return a sole's centre, normal, rate and speed in the base's axes, (n, 3) each."""
        found = self._feet.get((foot, columns))
        if found is not None:
            return found
        count = len(self.rows)
        turn = np.tile(np.eye(3), (count, 1, 1))
        place, rate = np.zeros((count, 3)), np.zeros((count, 3))
        moving = np.zeros((count, 3))  # of the frame at ``place``
        for j, column in zip(self.chains[foot], columns, strict=True):
            joint = self.robot.joints[j]
            arm = turn @ np.array(joint.origin)
            place, moving = place + arm, moving + cross_products(rate, arm)
            axis = turn @ np.array(joint.axis)
            speed = self.velocity[:, column, None]
            if joint.kind == "slide":
                arm = axis * self.position[:, column, None]
                place, moving = place + arm, moving + cross_products(rate, arm) + axis * speed
            else:
                rate = rate + axis * speed
                turn = turn @ self._turn(j, column)  # frames of links are parallel at zero
        arm = turn @ np.array(self.robot.feet[foot].sole)
        normal = self._normals[foot]
        if self.up is not None and self.robot.foot_of_contact().count(foot) == 1:
            # of a ball it is not known: as it stands on the mean
            own = np.einsum("nji,nj->ni", turn, self.up)[self.closed[:, foot]]
            normal = own.mean(axis=0) if len(own) else normal
            normal = normal / max(float(np.linalg.norm(normal)), 1e-9)
        found = place + arm, turn @ normal, rate, moving + cross_products(rate, arm)
        if len(self._feet) > MOST_KEPT:
            self._feet.clear()
        self._feet[foot, columns] = found
        return found

    def standing_axes(self, foot: int) -> list[Array]:
        """Return the axes of a foot's joints in the base's, where the robot stands."""
        return self._standing(foot)[1]

    def _standing(self, foot: int) -> tuple[Array, list[Array]]:
        turn, axes = np.eye(3), []
        for j in self.chains[foot]:
            joint = self.robot.joints[j]
            axis = np.array(joint.axis)
            axes.append(turn @ axis)
            if joint.kind != "slide":
                turn = turn @ axis_rotations(joint.axis, self.robot.standing_position[j : j + 1])[0]
        return turn, axes

    def _turn(self, j: int, column: int) -> Array:
        if (j, column) not in self._turned:
            axis = self.robot.joints[j].axis
            self._turned[j, column] = axis_rotations(axis, self.position[:, column])
        return self._turned[j, column]
