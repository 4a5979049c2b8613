"""Collects after every tick what only a simulator knows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...blocks.signals import RobotTruth
from ...robots.description import RobotDescription
from .base import FixedBase
from .scenes import Scene
from .stance import depth_of_contacts
from .state import TickRecord

if TYPE_CHECKING:
    from mujoco import MjData


class TruthReport:
    """Fills ``RobotTruth`` from the simulator's memory and the record of the last tick.

    Positions, velocities and momenta are those of the present instant; forces, contacts, peaks
    and counts are over the physics steps of the last tick.
    """

    def __init__(
        self, data: MjData, base: FixedBase, robot: RobotDescription, scene: Scene
    ) -> None:
        self._base = base
        self._scene = scene
        self._position, self._velocity = (
            data.qpos[base.positions :],
            data.qvel[base.velocities :],
        )
        self._com, self._com_velocity, self._angular_momentum = (
            data.sensor(name).data for name in ("com", "com_velocity", "angular_momentum")
        )
        self._below = depth_of_contacts(robot)
        self._places = [data.site(contact.name).xpos for contact in robot.contacts]
        n = len(robot.joints)
        self._negative, self._is_low = np.zeros(n), np.zeros(n, dtype=np.bool_)

    def publish(self, record: TickRecord, truth: RobotTruth) -> None:
        """Write all fields of ``truth``."""
        steps = int(record.steps)
        self._base.publish(truth)
        truth.joint_position[:] = self._position
        truth.joint_velocity[:] = self._velocity
        truth.com[:] = self._com
        truth.com_velocity[:] = self._com_velocity
        truth.angular_momentum[:] = self._angular_momentum
        np.divide(record.load[:, 1:], -steps, out=truth.contact_force)
        for k, place in enumerate(self._places):
            truth.contact_position[k] = place
            truth.contact_position[k, 2] -= self._below.item(k)
            truth.ground_height[k] = self._scene.ground_height(place.item(0), place.item(1))
            force = truth.contact_force[k]
            truth.contact_touched[k] = any(force.item(axis) != 0.0 for axis in range(3))
        truth.forbidden_contacts[()] = record.forbidden
        truth.joint_limit_violation[()] = max(record.violation.tolist(), default=0.0)
        truth.motor_overload[()] = max(record.overload.tolist(), default=0.0)
        truth.saturated_share[()] = sum(record.saturated.tolist()) / (
            steps * max(1, len(self._is_low))
        )
        for high, low, out in (
            (record.torque_high, record.torque_low, truth.motor_torque),
            (record.speed_high, record.speed_low, truth.motor_speed),
        ):
            np.negative(low, out=self._negative)
            np.greater(self._negative, high, out=self._is_low)
            out[:] = high
            np.copyto(out, low, where=self._is_low)
