"""Collects after every tick what only a simulator knows."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...blocks.signals import RobotTruth
from ...mathematics.arrays import (
    Array1D,
    Indices1D,
    Rows3,
    Vector3,
)
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.ground_surface import Surface, height_of_ground
from ...mathematics.kernel import kernel
from ...robots.description import RobotDescription
from ...robots.terrain import Terrain
from ...runtime.language.steps import signal_call
from .base import FixedBase
from .stance import depth_of_contacts
from .state import TickRecord

if TYPE_CHECKING:
    from mujoco import MjData


class TrueState(NamedTuple):
    """True state of the present instant.

    ``joint_position``, ``joint_velocity`` (n_joints,) [rad, rad/s]; ``com``, ``com_velocity`` and
    ``angular_momentum`` (3,) [m, m/s, N m s, world]; ``places`` (n, 3) [m, world] of all named places,
    of which ``contacts`` (n_contacts,) are those of the contact points, which lie ``below`` [m] under
    them. ``ground`` is the surface of the ground, ``normal`` (3,) memory for its normal.
    """

    joint_position: Array1D
    joint_velocity: Array1D
    com: Vector3
    com_velocity: Vector3
    angular_momentum: Vector3
    places: Rows3
    contacts: Indices1D
    below: Array1D
    ground: Surface
    normal: Vector3


@kernel
def largest(values: Array1D) -> float:
    """Return the largest value, and zero of none."""
    found = values[0] if values.shape[0] > 0 else 0.0
    for k in range(1, values.shape[0]):
        found = max(found, values[k])
    return found


@kernel
def report_contacts(instant: TrueState, peaks: TickRecord, report: RobotTruth) -> None:
    """Report the contact points: where they are, the ground under them, and the mean force on each."""
    steps = peaks.steps[()]
    for point in range(instant.below.shape[0]):
        place = instant.contacts[point]
        x, y = instant.places[place, 0], instant.places[place, 1]
        report.contact_position[point, 0], report.contact_position[point, 1] = x, y
        report.contact_position[point, 2] = instant.places[place, 2] - instant.below[point]
        report.ground_height[point] = height_of_ground(instant.ground, x, y, instant.normal)
        touched = False
        for axis in range(3):
            force = peaks.load[point, 1 + axis] / -steps
            report.contact_force[point, axis] = force
            touched = touched or force != 0.0
        report.contact_touched[point] = touched


@kernel
def report_truth(instant: TrueState, peaks: TickRecord, report: RobotTruth) -> None:
    """Write the truth about a tick that has been simulated."""
    report.com[:] = instant.com
    report.com_velocity[:] = instant.com_velocity
    report.angular_momentum[:] = instant.angular_momentum
    report_contacts(instant, peaks, report)
    count, at_limit = report.joint_position.shape[0], 0
    for k in range(count):
        report.joint_position[k] = instant.joint_position[k]
        report.joint_velocity[k] = instant.joint_velocity[k]
        at_limit += peaks.saturated[k]
        high, low = peaks.torque_high[k], peaks.torque_low[k]
        report.motor_torque[k] = low if -low > high else high
        high, low = peaks.speed_high[k], peaks.speed_low[k]
        report.motor_speed[k] = low if -low > high else high
    report.forbidden_contacts[()] = peaks.forbidden[()]
    report.joint_limit_violation[()] = largest(peaks.violation)
    report.motor_overload[()] = largest(peaks.overload)
    report.saturated_share[()] = at_limit / (peaks.steps[()] * max(1, count))


class TruthReport:
    """Fills ``RobotTruth`` from the simulator's memory and the record of the last tick.

    Positions, velocities and momenta are those of the present instant; forces, contacts, peaks
    and counts are over the physics steps of the last tick.
    """

    def __init__(
        self,
        data: MjData,
        base: FixedBase,
        robot: RobotDescription,
        scene: Terrain,
        record: TickRecord,
    ) -> None:
        self._base = base
        self._instant = TrueState(
            data.qpos[base.positions :],
            data.qvel[base.velocities :],
            data.sensor("com").data,
            data.sensor("com_velocity").data,
            data.sensor("angular_momentum").data,
            data.site_xpos,
            np.array([data.site(contact.name).id for contact in robot.contacts], dtype=np.int64),
            depth_of_contacts(robot),
            scene.surface,
            np.zeros(3),
        )
        self._record = record

    def report_calls(self, truth: RobotTruth) -> tuple[KernelCall, KernelCall]:
        """Write all fields of the truth."""
        return (
            self._base.publish_call(truth),
            signal_call(report_truth, self._instant, self._record, truth),
        )
