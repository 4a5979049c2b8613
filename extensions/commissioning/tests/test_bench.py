"""What is done on a bench: it sends only what it says, and moves nothing that was not asked for."""

from __future__ import annotations

import numpy as np
import pytest
from tests.hal.bear.virtual_wire import VirtualWire

from aloft.extensions.commissioning import bench
from aloft.hal.bear.bus import BearBus, BusError
from aloft.hal.bear.configuration import Hardware
from aloft.hal.bear.protocol import FrameReader, Instruction, Torque
from aloft.hal.twin.devices import EmulatedActuator, EmulatedBus
from aloft.robots.description import find_robot

ROBOT = find_robot("bruce")


class Wire(VirtualWire):
    """A port to emulated actuators whose motors are where they are told to be."""

    def __init__(self, bus: EmulatedBus) -> None:
        super().__init__(bus)
        self.sent: list[int] = []

    def write(self, data: bytes | bytearray) -> int:
        self.sent += [frame.code for frame in FrameReader().feed(data)]
        count = super().write(data)
        for actuator in self.bus.actuators.values():
            if actuator.driving:
                actuator.status["present_position"] = actuator.status["goal_position"]
        return count


@pytest.fixture
def wire() -> Wire:
    return Wire(EmulatedBus(EmulatedActuator(k) for k in range(1, 11)))


@pytest.fixture
def bus(wire: Wire) -> BearBus:
    return BearBus(wire, reply_time=0.001)


@pytest.fixture
def hardware() -> Hardware:
    return Hardware.for_twin(ROBOT)


def states(wire: Wire) -> list[float]:
    return [actuator.status["torque_enable"] for actuator in wire.bus.actuators.values()]


def test_scan_only_pings(wire: Wire, bus: BearBus, hardware: Hardware) -> None:
    del wire.bus.actuators[3]
    wire.bus.actuators[20] = EmulatedActuator(20)
    found = bench.scan(bus, hardware, range(30))
    assert [each.device for each in found] == [1, 2, 4, 5, 6, 7, 8, 9, 10, 20]
    assert found[0].motor == "right_yaw_motor" and found[-1].motor == ""
    assert set(wire.sent) == {Instruction.PING}


def test_status_only_reads(wire: Wire, bus: BearBus, hardware: Hardware) -> None:
    del wire.bus.actuators[3]
    wire.bus.actuators[1].fail(4)
    rows = bench.status(bus, hardware)
    assert rows[0]["trouble"] == "it is outside its position limits"
    assert rows[1]["input_voltage"] == pytest.approx(14.8) and rows[1]["trouble"] == ""
    assert "actuator 3 does not answer" in rows[2]["error"]
    assert not {Instruction.WRITE_STATUS, Instruction.WRITE_CONFIG} & set(wire.sent)


def test_offsets_are_those_of_the_pose(wire: Wire, bus: BearBus) -> None:
    hardware = Hardware.for_twin(ROBOT)
    motors = {
        name: motor.model_copy(update={"sign": -1 if k % 3 else 1})
        for k, (name, motor) in enumerate(hardware.motors.items())
    }
    hardware = hardware.model_copy(update={"motors": motors})
    wanted = np.linspace(-1.0, 1.0, 10)
    angles = ROBOT.joint_to_motor @ ROBOT.standing_position
    for motor, offset, angle in zip(motors.values(), wanted, angles, strict=True):
        raw = motor.sign * (angle + offset)
        wire.bus.actuators[motor.id].status["present_position"] = float(raw)
    found = bench.calibrate(bus, hardware, ROBOT, ROBOT.standing_position)
    np.testing.assert_allclose(list(found.values()), wanted, atol=1e-6)
    assert not {Instruction.WRITE_STATUS, Instruction.WRITE_CONFIG} & set(wire.sent)
    wire.bus.actuators[4].status["torque_enable"] = Torque.ON
    with pytest.raises(BusError, match="drive right_knee_motor is switched on"):
        bench.calibrate(bus, hardware, ROBOT, ROBOT.standing_position)


def test_stop_damps_all_and_says_which_are_not_certain(
    wire: Wire, bus: BearBus, hardware: Hardware
) -> None:
    assert bench.stop(bus, hardware) == []
    assert states(wire) == [3] * 10
    del wire.bus.actuators[3]
    assert bench.stop(bus, hardware) == ["right_hip_motor_b"]


def test_jog_moves_one_motor_there_and_back(wire: Wire, bus: BearBus, hardware: Hardware) -> None:
    wire.bus.actuators[1].status["present_position"] = 0.3
    track = list(bench.jog(bus, hardware, "right_yaw_motor", 0.2, 0.5, lambda: True))
    goals, reached = np.array(track).T
    assert len(track) == 500
    assert goals.max() == pytest.approx(0.5, abs=1e-4) and goals[-1] == pytest.approx(0.3)
    assert reached.max() == pytest.approx(0.5, abs=1e-3)
    assert np.abs(np.diff(goals)).max() < 0.002, "no step"
    assert states(wire) == [3] + [0] * 9, "it ends in damping, and the others were never on"
    config = wire.bus.actuators[1].config
    assert config["limit_i_max"] == 8.0 and config["watchdog_timeout"] == 25_000
    # the whole current if the motor did not move at all
    assert config["p_gain_direct_force"] * 0.2 == pytest.approx(8.0)
    assert config["d_gain_direct_force"] == pytest.approx(0.05 * config["p_gain_direct_force"])
    assert config["mode"] == 3 and config["i_gain_direct_force"] == 0.0
    half = len(goals) // 2
    np.testing.assert_allclose(goals[:half], goals[::-1][1 : half + 1], atol=1e-9)
    assert goals[half // 2 - 1] == pytest.approx(0.4, abs=1e-3), "half-way after a quarter"


def test_jog_ends_in_damping_whatever_happens(wire: Wire, bus: BearBus, hardware: Hardware) -> None:
    held = iter([True] * 20 + [False] * 1000)
    with pytest.raises(BusError, match="the dead man's switch was let go"):
        list(bench.jog(bus, hardware, "left_yaw_motor", 0.2, 0.5, lambda: next(held)))
    assert states(wire)[5] == 3
    for k, _ in enumerate(bench.jog(bus, hardware, "left_yaw_motor", 0.2, 0.5, lambda: True)):
        if k == 10:
            break  # the generator is closed here, as by an exception of its user
    assert states(wire)[5] == 3


@pytest.mark.parametrize(
    ("name", "angle", "text"),
    [
        ("yaw", 0.1, "there is no motor 'yaw' in the file: right_yaw_motor, "),
        ("right_yaw_motor", 0.6, "jog by 0 to 0.5 rad, not by 0.6"),
        ("right_yaw_motor", 0.0, "jog by 0 to 0.5 rad, not by 0"),
        ("right_yaw_motor", float("nan"), "not by nan"),
        ("left_ankle_motor", 0.2, "left_ankle_motor would be at 0.200 rad, beyond -1 to 0.1"),
    ],
)
def test_what_jog_refuses(wire: Wire, bus: BearBus, name: str, angle: float, text: str) -> None:
    hardware = Hardware.for_twin(ROBOT)
    ankle = hardware.motors["left_ankle_motor"].model_copy(update={"low": -1.0, "high": 0.1})
    hardware = hardware.model_copy(
        update={"motors": {**hardware.motors, "left_ankle_motor": ankle}}
    )
    with pytest.raises(BusError) as caught:
        list(bench.jog(bus, hardware, name, angle, 0.5, lambda: True))
    assert text in str(caught.value)
    assert states(wire) == [0] * 10
