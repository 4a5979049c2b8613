"""A six-axis force sensor under a link: the force and torque with which the world acts on it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...mathematics.arrays import Array
from ...mathematics.compiling.call_sequence import Call
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
def read_wrench(net: Array, origin: Array, rotation: Array, force: Array, torque: Array) -> None:
    """The wrench on a link from that with which the link acts on the world.

    Args:
        net: force [N], torque [N m] about the centre of pressure, and that centre [m], (9,), world.
        origin: of the sensor [m, world], (3,).
        rotation: from the sensor's axes to the world's, row by row, (9,).
    """
    x, y, z = net[6] - origin[0], net[7] - origin[1], net[8] - origin[2]
    about_x = float(net[3] + y * net[2] - z * net[1])
    about_y = float(net[4] + z * net[0] - x * net[2])
    about_z = float(net[5] + x * net[1] - y * net[0])
    for axis in range(3):
        to_x, to_y, to_z = rotation[axis], rotation[3 + axis], rotation[6 + axis]
        force[axis] = -(to_x * net[0] + to_y * net[1] + to_z * net[2])
        torque[axis] = -(to_x * about_x + to_y * about_y + to_z * about_z)


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
        net, at = data.sensor(f"{self.site}/net").data, data.site_xpos[site]
        turn = data.site_xmat[site]
        return [KernelCall(read_wrench, net, at, turn, out["force"], out["torque"])]
