"""The memory that a background block shares with its worker: inputs one way, results the other.

There is one slot for every run that may be under way. The control thread writes the inputs into a slot
and numbers the job; the worker writes the result, and then that number beside it. So a slot
holds the result of the job asked for exactly if both numbers are equal, and neither side waits. One more
slot holds the outputs and states with which the worker is to go on.

Memory order: a number is one aligned store, made after what it speaks of; see ``logs.recording.ring``,
which fences in the same way.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterable, Sequence
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..running.snapshot import nameless_memory

Copies = list[tuple[memoryview, memoryview]]
"""Targets and sources, of equal sizes."""
LONGEST_TEXT = 448
"""Bytes of the reason for which a block ends a run."""
_LINE = 64
_WORDS = 8
_JOB, _TICK, _DONE, _TIME, _LENGTH = 0, 1, 0, 1, 2
"""The words of a slot: two that the control thread writes, three that the worker does."""


def rounded(size: int) -> int:
    """Round a number of bytes up to whole cache lines."""
    return -(-size // _LINE) * _LINE


def record_size(arrays: Iterable[NDArray[Any]]) -> int:
    """Return the size [bytes] of a record of some arrays."""
    return rounded(sum(-(-array.nbytes // 8) * 8 for array in arrays))


class JobMemory:
    """One side's view of the shared memory.

    Args:
        descriptor: of the memory.
        slots: how many jobs may be under way.
        inputs: the bytes of a record of inputs.
        results: the bytes of a record of outputs and states.
    """

    def __init__(self, descriptor: int, slots: int, inputs: int, results: int) -> None:
        self.slots = slots
        line = rounded(8 * _WORDS)
        sizes = (line, line, LONGEST_TEXT, inputs, results)
        raw = mmap.mmap(descriptor, (slots + 1) * sum(map(rounded, sizes)))
        octets = np.frombuffer(raw, np.uint8)
        first, parts = 0, []
        for size in map(rounded, sizes):
            parts.append(octets[first : first + (slots + 1) * size].reshape(slots + 1, size))
            first += (slots + 1) * size
        asked, done, self._texts, self._inputs, self._results = parts
        self._asked = asked.view(np.int64).data
        self._done = done.view(np.int64).data
        self._fence = Lock()

    @staticmethod
    def make(slots: int, inputs: int, results: int) -> int:
        """Create shared memory of this size and return its file descriptor."""
        line = rounded(8 * _WORDS)
        record = 2 * line + rounded(LONGEST_TEXT) + rounded(inputs) + rounded(results)
        return nameless_memory((slots + 1) * record, "aloft-background")

    def inputs(self, slot: int, like: Sequence[NDArray[Any]]) -> list[NDArray[Any]]:
        """Return the arrays of a record of inputs, of the types and shapes of ``like``."""
        return _split(self._inputs[slot], like)

    def results(self, slot: int, like: Sequence[NDArray[Any]]) -> list[NDArray[Any]]:
        """Return the arrays of a record of results; that of slot ``slots`` is what the worker goes
        on from."""
        return _split(self._results[slot], like)

    def ask(self, slot: int, job: int, tick: int) -> None:
        """Post the job whose inputs are in a slot. The numbers of jobs count from one and
        increase."""
        self._asked[slot, _TICK] = tick
        with self._fence:
            pass
        self._asked[slot, _JOB] = job

    def withdraw(self) -> None:
        """Leave out all jobs that have not begun."""
        for slot in range(self.slots):
            self._asked[slot, _JOB] = 0

    def next_job(self, last: int) -> tuple[int, int]:
        """Return the first job after ``last`` that was requested, and its slot; zeros if there is
        none."""
        jobs = np.asarray(self._asked)[: self.slots, _JOB]
        later = jobs[jobs > last]
        if not later.size:
            return 0, 0
        with self._fence:
            pass
        job = int(later.min())
        return job, int(np.argmax(jobs == job))

    def is_asked(self, slot: int, job: int) -> bool:
        """Return whether the slot still holds that job."""
        with self._fence:
            pass
        return self._asked[slot, _JOB] == job

    def tick_of(self, slot: int) -> int:
        """Return the tick in which the inputs were sampled."""
        return int(self._asked[slot, _TICK])

    def finish(self, slot: int, job: int, nanoseconds: int, stop_reason: str = "") -> None:
        """Say that the result of a job is in its slot, how long it took, and why the run is to end."""
        text = stop_reason.encode()[:LONGEST_TEXT]
        self._texts[slot, : len(text)] = np.frombuffer(text, np.uint8)
        self._done[slot, _TIME] = nanoseconds
        self._done[slot, _LENGTH] = len(text)
        with self._fence:
            pass
        self._done[slot, _DONE] = job

    def is_finished(self, slot: int, job: int) -> bool:
        """Return whether the slot holds the result of the job."""
        if self._done[slot, _DONE] != job:
            return False
        with self._fence:
            pass
        return True

    def duration(self, slot: int) -> int:
        """Return the duration [ns] of the job of a slot."""
        return int(self._done[slot, _TIME])

    def stop_reason(self, slot: int) -> str:
        """Return the job's reason to end the run; empty if its block has none."""
        length = self._done[slot, _LENGTH]
        return bytes(self._texts[slot, :length]).decode(errors="ignore") if length else ""


def _split(record: NDArray[np.uint8], like: Sequence[NDArray[Any]]) -> list[NDArray[Any]]:
    found, first = [], 0
    for array in like:
        part = record[first : first + array.nbytes]
        found.append(part.view(array.dtype).reshape(array.shape))
        first += -(-array.nbytes // 8) * 8
    return found


def copies(targets: Iterable[NDArray[Any]], sources: Iterable[NDArray[Any]]) -> Copies:
    """Prepare the arguments of ``copy`` for arrays of equal types and shapes."""
    pairs = zip(targets, sources, strict=True)
    return [(_octets(target), _octets(source)) for target, source in pairs if target.size]


def _octets(array: NDArray[Any]) -> memoryview:
    return array.reshape(-1).view(np.uint8).data


def copy(pairs: Copies) -> None:
    """Copy; no array is made."""
    for target, source in pairs:
        target[:] = source
