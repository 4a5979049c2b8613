"""Questions and answers on a bus of emulated actuators behind a real pseudo-terminal."""

from collections.abc import Iterator

import pytest

from aloft.hal.bear.bus import BearBus, BusError, NoReplyError, open_port
from aloft.hal.bear.protocol import Torque
from aloft.hal.twin.devices import EmulatedActuator, EmulatedBus
from aloft.hal.twin.server import PseudoTerminal


@pytest.fixture
def emulated() -> EmulatedBus:
    return EmulatedBus([EmulatedActuator(1), EmulatedActuator(2)])


@pytest.fixture
def bus(emulated: EmulatedBus) -> Iterator[BearBus]:
    with PseudoTerminal(emulated.receive) as terminal:
        found = BearBus(open_port(terminal.path), reply_time=0.5)
        yield found
        found.close()


def test_ping_and_scan(bus: BearBus) -> None:
    assert bus.ping(2).data == b"\x01\x00\x02\x00"
    assert bus.ping(2).problem == ""
    bus.reply_time = 0.02
    assert list(bus.scan(range(1, 5))) == [1, 2]


def test_silence(bus: BearBus) -> None:
    bus.reply_time = 0.01
    message = "actuator 7 does not answer PING after 3 tries of 10 ms; check its power, its address"
    with pytest.raises(NoReplyError, match=message):
        bus.ping(7)
    assert bus.counts.silent == 3


def test_registers(bus: BearBus, emulated: EmulatedBus) -> None:
    bus.verify(1, {"limit_i_max": 30.0, "mode": 3, "goal_position": 0.5})
    found = bus.read(1, "goal_position", "mode", "input_voltage")
    assert found == {"goal_position": 0.5, "mode": 3, "input_voltage": pytest.approx(14.8)}
    assert list(found) == ["goal_position", "mode", "input_voltage"]
    assert emulated.actuators[1].config["limit_i_max"] == 30.0
    bus.save(1)
    bus.ping(1)
    assert emulated.actuators[1].saves == 1


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"gaol_iq": 1.0}, "no register 'gaol_iq'; the nearest are goal_iq"),
        ({"present_iq": 1.0}, "present_iq can only be read"),
        ({"limit_i_max": 101.0}, "limit_i_max takes 0 to 100 A, and 101 would be ignored"),
        ({"limit_i_max": float("nan")}, "limit_i_max takes 0 to 100 A, and nan would be ignored"),
    ],
)
def test_what_is_not_sent(bus: BearBus, values: dict[str, float], message: str) -> None:
    with pytest.raises(BusError, match=message):
        bus.write(1, values)


def test_configuration_while_driving_is_noticed(bus: BearBus) -> None:
    bus.write(1, {"torque_enable": Torque.ON})
    with pytest.raises(
        BusError, match="limit_i_max was set to 9 A and is 5; configuration can only"
    ):
        bus.verify(1, {"limit_i_max": 9.0})


def test_lost_and_damaged_answers_are_asked_for_again(bus: BearBus, emulated: EmulatedBus) -> None:
    answers = []

    def fault(device: int, answer: bytes) -> bytes:
        answers.append(answer)
        if len(answers) == 1:
            return b""
        return answer[:-1] + bytes((answer[-1] ^ 1,)) if len(answers) == 2 else answer

    emulated.fault = fault
    bus.reply_time = 0.05
    assert bus.read(2, "mode") == {"mode": 0}
    assert (bus.counts.silent, bus.counts.damaged, len(answers)) == (2, 1, 3)


def test_a_port_that_is_not_there_or_taken(bus: BearBus) -> None:
    with pytest.raises(BusError, match="the serial port /dev/nowhere cannot be opened"):
        open_port("/dev/nowhere")
    with pytest.raises(BusError, match="another program that uses it"):
        open_port(bus.port.name)  # type: ignore[attr-defined]
