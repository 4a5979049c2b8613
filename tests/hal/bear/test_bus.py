"""Questions and answers on a bus of emulated actuators behind a real pseudo-terminal."""

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from aloft.hal.bear.bus import TRIES, BearBus, BusError, NoReplyError, open_port
from aloft.hal.bear.protocol import BROADCAST, CONFIG, Instruction, Torque, frame_bytes
from aloft.hal.twin.devices import EmulatedActuator, EmulatedBus
from aloft.hal.twin.server import PseudoTerminal

from .virtual_wire import VirtualWire


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


class Line(VirtualWire):
    """A line on which somebody else sends a frame every 10 ms, in virtual time."""

    def __init__(self, frame: bytes) -> None:
        super().__init__(EmulatedBus([EmulatedActuator(1)]))
        self.frame = frame

    def read(self, size: int = 1) -> bytes:
        assert self.timeout is not None and size > 0
        self._now += min(self.timeout, 0.010)
        return self.frame if self.timeout >= 0.010 - 1e-9 else b""


def test_listening_counts_what_somebody_else_sends_meanwhile() -> None:
    bus = BearBus(Line(frame_bytes(1, Instruction.READ_STATUS, b"\x01")))
    assert bus.listen(0.055) == 5
    assert bus.listen(0.025) == 2
    assert bus.counts.foreign == 7
    answers = BearBus(Line(frame_bytes(1, 0x80, b"1234")))  # type: ignore[arg-type]
    assert answers.listen(0.055) == 0


READ, WRITE = Instruction.READ_STATUS, Instruction.WRITE_CONFIG


@pytest.mark.parametrize(
    ("device", "code", "size", "sensible"),
    [
        (1, Instruction.PING, 0, True), (1, Instruction.SAVE_CONFIG, 0, True),
        (1, Instruction.PING, 1, False), (1, Instruction.SAVE_CONFIG, 5, False),
        (1, READ, 0, False), (1, READ, 1, True), (1, READ, len(CONFIG), True),
        (1, Instruction.READ_CONFIG, len(CONFIG) + 1, False), (BROADCAST, READ, 1, False),
        (1, WRITE, 0, False), (1, WRITE, 4, False), (1, WRITE, 5, True), (1, WRITE, 10, True),
        (BROADCAST, Instruction.BULK, 2, False), (BROADCAST, Instruction.BULK, 3, True),
        (1, Instruction.BULK, 3, False), (1, 0x80, 4, False), (1, 0x00, 0, False),
    ],
)  # fmt: skip
def test_only_sensible_instructions_are_somebody_elses(
    device: int, code: Instruction, size: int, sensible: bool
) -> None:
    bus = BearBus(VirtualWire(EmulatedBus([EmulatedActuator(1)])))
    data = bytes(range(size))
    frame = frame_bytes(device, code, data)
    bus.overhear(frame)
    assert bus.counts.foreign == int(sensible)
    bus.overhear(b"\xff\xff\x01\xfa" + frame + b"noise")  # behind a beginning that has no end
    assert bus.counts.foreign == 2 * int(sensible)


READ_FOUR = frame_bytes(1, READ, b"\x01\x02\x03\x04")
"""An instruction of another master, as long as the answer with the value of one register."""


def test_an_instruction_of_another_master_is_no_answer(bus: BearBus, emulated: EmulatedBus) -> None:
    emulated.actuators[1].config["limit_i_max"] = 30.0
    emulated.fault = lambda device, answer: READ_FOUR + answer
    assert bus.read(1, "limit_i_max") == {"limit_i_max": 30.0}
    assert (bus.counts.foreign, bus.counts.stray, bus.counts.damaged) == (1, 0, 0)


@pytest.mark.parametrize("size", [1, 3, 7, 100])
@pytest.mark.parametrize("before", [b"", b"noise", b"\xff\xff\x01\xfa", b"\xff\xff"])
def test_listening_hears_what_comes_in_pieces_and_behind_noise(before: bytes, size: int) -> None:
    sent = before + 3 * READ_FOUR
    with PseudoTerminal(lambda data: b"") as terminal:
        bus = BearBus(open_port(terminal.path))
        pieces = [sent[start : start + size] for start in range(0, len(sent), size)]

        def send() -> None:
            for piece in pieces:
                terminal.send(piece)
                time.sleep(1e-3)

        with ThreadPoolExecutor(1) as pool:
            sending = pool.submit(send)
            heard = bus.listen(0.5)
            sending.result()
        assert heard == 3
        assert bus.listen(0.01) == 0
        bus.close()


def test_an_adapter_that_sends_back_what_is_sent_is_refused(emulated: EmulatedBus) -> None:
    with PseudoTerminal(lambda data: data + emulated.receive(data)) as terminal:
        bus = BearBus(open_port(terminal.path), reply_time=0.5)
        with pytest.raises(BusError, match="what is sent to actuator 2 comes back: switch off the"):
            bus.ping(2)
        assert bus.counts.foreign == 0
        bus.close()


def test_answers_of_others_are_stray() -> None:
    emulated = EmulatedBus([EmulatedActuator(1), EmulatedActuator(2)])
    wire = VirtualWire(emulated)
    bus = BearBus(wire, reply_time=1e-3)
    emulated.fault = lambda device, answer: frame_bytes(2, 0x80, answer[5:-1]) + answer  # type: ignore[arg-type]
    assert bus.ping(1).device == 1
    assert (bus.counts.stray, bus.counts.silent, bus.counts.damaged) == (1, 0, 0)
    assert bus.read(1, "input_voltage", "goal_iq") == {
        "input_voltage": pytest.approx(14.8), "goal_iq": 0.0,
    }  # fmt: skip
    emulated.fault = lambda device, answer: b""
    before = bus.now()
    with pytest.raises(NoReplyError):
        bus.ping(1)
    assert bus.counts.silent == TRIES
    assert bus.now() - before == pytest.approx(TRIES * bus.reply_time)
