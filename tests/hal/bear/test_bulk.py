"""One exchange with ten actuators: the frame's bytes, lost answers, and what the actuators got."""

import numpy as np
import pytest

from aloft.hal.bear.bulk import BulkExchange
from aloft.hal.bear.bus import BearBus, BusError, open_port
from aloft.hal.bear.protocol import STATUS, FrameReader, Instruction, frame_bytes
from aloft.hal.twin.devices import EmulatedActuator, EmulatedBus, unchanged
from aloft.hal.twin.server import PseudoTerminal
from aloft.runtime.testing.allocations import count_array_allocations

from .virtual_wire import VirtualWire

READ = ("present_position", "present_velocity", "present_iq")
WRITE = ("goal_iq", "goal_position", "goal_velocity")


def exchange(
    devices: int = 10, read: tuple[str, ...] = READ, write: tuple[str, ...] = WRITE
) -> tuple[BulkExchange, EmulatedBus, VirtualWire]:
    emulated = EmulatedBus(EmulatedActuator(k + 1) for k in range(devices))
    for actuator in emulated.actuators.values():
        actuator.config["limit_i_max"] = 30.0
        actuator.status["present_position"] = 0.25 * actuator.device
    wire = VirtualWire(emulated)
    bulk = BulkExchange(BearBus(wire, reply_time=1e-3), range(1, devices + 1), read, write)
    return bulk, emulated, wire


def test_the_frame_is_as_published() -> None:
    bulk, _, wire = exchange(2, ("present_position",), ("goal_iq",))
    bulk.goals[:] = [[1.0], [-2.0]]
    assert bulk.exchange() == 2
    head = bytes((0xFF, 0xFF, 0xFE, 4 + 1 + 1 + 2 + 8, 0x12, 2, 0x11, 0x09, 0x03))
    assert (
        wire.last[:-1]
        == head + b"\x01" + np.float32(1).tobytes() + b"\x02" + np.float32(-2).tobytes()
    )
    (frame,) = FrameReader().feed(wire.last)
    assert frame.code == Instruction.BULK
    assert bulk.values.tolist() == [[0.25], [0.5]]


def test_goals_arrive_and_measurements_come_back() -> None:
    bulk, emulated, wire = exchange()
    rng = np.random.default_rng(1)
    bulk.goals[:] = rng.uniform(-10, 10, bulk.goals.shape).astype(np.float32)
    assert bulk.exchange() == 10
    assert len(wire.last) == 144  # so many bytes go out at 3 registers each way, and 180 come back
    for row, actuator in enumerate(emulated.actuators.values()):
        assert [actuator.status[name] for name in WRITE] == bulk.goals[row].tolist()
    assert bulk.values[:, 0].tolist() == [0.25 * k for k in range(1, 11)]
    assert set(bulk.error_bytes.tolist()) == {0x80} and not bulk.ages.any()


def test_whole_numbers_travel_as_such() -> None:
    bulk, emulated, _ = exchange(2, ("torque_enable", "goal_iq"), ("torque_enable", "goal_iq"))
    bulk.goals[:] = [[1, 0.5], [3, 0.25]]
    assert bulk.exchange() == 2
    assert [a.status["torque_enable"] for a in emulated.actuators.values()] == [1, 3]
    assert bulk.values.tolist() == [[1, 0.5], [3, 0.25]]


@pytest.mark.parametrize("lost", [(1,), (3, 4), (10,), tuple(range(1, 11))])
def test_lost_answers_leave_the_others_in_their_places(lost: tuple[int, ...]) -> None:
    bulk, emulated, _ = exchange()
    emulated.fault = lambda device, answer: b"" if device in lost else answer
    assert bulk.exchange() == 10 - len(lost)
    for row in range(10):
        gone = row + 1 in lost
        assert bulk.values[row, 0] == (0.0 if gone else 0.25 * (row + 1))
        assert bulk.ages[row] == gone
    emulated.fault = lambda device, answer: answer
    assert bulk.exchange() == 10 and not bulk.ages.any()


def test_damaged_and_shortened_answers_are_left_out() -> None:
    rng = np.random.default_rng(2)
    bulk, emulated, _ = exchange()
    for _ in range(300):
        victim = int(rng.integers(1, 11))

        def fault(device: int, answer: bytes, victim: int = victim) -> bytes:
            if device != victim:
                return answer
            if rng.random() < 0.3:
                return answer[: int(rng.integers(0, len(answer)))]
            hurt = bytearray(answer)
            hurt[int(rng.integers(0, len(hurt)))] ^= int(rng.integers(1, 256))
            return bytes(hurt)

        emulated.fault = fault
        assert bulk.exchange() == 9
        assert bulk.ages[victim - 1] == 1
        emulated.fault = lambda device, answer: answer
        assert bulk.exchange() == 10
        assert bulk.values[:, 0].tolist() == [0.25 * k for k in range(1, 11)]


def test_an_instruction_of_another_master_costs_only_the_answer_that_it_displaces() -> None:
    """A write of four registers is as long as an answer with five."""
    emulated = EmulatedBus(EmulatedActuator(device) for device in (1, 2, 3))
    for actuator in emulated.actuators.values():
        actuator.status["present_position"] = 0.25 * actuator.device
    values = {name: (STATUS[name], 1.0) for name in (*WRITE, "goal_id")}
    data = b"".join(bytes((each.address,)) + each.pack(x) for each, x in values.values())
    write_four = frame_bytes(1, Instruction.WRITE_STATUS, data)
    with PseudoTerminal(emulated.receive) as terminal:
        bus = BearBus(open_port(terminal.path), reply_time=0.5)
        bulk = BulkExchange(bus, (1, 2, 3), (*READ, "input_voltage", "winding_temperature"), WRITE)
        assert bulk.exchange() == 3
        emulated.fault = lambda device, answer: write_four + answer if device == 1 else answer
        for device, actuator in emulated.actuators.items():
            actuator.status["present_position"] = 0.5 * device
        assert bulk.exchange() == 2
        assert bulk.values[:, 0].tolist() == [0.5, 1.0, 0.75] and bulk.ages.tolist() == [0, 0, 1]
        assert (bus.counts.foreign, bus.counts.damaged, bus.counts.silent) == (1, 0, 1)
        emulated.fault = unchanged
        assert bulk.exchange() == 3
        assert bulk.values[:, 0].tolist() == [0.5, 1.0, 1.5]
        assert (bus.counts.foreign, bus.counts.damaged, bus.counts.silent) == (1, 0, 1)
        bus.close()


def test_an_answer_that_cannot_be_is_none() -> None:
    # the checksum has 8 bits: one in 256 pieces of damage passes it
    bulk, emulated, _ = exchange(2)
    bulk.plausible[0] = -60.0, 60.0
    bulk.largest_step[0] = 0.3
    first = emulated.actuators[1]
    assert bulk.exchange() == 2
    for value in (float("nan"), float("inf"), 61.0, 0.25 + 0.31):
        first.status["present_position"] = value
        assert bulk.exchange() == 1
        assert bulk.values[0, 0] == 0.25 and bulk.ages.tolist() == [1, 0]
        assert bulk.bus.counts.damaged > 0
        first.status["present_position"] = 0.25
        assert bulk.exchange() == 2
    first.status["present_position"] = 0.25 + 0.5
    assert bulk.exchange() == 1
    assert bulk.exchange() == 2, "in two exchanges it may have moved so far"


def test_a_cycle_makes_no_array() -> None:
    bulk, _, _ = exchange()
    bulk.exchange()
    with count_array_allocations() as counted:
        for _ in range(20):
            bulk.exchange()
    assert counted.count == 0, counted.places


def test_what_is_refused() -> None:
    with pytest.raises(BusError, match="takes 270 bytes; it may take 255, with 1 to 15 registers"):
        exchange(20)
    with pytest.raises(BusError, match="mode is a configuration register; a bulk exchange has"):
        exchange(2, ("mode",))
    with pytest.raises(BusError, match="present_iq can only be read"):
        exchange(2, READ, ("present_iq",))
    bulk, _, wire = exchange(2)
    bulk.goals[1, 0] = np.inf
    with pytest.raises(BusError, match="the goal goal_iq of actuator 2 is inf: nothing was sent"):
        bulk.exchange()
    assert wire.last == b""
