"""Kernels that a test calls so often that as plain Python they would be most of its time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from aloft.mathematics.arrays import Array, Array1D, Array2D
from aloft.mathematics.compiling.compile_calls import compile_calls
from aloft.mathematics.compiling.kernel_call import KernelCall
from aloft.mathematics.ground_surface import Surface, height_of_ground
from aloft.mathematics.kernel import kernel
from aloft.robots.contact_kinematics import ContactKinematics, contact_motion
from aloft.robots.terrain import Terrain


def run_compiled(kernel: Callable[..., None], *arguments: Any) -> None:
    """Call a kernel as machine code, whose results have the bits of plain Python."""
    call = KernelCall(kernel, *arguments)
    compile_calls([call])
    call.run()


class Sight:
    """The contact points of a robot whose base and joints do not move, as ``evaluate`` sees them."""

    def __init__(self, seen: ContactKinematics, joints: int) -> None:
        self._orientation, self._joints = np.zeros(4), np.zeros(joints)
        self._call = KernelCall(
            contact_motion, seen.bodies, seen.contacts, self._orientation, np.zeros(3),
            self._joints, np.zeros(joints), seen.motion,
        )  # fmt: skip

    def see(self, orientation: Array, joints: Array) -> None:
        """Evaluate ``seen`` at an orientation of the base and positions of the joints."""
        if self._call.compiled is None:
            compile_calls([self._call])
        self._orientation[:], self._joints[:] = orientation, joints
        self._call.run()


@kernel
def look_at_ground(surface: Surface, places: Array2D, heights: Array1D, normals: Array2D) -> None:
    """Compute height and normal of the ground at some places."""
    for k in range(places.shape[0]):
        heights[k] = height_of_ground(surface, places[k, 0], places[k, 1], normals[k])


def heights_and_normals(ground: Terrain, places: Array) -> tuple[Array, Array]:
    """The height (n,) [m] and the normal (n, 3) of the ground at places (n, 2) [m]."""
    heights, normals = np.zeros(len(places)), np.zeros((len(places), 3))
    run_compiled(look_at_ground, ground.surface, np.array(places), heights, normals)
    return heights, normals
