"""Measurements in the description's units and directions; torques are means over a tick's exchanges."""

import numpy as np
import pytest
from numpy.typing import NDArray

from aloft.hal.bear.bulk import BulkExchange
from aloft.hal.bear.bus import BearBus
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.measurement import READ, Measurement, Supervision
from aloft.hal.bear.sense_board import SenseBoard
from aloft.hal.twin.twin_robot import VirtualBoardPort, VirtualBusPort
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


def with_settings(motors: dict[str, float] | None = None, **board: object) -> Hardware:
    """The hardware with other torque constants and another sensor board."""
    data = HARDWARE.model_dump()
    data["board"] |= board
    for name, constant in (motors or {}).items():
        data["motors"][name]["torque_constant"] = constant
    return Hardware.model_validate(data)


def test_a_motor_may_have_a_torque_constant_of_its_own(bulk: BulkExchange) -> None:
    hardware = with_settings({"left_yaw_motor": 0.5 * CONSTANT})
    measured = Measurement(ROBOT, hardware)
    bulk.values[:, 2] = 2.0
    measured.take_drives(bulk)
    motors = np.full(10, 2.0 * CONSTANT)
    motors[ROBOT.transmission.motors.index("left_yaw_motor")] *= 0.5
    np.testing.assert_allclose(measured.joint_torque, ROBOT.joint_to_motor.T @ motors, atol=1e-12)


def test_readings_of_an_imu_that_is_turned_come_in_the_bases_axes() -> None:
    """The board's x points to the robot's left: its rotation vector is 90 deg about z."""
    measured = Measurement(ROBOT, with_settings(imu_rotation=(0.0, 0.0, np.pi / 2)))
    board = SenseBoard(VirtualBoardPort(None))  # type: ignore[arg-type]
    board.specific_force[:] = 1.0, 2.0, 9.0
    board.angular_velocity[:] = 0.1, 0.2, 0.3
    measured.take_board(board)
    np.testing.assert_allclose(measured.specific_force, [-2.0, 1.0, 9.0], atol=1e-12)
    np.testing.assert_allclose(measured.angular_velocity, [-0.2, 0.1, 0.3], atol=1e-12)


def test_a_normally_closed_switch_is_closed_when_its_bit_is_not_set() -> None:
    measured = Measurement(ROBOT, with_settings(normally_closed=["right_heel"]))
    board = SenseBoard(VirtualBoardPort(None))  # type: ignore[arg-type]
    for bits in ([False, True, False, False], [True, False, False, True]):
        board.closed[:] = bits
        measured.take_board(board)
        assert measured.closed.tolist() == [bits[0], not bits[1], bits[2], bits[3]]


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


@pytest.mark.parametrize(
    ("voltage", "current", "speed", "text"),
    [
        (12.9, 0.0, 0.0, "12.9 V is below the lowest voltage of 13 V"),
        (11.2, 10.0, 10.0, ""),  # 350 W of work and 200 W of heat: 2.0 V over 40 mOhm
        (
            10.9,
            10.0,
            10.0,
            "10.9 V is below the lowest voltage of 13 V, also without its sag of 2.0 V",
        ),
        (12.9, 10.0, -10.0, "12.9 V is below the lowest voltage of 13 V"),  # it charges the pack
        (9.9, 30.0, 20.0, "9.9 V is below the 10 V of a brown-out"),
    ],
)
def test_a_pack_that_sags_under_load_is_not_empty(
    bulk: BulkExchange, voltage: float, current: float, speed: float, text: str
) -> None:
    measured = Measurement(ROBOT, HARDWARE)
    supervision = Supervision(HARDWARE, ROBOT.transmission.motors)
    bulk.values[:, 1:4], bulk.values[:, 4] = (speed, current, voltage), 30.0
    bulk.error_bytes[:] = 0x80
    measured.take_drives(bulk)
    for cycle in range(1, HARDWARE.drives.bad_cycles + 1):
        found = supervision.check_drives(measured, bulk, driving=True)
        assert not found or cycle == HARDWARE.drives.bad_cycles
    who = "drive right_yaw_motor (address 1): "
    assert found == (f"{who}{text}" if text else "")
