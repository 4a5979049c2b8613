"""The quirks of a real actuator, as far as they are known, in its emulation."""

import pytest

from aloft.blocks.signals.robot import describe_conditions
from aloft.hal.bear.protocol import CONFIG, STATUS, BusFrame, Instruction, Mode, Torque
from aloft.hal.twin.devices import EmulatedActuator


def write(actuator: EmulatedActuator, **values: float) -> None:
    for name, value in values.items():
        register = STATUS.get(name) or CONFIG[name]
        code = Instruction.WRITE_STATUS if name in STATUS else Instruction.WRITE_CONFIG
        data = bytes((register.address,)) + register.pack(value)
        assert actuator.answer(BusFrame(actuator.device, code, data)) is None


def test_a_goal_beyond_its_limit_is_ignored_and_not_clamped() -> None:
    actuator = EmulatedActuator(1)
    write(actuator, limit_i_max=10.0, goal_iq=9.0)
    write(actuator, goal_iq=11.0)
    assert actuator.status["goal_iq"] == 9.0


def test_direct_force_ignores_limits_of_motion() -> None:
    actuator = EmulatedActuator(1)
    write(actuator, mode=Mode.POSITION, limit_position_max=1.0, goal_position=2.0)
    assert actuator.status["goal_position"] == 0.0
    write(actuator, mode=Mode.DIRECT_FORCE, goal_position=2.0)
    assert actuator.status["goal_position"] == 2.0


def test_the_watchdog() -> None:
    actuator = EmulatedActuator(1)
    write(actuator, mode=Mode.DIRECT_FORCE, watchdog_timeout=20_000, torque_enable=Torque.ON)
    actuator.advance(0.019)
    assert actuator.driving
    write(actuator, goal_iq=0.5)
    actuator.advance(0.019)
    assert actuator.driving
    actuator.advance(0.002)
    assert not actuator.driving
    assert actuator.status["torque_enable"] == Torque.ERROR
    assert describe_conditions(actuator.error_byte).startswith("its watchdog ran out")
    write(actuator, torque_enable=Torque.ON)
    assert not actuator.driving, "the error must be cleared by switching off first"
    write(actuator, torque_enable=Torque.OFF)
    write(actuator, torque_enable=Torque.ON)
    assert actuator.driving


def test_damping() -> None:
    actuator = EmulatedActuator(1)
    write(actuator, torque_enable=Torque.ON)
    write(actuator, torque_enable=Torque.DAMPING)
    assert actuator.damping and not actuator.driving


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("input_voltage", 5.0, "its supply voltage is out of range, or its gate driver failed"),
        ("winding_temperature", 101.0, "its winding is hotter than temp_limit_low; its supply"),
    ],
)
def test_supply_and_temperature(name: str, value: float, text: str) -> None:
    actuator = EmulatedActuator(1)
    write(actuator, torque_enable=Torque.ON)
    actuator.status[name] = value
    actuator.advance(0.001)
    assert not actuator.driving
    assert describe_conditions(actuator.error_byte).startswith(text)


def test_a_damaged_packet_is_reported_once() -> None:
    actuator = EmulatedActuator(1)
    actuator.garble()
    assert describe_conditions(actuator.error_byte) == "it received a damaged packet"
    actuator.answered()
    assert actuator.error_byte == 0x80
