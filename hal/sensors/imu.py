"""An inertial measurement unit: gyroscope and accelerometer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...blocks.signals import ImuReading
from ...mathematics.arrays import Array, Vector3
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from .sensor import MountedSensor, RosMessage

if TYPE_CHECKING:
    from mujoco import MjData, MjModel, MjSpec


@kernel
def read_imu(gyroscope: Vector3, accelerometer: Vector3, rate: Vector3, force: Vector3) -> None:
    """Read the angular velocity [rad/s] and the specific force [m/s^2] at a site."""
    rate[:] = gyroscope
    force[:] = accelerometer


class Imu(MountedSensor):
    """Angular velocity and specific force. Every robot may have one at its base's origin, ``imu: true``;
    a description can mount further ones on any link."""

    kind = "imu"
    signal = ImuReading
    averaged = ("specific_force",)
    packet_fields = ("specific_force", "angular_velocity")
    ros2 = RosMessage(
        "sensor_msgs/msg/Imu",
        {"angular_velocity": "angular_velocity", "specific_force": "linear_acceleration"},
    )

    def add_to_model(self, spec: MjSpec, body: str) -> None:
        """Add a gyroscope and an accelerometer."""
        import mujoco

        kind = mujoco.mjtSensor
        for name, sensor in (
            ("gyroscope", kind.mjSENS_GYRO), ("accelerometer", kind.mjSENS_ACCELEROMETER)
        ):  # fmt: skip
            spec.add_sensor(
                name=f"{self.site}/{name}", type=sensor, objtype=mujoco.mjtObj.mjOBJ_SITE,
                objname=self.site,
            )  # fmt: skip

    def from_mujoco(self, model: MjModel, data: MjData, out: Mapping[str, Array]) -> list[Call]:
        """Read both."""
        names = ("gyroscope", "accelerometer")
        true = [data.sensor(f"{self.site}/{name}").data for name in names]
        return [KernelCall(read_imu, *true, out["angular_velocity"], out["specific_force"])]
