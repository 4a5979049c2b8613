"""Feet that are balls: those with one contact point, which roll on the ground.

The contact point of such a foot, and its sole, are the ball's lowest point in the world, whatever
the foot's orientation: the point one radius straight below the centre. The description gives the
positions of these points at the zero pose. Contact points of other feet are fixed to the foot.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..mathematics.arrays import Array
from .link_poses import contact_centres

if TYPE_CHECKING:
    from .robot_description import RobotDescription


@dataclass(frozen=True, eq=False)
class BallFoot:
    """A foot with one contact point: the indices of ``foot`` and ``point``, the ``radius`` [m] of
    the ball, and its ``centre`` in the frame of the foot's link [m], (3,)."""

    foot: int
    point: int
    radius: float
    centre: Array


def ball_feet(robot: RobotDescription) -> tuple[BallFoot, ...]:
    """The robot's feet with exactly one contact point, in the order of its contact points."""
    centres = contact_centres(robot)
    owners = robot.foot_of_contact()
    return tuple(
        BallFoot(foot, point, contact.radius, centres[point])
        for point, (foot, contact) in enumerate(zip(owners, robot.contacts, strict=True))
        if owners.count(foot) == 1
    )
