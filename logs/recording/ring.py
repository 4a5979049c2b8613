"""A ring of records in shared memory: one process writes, another reads, neither waits.

A record is a head of six int64 (sequence number, kind, bytes, tick, two spare), its bytes, and the
sequence number again; it starts at a multiple of 64. Two counters of bytes, each alone in a cache
line, say how far the writer and the reader are; each side writes only its own.

Memory order: a counter is one aligned store of eight bytes, made after what it speaks of. On x86
stores are seen in that order anyway. For processors such as ARM, where they may not be, a lock
that nobody contends for is taken and given back in between, which POSIX says synchronises memory
(as does the atomic operation CPython uses where it has one). The reader does the same between
reading the counter and reading records, and besides believes no record whose two sequence numbers
are not the one that is due.

The memory has no name, see ``runtime.running.snapshot.nameless_memory``: the reader keeps what a writer that
is killed had written.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from dataclasses import dataclass
from struct import Struct
from threading import Lock

import numpy as np

try:
    import resource
except ImportError:  # on Windows, which limits no sizes
    resource = None  # type: ignore[assignment]  # not on Windows

from ...runtime.running.snapshot import nameless_memory

ALIGNMENT = 64
CONTROL = 256
"""Bytes before the records: the writer's counter, and at 64 the reader's."""
_HEAD = Struct("@qqqqqq")
_TAIL = Struct("@q")
_SKIP = 0
"""The kind of a record that only fills the ring up to its end."""


def make_memory(capacity: int) -> int:
    """Open nameless memory for a ring of ``capacity`` bytes and return its file descriptor."""
    return nameless_memory(CONTROL + capacity, "aloft-ring")


def fitting_capacity(wanted: int, least: int) -> int:
    """Return the capacity of a ring, ``wanted`` or more where nothing limits it.

    A limit on the size of files (``ulimit -f``) holds for shared memory as well. Then the ring is as
    large as it may be, but not below ``least``: a smaller one could not do its work.
    """
    capacity = max(wanted, least)
    if resource is not None:
        limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
        if limit != resource.RLIM_INFINITY and CONTROL + capacity + ALIGNMENT > limit:
            capacity = max(least, limit - CONTROL - ALIGNMENT)
    return capacity + -capacity % ALIGNMENT


class _Ring:
    """The mapped memory that both sides share."""

    def __init__(self, descriptor: int, capacity: int) -> None:
        if capacity % ALIGNMENT:
            raise ValueError(f"{capacity} is no multiple of {ALIGNMENT}")
        self.capacity = capacity
        self._map = mmap.mmap(descriptor, CONTROL + capacity)
        self._view = memoryview(self._map)
        self._counters = self._view[:CONTROL].cast("q")
        self._bytes = self._view[CONTROL:]
        self._fence = Lock()

    @property
    def written(self) -> int:
        """The number of bytes that the writer has written since the beginning."""
        return self._counters[0]

    @property
    def read_back(self) -> int:
        """The number of bytes that the reader has finished with since the beginning."""
        return self._counters[8]

    def close(self) -> None:
        """Unmap the memory. It is freed when both sides have done so."""
        self._counters.release()
        self._bytes.release()
        self._view.release()
        self._map.close()


def space_of(size: int) -> int:
    """Return the bytes in the ring of a record with ``size`` bytes."""
    return -(-(_HEAD.size + size + _TAIL.size) // ALIGNMENT) * ALIGNMENT


class RingWriter(_Ring):
    """The writing side of the ring."""

    def __init__(self, descriptor: int, capacity: int) -> None:
        super().__init__(descriptor, capacity)
        pages = np.frombuffer(self._bytes, np.uint8)[:: mmap.PAGESIZE]
        pages[:] = 0  # touch every page now, not while the robot moves
        del pages
        self._head = self._known_tail = self._sequence = 0

    def write(self, kind: int, tick: int, data: memoryview | bytes | bytearray) -> bool:
        """Write a record of a ``kind`` from one on, or, if there is no room, do nothing.

        Returns:
            Whether there was room.
        """
        size = len(data)
        space = -(-(56 + size) // 64) * 64
        head, capacity = self._head, self.capacity
        place = head % capacity
        rest = capacity - place
        needed = space if space <= rest else rest + space
        if head + needed - self._known_tail > capacity:
            self._known_tail = self._counters[8]
            if head + needed - self._known_tail > capacity:
                return False
        if space > rest:
            self._put(place, _SKIP, 0, b"", rest)
            place = 0
        sequence = self._sequence
        flat = self._bytes
        _HEAD.pack_into(flat, place, sequence, kind, size, tick, 0, 0)
        flat[place + 48 : place + 48 + size] = data
        _TAIL.pack_into(flat, place + space - 8, sequence)
        self._sequence = sequence + 1
        self._head = head = head + needed
        with self._fence:
            pass
        self._counters[0] = head
        return True

    def _put(self, place: int, kind: int, tick: int, data: bytes, space: int) -> None:
        _HEAD.pack_into(self._bytes, place, self._sequence, kind, len(data), tick, 0, 0)
        _TAIL.pack_into(self._bytes, place + space - 8, self._sequence)
        self._sequence += 1


@dataclass(frozen=True)
class RingRecord:
    """One record; ``data`` is a view of the ring that is valid until the next one is requested."""

    kind: int
    tick: int
    data: memoryview


class RingReader(_Ring):
    """The side that reads."""

    def __init__(self, descriptor: int, capacity: int) -> None:
        super().__init__(descriptor, capacity)
        self._tail = self._sequence = 0

    def records(self) -> Iterator[RingRecord]:
        """Yield all records there are now, each given back to the writer when the next is asked
        for."""
        head = self._counters[0]
        with self._fence:
            pass
        while self._tail < head:
            place = self._tail % self.capacity
            sequence, kind, size, tick, _, _ = _HEAD.unpack_from(self._bytes, place)
            rest = self.capacity - place
            space = rest if kind == _SKIP else space_of(size)
            if sequence != self._sequence or not 0 < space <= rest:
                return  # not to be seen yet
            if _TAIL.unpack_from(self._bytes, place + space - _TAIL.size)[0] != sequence:
                return
            if kind != _SKIP:
                data = self._bytes[place + _HEAD.size : place + _HEAD.size + size]
                yield RingRecord(kind, tick, data)
                data.release()
            self._sequence += 1
            self._tail += space
            with self._fence:
                pass
            self._counters[8] = self._tail
