"""The sensors that a robot's description mounts on its links, as far as they say how they are drawn."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...mathematics.rotations import matrices_of_quaternions
from ...robots.robot_description import RobotDescription
from ...runtime.language.errors import AloftError
from .contacts import ARROW_RADIUS, force_arrows
from .drawing import Moments, SceneDisplay
from .scene_ports import Ports, ports_of

if TYPE_CHECKING:
    from ...hal.sensors.sensor import MountedSensor


def sensor_ports(robot: RobotDescription, ports: Ports) -> dict[str, MountedSensor]:
    """Return the ports on which the robot publishes mounted sensors, ``block.sensor``, with their
    sensors.

    Sensors of a user's own module that cannot be imported here are left out.
    """
    if not robot.sensors.mounted:
        return {}
    from ...hal.sensors.sensor import mounted_sensors

    try:
        sensors = mounted_sensors(robot)
    except (AloftError, ImportError):
        return {}
    return {
        port: sensor
        for sensor in sensors
        for port, fields in ports.items()
        if port.rpartition(".")[2] == sensor.name
        and sensor.signal.__name__ in next(iter(fields.values())).signals
    }


class SensorDisplay(SceneDisplay):
    """``sensors/NAME``: an arrow for every mounted sensor that is drawn as one, where it is mounted."""

    @cached_property
    def _arrows(self) -> dict[str, MountedSensor]:
        found = sensor_ports(self.robot, ports_of(self.header))
        return {port: sensor for port, sensor in found.items() if sensor.drawn is not None}

    def write_static(self) -> None:
        """Write the colours."""
        import rerun as rr

        for sensor in self._arrows.values():
            width = ARROW_RADIUS * self.scale
            arrow = rr.Arrows3D.from_fields(colors=[self.colors.support], radii=[width])
            self.log(f"sensors/{sensor.name}", arrow)

    def write(self, moments: Moments) -> None:
        """Write the vectors, in the world's frame."""
        import rerun as rr

        if not self._arrows:
            return
        poses = moments.poses(self.robot, self.ports.pose)
        for port, sensor in self._arrows.items():
            assert sensor.drawn is not None
            position, rotation = poses.of(sensor.link)
            axes = rotation @ matrices_of_quaternions(np.array(sensor.orientation))
            vector = np.einsum("nij,nj->ni", axes, moments[f"{port}.{sensor.drawn.field}"])
            arrows = rr.Arrows3D.columns(
                origins=position + rotation @ np.array(sensor.position),
                vectors=force_arrows(self.robot, vector),
            )
            self.send(f"sensors/{sensor.name}", moments, arrows)
