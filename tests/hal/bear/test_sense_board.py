"""The sensor board's stream: packets, garbage between them, commands."""

import struct
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.blocks.signals import ImuReading
from aloft.hal.bear.bus import BusError
from aloft.hal.bear.sense_board import LENGTH, LONGEST, PACKET, BoardMode, SenseBoard, command_bytes


class Nothing:
    """A port on which nothing comes."""

    timeout: float | None = None

    def __init__(self) -> None:
        self.sent: list[bytes] = []

    def write(self, data: bytes) -> int:
        self.sent.append(data)
        return len(data)

    def read(self, size: int = 1) -> bytes:
        return b""

    def reset_input_buffer(self) -> None: ...

    def close(self) -> None: ...


def packet(numbers: tuple[float, ...], switches: int) -> bytes:
    body = bytes((27,)) + struct.pack("<6f", *numbers) + bytes((switches,))
    return b"\xff" + body + bytes((255 - sum(body) % 256,)) + b"\xfe"


NUMBERS = (0.5, -0.25, 9.75, 0.125, 0.0, -1.5)


def test_a_packet() -> None:
    board = SenseBoard(Nothing())
    data = packet(NUMBERS, 0x80 | 0b0101)
    assert len(data) == PACKET
    assert board.feed(data[:11]) == 0
    assert board.feed(data[11:]) == 1
    assert board.specific_force.tolist() == [0.5, -0.25, 9.75]
    assert board.angular_velocity.tolist() == [0.125, 0.0, -1.5]
    assert board.closed.tolist() == [True, False, True, False]


def test_a_calibration_changes_no_measurement() -> None:
    board = SenseBoard(Nothing())
    board.feed(packet(NUMBERS, 0x80))
    assert board.feed(packet((1.0,) * 6, 0xFF)) == 0
    assert board.calibrations == 1
    assert board.specific_force.tolist() == [0.5, -0.25, 9.75]


@given(st.binary(max_size=200), st.integers(0, 15))
def test_it_finds_back_after_garbage(noise: bytes, switches: int) -> None:
    board = SenseBoard(Nothing())
    good = packet(NUMBERS, 0x80 | switches)
    board.feed(noise)
    board.feed(good * 3)  # garbage that looks like a beginning swallows one packet at most
    assert np.array_equal(board.closed, [bool(switches & 1 << k) for k in range(4)])
    assert board.specific_force.tolist() == [0.5, -0.25, 9.75]


@given(st.integers(0, PACKET - 1), st.integers(1, 255))
def test_a_changed_byte_is_found(place: int, change: int) -> None:
    board = SenseBoard(Nothing())
    hurt = bytearray(packet(NUMBERS, 0x80))
    hurt[place] ^= change
    assert board.feed(bytes(hurt)) == 0
    assert board.feed(packet(NUMBERS, 0x81)) == 1
    assert board.closed.tolist() == [True, False, False, False]


def test_commands() -> None:
    port = Nothing()
    SenseBoard(port).send(BoardMode.NOMINAL, cooling=10)
    assert port.sent == [bytes((0xFF, 0x03, 0x29, 255 - (0x03 + 0x29), 0xFE))]
    with pytest.raises(ValueError, match="the cooling's strength is 0 to 10, and 11 is not"):
        command_bytes(BoardMode.IDLE, 11)


def test_silence() -> None:
    board = SenseBoard(Nothing())
    assert board.poll() == 0
    with pytest.raises(
        BusError, match="the sensor board at /dev/ttyACM0 sent 0 packets instead of"
    ):
        board.require("/dev/ttyACM0")


def test_a_poll_takes_all_that_came_and_the_last_counts() -> None:
    class Full(Nothing):
        """A port on which more than a second of packets waits."""

        waiting = b"".join(packet((0.0, 0.0, float(k), 0.0, 0.0, 0.0), 0x80) for k in range(80))

        def read(self, size: int = 1) -> bytes:
            assert size > 0
            part, self.waiting = self.waiting[:size], self.waiting[size:]
            return part

    board = SenseBoard(Full())
    assert board.poll() == 64 and board.specific_force[2] == 63.0
    assert board.poll() == 16 and board.specific_force[2] == 79.0
    assert board.poll() == 0 and board.packets == 80
    assert (board.skipped, board.damaged, board.calibrations) == (0, 0, 0)
    board.require("here", 80)
    with pytest.raises(BusError, match="sent 80 packets instead of 81"):
        board.require("here", 81)


def test_what_belongs_to_no_packet_is_counted() -> None:
    board = SenseBoard(Nothing())
    assert board.feed(b"\x00\x01\x02" + packet(NUMBERS, 0x80)) == 1
    assert (board.skipped, board.damaged) == (3, 0)
    hurt = bytearray(packet(NUMBERS, 0x80))
    hurt[10] ^= 1
    assert board.feed(bytes(hurt) + packet(NUMBERS, 0x80)) == 1
    assert board.damaged == 1 and board.skipped == 3 + PACKET


def test_mounted_sensors_may_fill_the_packet_and_no_more() -> None:
    sensor: Any = SimpleNamespace(name="sole", signal=ImuReading)
    sensor.packet_size = lambda: LONGEST - LENGTH
    SenseBoard(Nothing(), [sensor])
    sensor.packet_size = lambda: LONGEST - LENGTH + 1
    with pytest.raises(BusError, match=f"{LONGEST - LENGTH + 1} bytes of mounted sensors is too"):
        SenseBoard(Nothing(), [sensor])
