"""Measurements in the description's units and directions; torques are means over a tick's exchanges."""

import numpy as np
import pytest
from numpy.typing import NDArray

from aloft.hal.bear.bulk import BulkExchange
from aloft.hal.bear.bus import BearBus
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.measurement import READ, Measurement
from aloft.hal.twin.twin_robot import VirtualBusPort
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")
HARDWARE = Hardware.for_twin(ROBOT)
CONSTANT = HARDWARE.drives.torque_constant


@pytest.fixture
def bulk() -> BulkExchange:
    """An exchange whose values the test writes itself; its port is never used."""
    bus = BearBus(VirtualBusPort(None))  # type: ignore[arg-type]
    return BulkExchange(bus, list(range(1, 11)), READ, ())


def joints_of(current: float) -> NDArray[np.float64]:
    """The joints' torques with this current in all motors."""
    motors = np.full(10, CONSTANT * current)
    return np.asarray(ROBOT.joint_to_motor.T @ motors, dtype=np.float64)


def test_torques_are_means_over_the_exchanges_of_a_tick(bulk: BulkExchange) -> None:
    """A command that acts half-way through a tick shows as half of its torque, not as all of it:
    how late commands act is measured from that."""
    measured = Measurement(ROBOT, HARDWARE)
    for currents, mean in (([1.0, 3.0], 2.0), ([5.0], 5.0), ([0.0, 0.0, 6.0], 2.0)):
        for current in currents:
            bulk.values[:, 2] = current
            measured.take_drives(bulk)
        np.testing.assert_allclose(measured.joint_torque, joints_of(mean), atol=1e-12)
        np.testing.assert_array_equal(measured.current, np.full(10, currents[-1]))
        measured.next_tick()
        np.testing.assert_allclose(measured.joint_torque, joints_of(mean), atol=1e-12)


def test_restored_measurements_are_not_counted_twice(bulk: BulkExchange) -> None:
    measured, other = (Measurement(ROBOT, HARDWARE) for _ in range(2))
    for current in (1.0, 3.0):
        bulk.values[:, 2] = current
        measured.take_drives(bulk)
    other.current_sum[:], other.exchanges = measured.current_sum, measured.exchanges
    other.restored(bulk)
    np.testing.assert_array_equal(other.joint_torque, measured.joint_torque)
    np.testing.assert_array_equal(other.current, measured.current)
    bulk.values[:, 2] = 8.0
    for each in (measured, other):
        each.take_drives(bulk)
    np.testing.assert_array_equal(other.joint_torque, measured.joint_torque)
    np.testing.assert_allclose(measured.joint_torque, joints_of(4.0), atol=1e-12)
