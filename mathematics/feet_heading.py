"""The heading of all feet together, for feet that have a direction and for points."""

from __future__ import annotations

from .arrays import Array1D, Array2D, Array3D, Flags1D
from .elementary import atan2
from .kernel import kernel


@kernel
def heading_of_feet(
    position: Array2D, rotation: Array3D, middle: Array1D, directions: Array2D, points: Flags1D
) -> float:
    """The angle [rad] about the vertical by which the feet are turned from where they point as the robot stands.

    It is the angle for which the turned ``directions`` are nearest to the directions now, in the sense of least
    squares (the Procrustes problem in the plane).

    Args:
        position: of the feet [m], (n, 3).
        rotation: of the feet, (n, 3, 3); a foot points along its x axis.
        middle: of the feet [m], (3,).
        directions: of the feet as the robot stands, (n, 2).
        points: whether a foot has no direction, so that its place from the middle stands for it, (n,).
    """
    x = y = 0.0
    for foot in range(position.shape[0]):
        ahead, aside = rotation[foot, 0, 0], rotation[foot, 1, 0]
        if points[foot]:
            ahead = position[foot, 0] - middle[0]
            aside = position[foot, 1] - middle[1]
        u, v = directions[foot, 0], directions[foot, 1]
        x += u * ahead + v * aside
        y += u * aside - v * ahead
    return atan2(y, x)
