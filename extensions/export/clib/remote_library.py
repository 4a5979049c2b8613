"""A library in a process of its own, ``main.c`` of ``aloft export c``, seen over shared memory."""

from __future__ import annotations

import ctypes
import mmap
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ....runtime.language.errors import AloftError
from .library import views

_MARK = 0x31545241
_HEAD = np.dtype(
    [
        ("mark", "<u4"), ("lockstep", "<i4"), ("graph_hash", "S64"), ("input_bytes", "<i8"),
        ("output_bytes", "<i8"), ("status", "<i4"), ("block", "<i4"), ("ticks", "<i8"), ("missed", "<i8"),
        ("worst_ns", "<i8"), ("given", "<u8"), ("found", "<u8"), ("inputs_ready", "u1", 64),
        ("outputs_ready", "u1", 64),
    ]
)  # fmt: skip
"""The struct ``shared`` of ``real_time.c``."""
PATIENCE = 5.0
"""Seconds within which the process has to answer."""
_SLICE = 0.2


class RemoteSharedLibrary:
    """The side of the graph of a library that runs in a process of its own.

    In lockstep a step waits for the outputs of its inputs. In real time it gives its inputs, and takes
    the newest outputs that are there; only the first step waits for some.

    Args:
        about: the library's description.
        memory: the file that the process has made.

    Attributes:
        inputs, outputs: as of ``SharedLibrary``.

    Raises:
        AloftError: there is no such process, or it runs another library.
    """

    def __init__(self, about: Mapping[str, Any], memory: Path) -> None:
        self.about, self._memory = about, memory
        try:
            with memory.open("r+b") as file:
                self._map = mmap.mmap(file.fileno(), 0)
        except (OSError, ValueError) as error:
            raise AloftError(
                f"no process shares {memory}: {error}; start the program main of the library first"
            ) from error
        raw = np.frombuffer(self._map, np.uint8)
        if raw.size < _HEAD.itemsize:
            raise AloftError(f"{memory} is no memory of a library's program main")
        self._head: Any = raw[: _HEAD.itemsize].view(_HEAD)
        sizes = int(about["input_bytes"]), int(about["output_bytes"])
        place = _HEAD.itemsize + -(-sizes[0] // 64) * 64
        if self._head["mark"][0] != _MARK or raw.size < place + sizes[1]:
            raise AloftError(f"{memory} is no memory of a library's program main")
        if self._head["graph_hash"][0] != about["graph_hash"].encode():
            raise AloftError(
                f"the process that shares {memory} runs another library than {about['name']}"
            )
        given, found = (
            raw[_HEAD.itemsize : _HEAD.itemsize + sizes[0]],
            raw[place : place + sizes[1]],
        )
        self._lockstep = bool(self._head["lockstep"][0])
        # in real time the arrays that the block knows are copied whole, between two counts
        self._pairs = [] if self._lockstep else [(given.copy(), given), (found.copy(), found)]
        own_given, own_found = (
            (given, found) if self._lockstep else (self._pairs[0][0], self._pairs[1][0])
        )
        self.inputs = views(own_given, about["inputs"])
        self.outputs = views(own_found, about["outputs"])
        self._given, self._found = self._head["given"], self._head["found"]
        self._status = self._head["status"]
        libc: Any = ctypes.CDLL(None, use_errno=True)
        self._post, self._wait = libc.sem_post, libc.sem_timedwait
        self._wait.argtypes = ctypes.c_void_p, ctypes.c_void_p
        self._ready, self._done = (
            ctypes.c_void_p(self._head[key].ctypes.data)
            for key in ("inputs_ready", "outputs_ready")
        )

    def step(self) -> int:
        """Make one tick, or in real time one exchange. Returns the status of the last tick.

        Raises:
            AloftError: the process does not answer.
        """
        if self._lockstep:
            self._post(self._ready)
            end = time.monotonic() + PATIENCE
            # the semaphore knows only the wall clock, which may be set, so it waits in short slices
            until = time.time() + _SLICE
            while self._wait(self._done, (ctypes.c_int64 * 2)(int(until), int(until % 1.0 * 1e9))):
                if time.monotonic() > end:
                    self._fail()
                until = time.time() + _SLICE
            return int(self._status[0])
        (own_given, given), (own_found, found) = self._pairs
        self._given += 1
        given[:] = own_given
        self._given += 1
        end = time.monotonic() + PATIENCE
        while True:
            before = int(self._found[0])
            if before and before % 2 == 0:
                own_found[:] = found
                if int(self._found[0]) == before:
                    return int(self._status[0])
            if time.monotonic() > end:
                self._fail()
            time.sleep(0.0)

    def _fail(self) -> None:
        raise AloftError(
            f"the process that shares {self._memory} does not answer within {PATIENCE:g} s"
        )

    def last_block(self) -> str:
        """Return the block that the last status is about."""
        number = int(self._head["block"][0])
        return str(self.about["blocks"][number]) if number >= 0 else ""

    @property
    def counts(self) -> tuple[int, int, float]:
        """Ticks, missed deadlines, and the longest time of a tick from the start of its period [s]."""
        head = self._head
        return int(head["ticks"][0]), int(head["missed"][0]), float(head["worst_ns"][0]) * 1e-9
