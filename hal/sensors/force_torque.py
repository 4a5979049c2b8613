"""A six-axis force sensor under a link: the force and torque with which the world acts on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...mathematics.arrays import Array, Matrix3, Vector3
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.expressions import cross
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...runtime.language.signals import Field, Signal
from .sensor import Arrow, MountedSensor, RosMessage

if TYPE_CHECKING:
    from mujoco import MjData, MjModel, MjSpec


class Wrench(Signal):
    """One sample of a six-axis force sensor."""

    force = Field(3, unit="N", text="force on the link, in the sensor's axes")
    torque = Field(3, unit="N m", text="torque on the link about the sensor, in its axes")


@kernel
def read_wrench(
    net_force: Vector3, net_torque: Vector3, centre: Vector3, origin: Vector3, rotation: Matrix3,
    force: Vector3, torque: Vector3,
) -> None:  # fmt: skip
    """Compute the wrench on a link, in the sensor's axes, from that with which the link acts on the world.

    Args:
        net_force, net_torque: on the world [N, N m, world], about ``centre`` [m, world].
        origin: of the sensor [m, world].
        rotation: from the sensor's axes to the world's.
    """
    force[:] = -(rotation.T @ net_force)
    torque[:] = cross(rotation.T @ (centre - origin), force) - rotation.T @ net_torque


class ForceSensor(MountedSensor):
    """A six-axis force sensor between a link and the world, as under the sole of a foot. It measures all
    contacts of the link with the ground, as a mean since the last sample."""

    kind = "force_torque"
    signal = Wrench
    averaged = ("force", "torque")
    ros2 = RosMessage(
        "geometry_msgs/msg/WrenchStamped", {"force": "wrench.force", "torque": "wrench.torque"}
    )
    drawn = Arrow("force")

    def add_to_model(self, spec: MjSpec, body: str) -> None:
        """Add the net contact force of the link's body with the world."""
        import mujoco

        field, net_force = mujoco.mjtConDataField, 3
        wanted = (field.mjCONDATA_FORCE, field.mjCONDATA_TORQUE, field.mjCONDATA_POS)
        spec.add_sensor(
            name=f"{self.site}/net", type=mujoco.mjtSensor.mjSENS_CONTACT,
            objtype=mujoco.mjtObj.mjOBJ_BODY, objname=body,
            reftype=mujoco.mjtObj.mjOBJ_BODY, refname="world",
            intprm=[sum(1 << int(each) for each in wanted), net_force, 1],
        )  # fmt: skip

    def from_mujoco(self, model: MjModel, data: MjData, out: Mapping[str, Array]) -> list[Call]:
        """Read the net contact force, and move it to the sensor."""
        site = model.site(self.site).id
        net = data.sensor(f"{self.site}/net").data
        origin, rotation = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
        return [
            KernelCall(
                read_wrench, net[0:3], net[3:6], net[6:9], origin, rotation, out["force"],
                out["torque"],
            )
        ]  # fmt: skip
