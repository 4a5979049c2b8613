"""A force from outside on a simulated robot, at one of its named points."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...blocks.signals import ExternalForce
from ...mathematics.arrays import Array, Flags, Indices
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from .mujoco_model import body_name

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


class Points(NamedTuple):
    """The points that a force may act at, in the simulator's memory.

    ``sites`` and ``bodies`` (n_points,) are the numbers of the points and of their bodies, ``places``
    and ``centres`` (n, 3) [m, world] where all points and all bodies' centres of mass are, ``wrenches``
    (n, 6) [N, N m, world] what acts on all bodies. ``missing`` (1,) becomes true where a force acts at
    a point that there is not.
    """

    sites: Indices
    bodies: Indices
    places: Array
    centres: Array
    wrenches: Array
    missing: Flags


@kernel
def release(wrenches: Array) -> None:
    """Nothing acts on any body."""
    for body in range(wrenches.shape[0]):
        for axis in range(6):
            wrenches[body, axis] = 0.0


@kernel
def push_point(force: Array, point: Indices, points: Points) -> None:
    """Let the ``force`` (3,) [N, world] act at the ``point``, without a dimension, of its body, which
    moves with the body."""
    fx, fy, fz = float(force[0]), float(force[1]), float(force[2])
    if fx == 0.0 and fy == 0.0 and fz == 0.0:
        return
    number = int(point[()])
    if number < 0 or number >= points.sites.shape[0]:
        points.missing[0] = True
        return
    site, body = int(points.sites[number]), int(points.bodies[number])
    x = float(points.places[site, 0]) - float(points.centres[body, 0])
    y = float(points.places[site, 1]) - float(points.centres[body, 1])
    z = float(points.places[site, 2]) - float(points.centres[body, 2])
    wrench = points.wrenches
    wrench[body, 0], wrench[body, 1], wrench[body, 2] = fx, fy, fz
    wrench[body, 3], wrench[body, 4] = y * fz - z * fy, z * fx - x * fz
    wrench[body, 5] = x * fy - y * fx


class ExternalForces:
    """Lets forces act on the robot's named points."""

    def __init__(self, model: MjModel, data: MjData, robot: RobotDescription) -> None:
        self._robot = robot
        sites = [int(model.site(f"point/{name}").id) for name in robot.points]
        bodies = [int(model.body(body_name(link)).id) for link, _ in robot.points.values()]
        self._points = Points(
            np.array(sites, np.int64), np.array(bodies, np.int64), data.site_xpos, data.xipos,
            data.xfrc_applied, np.zeros(1, np.bool_),
        )  # fmt: skip

    def releasing(self) -> KernelCall:
        """Nothing acts any more."""
        return KernelCall(release, self._points.wrenches)

    def pushing(self, push: ExternalForce) -> KernelCall:
        """The push acts in the next physics step; ``check`` says whether it has a point."""
        return KernelCall(push_point, push.force, push.point, self._points)

    def check(self, push: ExternalForce) -> None:
        """Raise ``IndexError`` if the push has acted at a point that the robot does not have."""
        if self._points.missing[0]:
            self._points.missing[0] = False
            raise IndexError(
                f"push at point {int(push.point)}; {self._robot.name} has "
                f"{len(self._points.sites)}: " + ", ".join(self._robot.points)
            )
