"""The ring: whatever the sizes and the pace, records come out as they went in, or not at all."""

import os
import threading
from collections import deque
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aloft.logs.recording.ring import CONTROL, RingReader, RingWriter, make_memory, space_of

CAPACITY = 1024


def pair(capacity: int = CAPACITY) -> tuple[RingWriter, RingReader]:
    descriptor = make_memory(capacity)
    try:
        return RingWriter(descriptor, capacity), RingReader(descriptor, capacity)
    finally:
        os.close(descriptor)


@pytest.fixture
def ring() -> Iterator[tuple[RingWriter, RingReader]]:
    writer, reader = pair()
    yield writer, reader
    writer.close()
    reader.close()


def taken(reader: RingReader, most: int = 1000) -> list[tuple[int, int, bytes]]:
    found = []
    for record in reader.records():
        found.append((record.kind, record.tick, bytes(record.data)))
        if len(found) == most:
            break
    return found


@settings(max_examples=60, deadline=None)
@given(st.lists(st.one_of(st.integers(0, 500), st.none()), max_size=60))
def test_what_goes_in_comes_out(steps: list[int | None]) -> None:
    """A number writes so many bytes, nothing reads; never is a record lost, cut or mixed up."""
    writer, reader = pair()
    waiting: deque[tuple[int, int, bytes]] = deque()
    for tick, step in enumerate(steps):
        if step is None:
            assert taken(reader) == list(waiting)
            waiting.clear()
        else:
            record = (1 + tick % 3, tick, bytes([tick % 251]) * step)
            if writer.write(*record):
                waiting.append(record)
            else:  # only ever refused when it, and what may be left of the ring's end, do not fit
                used = writer.written - reader.read_back
                assert used + 2 * space_of(step) > CAPACITY
        assert 0 <= writer.written - reader.read_back <= CAPACITY
    assert taken(reader) == list(waiting)
    writer.close()
    reader.close()


def test_a_full_ring_refuses_until_there_is_room(ring: tuple[RingWriter, RingReader]) -> None:
    writer, reader = ring
    accepted = 0
    while writer.write(1, accepted, bytes(200)):
        accepted += 1
    assert accepted == CAPACITY // space_of(200)
    assert not writer.write(1, 99, bytes(200))
    records = reader.records()
    assert next(records).tick == 0
    assert not writer.write(1, 99, bytes(200))  # still being read
    assert next(records).tick == 1
    assert writer.write(1, 99, bytes(200))
    records.close()
    assert [tick for _, tick, _ in taken(reader)] == [*range(1, accepted), 99]


def test_a_record_that_is_not_all_there_is_not_believed(
    ring: tuple[RingWriter, RingReader],
) -> None:
    """As on a processor that shows the counter before what it counts."""
    writer, reader = ring
    writer.write(1, 5, b"first")
    writer.write(1, 6, b"second")
    place = space_of(6) + space_of(6) - 8  # the second's last sequence number
    right = bytes(writer._bytes[place : place + 8])
    writer._bytes[place : place + 8] = bytes([255]) * 8
    assert [tick for _, tick, _ in taken(reader)] == [5]
    assert taken(reader) == []
    writer._bytes[place : place + 8] = right
    assert taken(reader) == [(1, 6, b"second")]


def test_a_writer_and_a_reader_at_once() -> None:
    writer, reader = pair(1 << 14)
    count = 3_000
    found: list[int] = []
    wrong: list[int] = []

    def read() -> None:
        while len(found) < count:
            for record in reader.records():
                expected = bytes([record.tick % 256]) * (record.tick % 300)
                if bytes(record.data) != expected:
                    wrong.append(record.tick)
                found.append(record.tick)

    thread = threading.Thread(target=read)
    thread.start()
    for tick in range(count):
        while not writer.write(1, tick, bytes([tick % 256]) * (tick % 300)):
            pass
    thread.join(60)
    assert found == list(range(count))
    assert not wrong
    writer.close()
    reader.close()


def test_the_size_must_be_aligned() -> None:
    descriptor = make_memory(1000)
    with pytest.raises(ValueError, match="1000 is no multiple of 64"):
        RingWriter(descriptor, 1000)
    os.close(descriptor)
    assert CONTROL % 64 == 0
