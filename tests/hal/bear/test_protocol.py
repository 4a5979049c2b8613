"""Frames of the BEAR bus: published examples, round trips, and whatever else may arrive."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aloft.hal.bear.protocol import (
    BROADCAST,
    CONFIG,
    STATUS,
    BusFrame,
    FrameReader,
    Instruction,
    checksum,
    frame_bytes,
)

DEVICES = st.integers(0, 0xFC) | st.just(BROADCAST)
FRAMES = st.builds(BusFrame, DEVICES, st.integers(0, 255), st.binary(max_size=253))


def bytes_of(frame: BusFrame) -> bytes:
    return frame_bytes(frame.device, frame.code, frame.data)


def test_published_frames() -> None:
    # write goal_position 11.0 to actuator 2; ping actuator 1
    golden = bytes.fromhex("FFFF02070305000030417D")
    assert frame_bytes(2, Instruction.WRITE_STATUS, bytes.fromhex("0500003041")) == golden
    assert frame_bytes(1, Instruction.PING) == bytes.fromhex("FFFF010201FB")
    assert checksum(golden[2:-1]) == 0x7D


@given(st.lists(FRAMES, max_size=5), st.integers(1, 17))
def test_frames_round_trip_in_any_pieces(frames: list[BusFrame], piece: int) -> None:
    stream = b"".join(map(bytes_of, frames))
    reader = FrameReader()
    found = []
    for start in range(0, len(stream), piece):
        found += reader.feed(stream[start : start + piece])
    assert found == frames
    assert reader.skipped == reader.damaged == 0


@given(FRAMES, st.data())
def test_a_changed_byte_is_never_taken_for_the_same_frame(
    frame: BusFrame, data: st.DataObject
) -> None:
    good = bytearray(bytes_of(frame))
    place = data.draw(st.integers(0, len(good) - 1))
    good[place] ^= data.draw(st.integers(1, 255))
    assert frame not in FrameReader().feed(bytes(good))


@given(st.binary(max_size=40), FRAMES)
def test_the_reader_never_keeps_more_than_one_frame(noise: bytes, frame: BusFrame) -> None:
    reader = FrameReader()
    reader.feed(noise)
    reader.clear()
    assert reader.feed(bytes_of(frame)) == [frame]


@given(FRAMES)
def test_a_frame_behind_garbage_is_found(frame: BusFrame) -> None:
    # 00 00 can begin no frame, so the garbage cannot swallow what follows it
    reader = FrameReader()
    assert reader.feed(b"\xff\x07\x00\x00" + bytes_of(frame)) == [frame]
    assert reader.skipped == 4


@pytest.mark.parametrize(
    ("device", "data", "message"),
    [
        (0xFD, b"", "253 is no address on the bus: those are 0 to 252, and 254 for all"),
        (1, bytes(254), "a frame holds at most 253 bytes of data, and these are 254; send several"),
    ],
)
def test_what_is_no_frame(device: int, data: bytes, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        frame_bytes(device, Instruction.PING, data)


def test_registers_have_addresses_of_their_own_and_gains_stand_side_by_side() -> None:
    for area in (STATUS, CONFIG):
        addresses = [register.address for register in area.values()]
        assert len(set(addresses)) == len(addresses) and min(addresses) >= 0
    for loop in ("id", "iq", "velocity", "position", "direct_force"):
        p, i, d = (CONFIG[f"{letter}_gain_{loop}"] for letter in "pid")
        assert (i.address - p.address, d.address - p.address) == (1, 2)
        for register in (p, i, d):
            assert register.least == 0.0 <= register.default < register.most and register.writable


@pytest.mark.parametrize("name", ["goal_iq", "goal_position"])
@pytest.mark.parametrize("value", [0.0, 1.5, -2.25])
def test_a_registers_value_is_four_bytes_there_and_back(name: str, value: float) -> None:
    data = STATUS[name].pack(value)
    assert len(data) == 4 and STATUS[name].unpack(data) == value


@pytest.mark.parametrize("value", [-1, 1.5])
def test_whole_numbers_take_nothing_else(value: float) -> None:
    assert STATUS["torque_enable"].unpack(STATUS["torque_enable"].pack(3)) == 3
    with pytest.raises(ValueError, match="torque_enable is a whole number from 0"):
        STATUS["torque_enable"].pack(value)
