"""Forces from outside on a simulated robot: pushes at its named points, and the pull of a cable."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...blocks.signals import ExternalForce
from ...mathematics.arrays import Array1D, Array2D, Counts, Flags1D, Indices0D, Indices1D, Vector3
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from .effect import Effect
from .effects import CableParameters
from .mujoco_model import body_name
from .variation import draw_pull

if TYPE_CHECKING:
    from mujoco import MjData, MjModel


class PushPoints(NamedTuple):
    """The points that a force may act at, in the simulator's memory.

    ``sites`` and ``bodies`` (n_points,) are the numbers of the points and of their bodies, ``places``
    and ``centres`` (n, 3) [m, world] where all points and all bodies' centres of mass are, ``wrenches``
    (n, 6) [N, N m, world] what acts on all bodies. ``missing`` (1,) becomes true where a force acts at
    a point that there is not.
    """

    sites: Indices1D
    bodies: Indices1D
    places: Array2D
    centres: Array2D
    wrenches: Array2D
    missing: Flags1D


@kernel
def clear_wrenches(wrenches: Array2D) -> None:
    """Nothing acts on any body."""
    wrenches[:, :] = 0.0


@kernel
def apply_push(force: Array1D, point: Indices0D, points: PushPoints) -> None:
    """Let the ``force`` (3,) [N, world] act at the ``point``, without a dimension, of its body, which
    moves with the body."""
    fx, fy, fz = force[0], force[1], force[2]
    if fx == 0.0 and fy == 0.0 and fz == 0.0:
        return
    number = point[()]
    if number < 0 or number >= points.sites.shape[0]:
        points.missing[0] = True
        return
    site, body = points.sites[number], points.bodies[number]
    x = points.places[site, 0] - points.centres[body, 0]
    y = points.places[site, 1] - points.centres[body, 1]
    z = points.places[site, 2] - points.centres[body, 2]
    wrench = points.wrenches
    wrench[body, 0], wrench[body, 1], wrench[body, 2] = fx, fy, fz
    wrench[body, 3], wrench[body, 4] = y * fz - z * fy, z * fx - x * fz
    wrench[body, 5] = x * fy - y * fx


@kernel
def add_force(force: Vector3, total: Vector3) -> None:
    """Add a ``force`` [N, world] to what acts on the centre of mass of a body."""
    total[:] += force


class ExternalForces:
    """Lets forces act on the robot's named points."""

    def __init__(self, model: MjModel, data: MjData, robot: RobotDescription) -> None:
        self._robot = robot
        sites = [int(model.site(f"point/{name}").id) for name in robot.points]
        bodies = [int(model.body(body_name(link)).id) for link, _ in robot.points.values()]
        self._points = PushPoints(
            np.array(sites, np.int64), np.array(bodies, np.int64), data.site_xpos, data.xipos,
            data.xfrc_applied, np.zeros(1, np.bool_),
        )  # fmt: skip

    def release_call(self) -> KernelCall:
        """Return the call that clears all external forces."""
        return KernelCall(clear_wrenches, self._points.wrenches)

    def push_call(self, push: ExternalForce) -> KernelCall:
        """Return the call by which the push acts in the next physics step; ``check`` says whether it has a point."""
        return KernelCall(apply_push, push.force, push.point, self._points)

    def check(self, push: ExternalForce) -> None:
        """Raise ``IndexError`` if the push has acted at a point that the robot does not have."""
        if self._points.missing[0]:
            self._points.missing[0] = False
            raise IndexError(
                f"push at point {int(push.point)}; {self._robot.name} has "
                f"{len(self._points.sites)}: " + ", ".join(self._robot.points)
            )


class Cable(Effect):
    """A cable that pulls at the base of a robot that stands: a constant force, drawn by the seed.

    Args:
        params: of the cable.
        seed: draws its direction.
        robot: the description.
        model, data: the simulator's.
    """

    def __init__(
        self, params: CableParameters, seed: int, robot: RobotDescription, model: MjModel, data: MjData,
    ) -> None:  # fmt: skip
        base = int(model.body(body_name(robot.base)).id)
        self._pull = KernelCall(
            add_force, np.array(draw_pull(params, seed, robot)), data.xfrc_applied[base, :3]
        )

    def force_calls(self, step: Counts, *, stands: bool) -> list[Call]:
        """Let the cable pull once the robot stands."""
        return [self._pull] if stands else []
