"""Where the robot touches the ground: forces as arrows, friction cones, the support polygon."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from .robot_shapes import reach_of
from .scene_part import Moments, ScenePart

GRAVITY = 9.81
WEIGHT_ARROW = 0.6
"""The length of the arrow of a robot's weight, as a share of the robot's reach. A robot that stands
on four points has arrows a quarter as long, which are still easy to see."""
LONGEST_ARROW = 1.0
"""No arrow is longer than this share of the robot's reach, or else it would leave the view."""
ARROW_RADIUS = 0.004
"""The radius of an arrow's shaft [m] for a robot of the usual reach."""
CONE_HEIGHT = 0.05
"""Height [m] at which a friction cone is cut, for a robot of the usual reach."""
CONE_SIDES = 16
ABOVE_GROUND = 0.001
"""Lines on the ground are drawn this far above it [m], so that the grid does not hide them."""


def force_scale(robot: RobotDescription) -> float:
    """The length of a force arrow for each newton [m/N]: small robots have small forces."""
    return WEIGHT_ARROW * reach_of(robot) / (GRAVITY * robot.total_mass)


def force_arrows(robot: RobotDescription, force: Array) -> Array:
    """The arrows [m] of forces [N], both (..., 3), none longer than the robot's reach allows."""
    arrows = force * force_scale(robot)
    lengths = np.linalg.norm(arrows, axis=-1, keepdims=True)
    longest = LONGEST_ARROW * reach_of(robot)
    shorter: Array = arrows * np.minimum(1.0, longest / np.maximum(lengths, 1e-12))
    return shorter


class ContactPart(ScenePart):
    """``contact_forces``, ``friction_cones`` and ``support_polygon``.

    A cone stands on each point that carries load; its half angle is the arc tangent of the
    friction coefficient that the controller counts with. It is not drawn where no block has one.
    """

    def write_static(self) -> None:
        """Write the colours."""
        import rerun as rr

        if self.ports.contact_force is None:
            return
        width = ARROW_RADIUS * self.scale
        arrows = rr.Arrows3D.from_fields(colors=[self.colors.force], radii=[width])
        self.log("contact_forces", arrows)
        thin, thick = 0.0006 * self.scale, 0.002 * self.scale
        cones = rr.LineStrips3D.from_fields(colors=[self.colors.cone], radii=[thin])
        self.log("friction_cones", cones)
        polygon = rr.LineStrips3D.from_fields(colors=[self.colors.support], radii=[thick])
        self.log("support_polygon", polygon)

    def write(self, moments: Moments) -> None:
        """Write the forces, the cones and the polygon."""
        import rerun as rr

        if self.ports.contact_position is None or self.ports.contact_force is None:
            return
        position = moments[self.ports.contact_position]
        force = moments[self.ports.contact_force]
        arrows = rr.Arrows3D.columns(
            origins=position.reshape(-1, 3),
            vectors=force_arrows(self.robot, force).reshape(-1, 3),
        )
        counts = np.full(len(position), position.shape[1])
        self.send("contact_forces", moments, arrows.partition(counts))
        loaded = (force != 0.0).any(axis=2)
        if self.ports.friction and self.detail.extras:
            self._write_cones(moments, position, loaded, self.ports.friction)
        self._write_polygon(moments, position, loaded)

    def _write_cones(
        self, moments: Moments, position: Array, loaded: NDArray[np.bool_], friction: float
    ) -> None:
        cone = cone_lines(friction, CONE_HEIGHT * self.scale)
        self._write_lines(
            "friction_cones", moments, position[loaded][:, None] + cone, loaded.sum(1)
        )

    def _write_polygon(self, moments: Moments, position: Array, loaded: NDArray[np.bool_]) -> None:
        polygons = [
            convex_hull(points[carry]) + np.array([0.0, 0.0, ABOVE_GROUND])
            for points, carry in zip(position, loaded, strict=True)
        ]
        counts = np.array([len(polygon) > 0 for polygon in polygons], np.int64)
        self._write_lines(
            "support_polygon", moments, [polygon for polygon in polygons if len(polygon)], counts
        )

    def _write_lines(
        self, name: str, moments: Moments, lines: Sequence[Array] | Array, counts: NDArray[np.int64]
    ) -> None:
        import rerun as rr

        columns = rr.LineStrips3D.columns(strips=[np.asarray(line) for line in lines])
        self.send(name, moments, columns.partition(counts))


def cone_lines(friction: float, height: float) -> Array:
    """One line (n, 3) that draws a friction cone on its tip: a ring with four sides to the tip."""
    angles = np.linspace(0.0, 2.0 * np.pi, CONE_SIDES + 1)
    ring = np.column_stack([np.cos(angles), np.sin(angles), np.full(len(angles), 1.0 / friction)])
    ring *= friction * height
    tip, quarter = np.zeros((1, 3)), CONE_SIDES // 4
    sides = [np.vstack([tip, ring[k * quarter : k * quarter + 1], tip]) for k in range(1, 4)]
    return np.vstack([*sides, tip, ring])


def convex_hull(points: Array) -> Array:
    """The closed convex hull (m, 3), seen from above, of points (n, 3), each at its own height.

    Empty where there are fewer than two points; a line there and back where all lie on one.
    """
    ordered = sorted({tuple(point) for point in points.tolist()})
    if len(ordered) < 2:
        return np.zeros((0, 3))
    chains = []
    for direction in (ordered, ordered[::-1]):
        chain: list[tuple[float, ...]] = []
        for point in direction:
            while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0.0:
                chain.pop()
            chain.append(point)
        chains.append(chain)
    return np.array([*chains[0], *chains[1][1:]])


def _turn(a: Sequence[float], b: Sequence[float], c: Sequence[float]) -> float:
    """A number that is positive if the path a, b, c turns to the left."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
