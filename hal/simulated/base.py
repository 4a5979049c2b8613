"""The kinds of bases that a simulated robot can have, with their coordinates in the simulator."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from ...blocks.signals import RobotTruth
from ...mathematics.arrays import Array, Array1D
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.elementary import sincos
from ...mathematics.kernel import kernel
from ...runtime.language.steps import signal_call

if TYPE_CHECKING:
    from mujoco import MjData


@kernel
def report_fixed(truth: RobotTruth) -> None:
    """Report the pose and velocity of a base at the world's origin."""
    truth.base_position[:] = 0.0
    truth.base_orientation[:] = 0.0
    truth.base_orientation[3] = 1.0
    truth.base_linear_velocity[:] = 0.0
    truth.base_angular_velocity[:] = 0.0


@kernel
def report_planar(position: Array1D, velocity: Array1D, truth: RobotTruth) -> None:
    """Report the pose and velocity of a base whose coordinates in the simulator are x, z and the pitch."""
    half = 0.5 * position[2]
    report_fixed(truth)
    truth.base_position[0], truth.base_position[2] = position[0], position[1]
    truth.base_orientation[1], truth.base_orientation[3] = sincos(half)
    truth.base_linear_velocity[0], truth.base_linear_velocity[2] = velocity[0], velocity[1]
    truth.base_angular_velocity[1] = velocity[2]


@kernel
def report_floating(position: Array1D, velocity: Array1D, truth: RobotTruth) -> None:
    """Report the pose and velocity of a base whose coordinates are position and quaternion w, x, y, z."""
    for axis in range(3):
        truth.base_position[axis] = position[axis]
        truth.base_orientation[axis] = position[4 + axis]
        truth.base_linear_velocity[axis] = velocity[axis]
        truth.base_angular_velocity[axis] = velocity[3 + axis]
    truth.base_orientation[3] = position[3]


@kernel
def read_pitch_rate(velocity: Array1D, rate: Array1D) -> None:
    """Read the angular velocity (3,) [rad/s, body] of a planar base, from the simulator's velocities."""
    rate[1] = velocity[2]


class FixedBase:
    """A base that is bolted to the world at its origin: it has no coordinates.

    ``positions`` and ``velocities`` count the elements of the simulator's ``qpos`` and ``qvel``
    the base takes; those of the joints follow.
    """

    positions: ClassVar[int] = 0
    velocities: ClassVar[int] = 0

    def __init__(self, data: MjData) -> None:
        self._data = data
        self.angular_velocity = np.zeros(3)
        """The base's angular velocity [rad/s, body] at the last ``refresh``."""

    @staticmethod
    def add_joints(body: Any) -> None:
        """Add the base's joints to its body in a model that is being built."""

    def place(self) -> None:
        """Put the base upright at the world's origin."""

    def turn(self, rotation: Array) -> None:
        """Turn the upright base by a rotation vector [rad, world], as far as it can turn."""

    def shift(self, offset: Array) -> None:
        """Move the base by ``offset`` [m, world], as far as it can move."""

    def refresh(self) -> None:
        """Bring ``angular_velocity`` up to date."""

    def refresh_calls(self) -> list[KernelCall]:
        """Return the calls of ``refresh``."""
        return []

    def publish_call(self, truth: RobotTruth) -> KernelCall:
        """Return the call that writes the base's pose and velocity."""
        return signal_call(report_fixed, truth)


class PlanarBase(FixedBase):
    """A base that slides along the world's x and z axes and turns about y, in this order."""

    positions = 3
    velocities = 3

    @staticmethod
    def add_joints(body: Any) -> None:
        """Add two slides and a hinge."""
        import mujoco

        slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
        body.add_joint(name="base/x", type=slide, axis=[1, 0, 0])
        body.add_joint(name="base/z", type=slide, axis=[0, 0, 1])
        body.add_joint(name="base/pitch", type=hinge, axis=[0, 1, 0])

    def place(self) -> None:
        """Put the base upright at the world's origin."""
        self._data.qpos[:3] = 0.0

    def turn(self, rotation: Array) -> None:
        """Pitch the base by the y component of ``rotation`` [rad]."""
        self._data.qpos[2] = rotation[1]

    def shift(self, offset: Array) -> None:
        """Move the base by the x and z components of ``offset`` [m, world]."""
        self._data.qpos[0] += offset[0]
        self._data.qpos[1] += offset[2]

    def refresh(self) -> None:
        """Bring ``angular_velocity`` up to date."""
        read_pitch_rate(self._data.qvel, self.angular_velocity)

    def refresh_calls(self) -> list[KernelCall]:
        """Return the calls of ``refresh``."""
        return [KernelCall(read_pitch_rate, self._data.qvel, self.angular_velocity)]

    def publish_call(self, truth: RobotTruth) -> KernelCall:
        """Return the call that writes the base's pose and velocity."""
        return signal_call(report_planar, self._data.qpos, self._data.qvel, truth)


class FloatingBase(FixedBase):
    """A base that moves freely. Its coordinates are position and quaternion w, x, y, z; its
    velocities are the linear one in the world and the angular one in the body."""

    positions = 7
    velocities = 6

    def __init__(self, data: MjData) -> None:
        super().__init__(data)
        self.angular_velocity = data.qvel[3:6]

    @staticmethod
    def add_joints(body: Any) -> None:
        """Add a free joint."""
        body.add_freejoint(name="base")

    def place(self) -> None:
        """Put the base upright at the world's origin."""
        self._data.qpos[:3] = 0.0
        self._data.qpos[3:7] = [1.0, 0.0, 0.0, 0.0]

    def turn(self, rotation: Array) -> None:
        """Turn the upright base by a rotation vector [rad, world]."""
        import mujoco

        angle = math.sqrt(sum(float(x) ** 2 for x in rotation))
        if angle > 0.0:
            mujoco.mju_axisAngle2Quat(self._data.qpos[3:7], rotation / angle, angle)

    def shift(self, offset: Array) -> None:
        """Move the base by ``offset`` [m, world]."""
        self._data.qpos[:3] += offset

    def publish_call(self, truth: RobotTruth) -> KernelCall:
        """Return the call that writes the base's pose and velocity."""
        return signal_call(report_floating, self._data.qpos, self._data.qvel, truth)


BASES: dict[Literal["floating", "planar", "fixed"], type[FixedBase]] = {
    "floating": FloatingBase,
    "planar": PlanarBase,
    "fixed": FixedBase,
}
"""The kind of base by the description's ``base_joint``."""
