"""Starts the process that ends a run which is held by compiled code; see ``freeze_process``."""

from __future__ import annotations

import faulthandler
import json
import os
import signal
import sys
import threading
from contextlib import suppress
from mmap import mmap
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.fingerprint import closure
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.compiling.kernel_registry import written_code
from ...processes.child_process import ChildProcess
from ..language.extensions import is_own
from ..language.stages import CheckedGraph
from .failures import INSTALLED
from .memory import BoundGraph
from .sink import Sink
from .snapshot import nameless_memory

BEATS = 4
"""Beats in every limit of time."""
ENDING = 10.0
"""Seconds that the process has to end after the run; it may be waiting for stacks."""


class FreezeGuard(Sink):
    """A sink that lets a process watch over this one, from the start of the blocks to their end.

    Use it in a ``with`` statement, within which the signal SIGUSR1 writes the stacks of all
    threads.

    Args:
        graph: what runs; its blocks are named, and its clock sets the time after which a call hangs.
        as_json: whether the process prints a JSON object, too, when it ends this one.
    """

    def __init__(self, graph: CheckedGraph, *, as_json: bool = False) -> None:
        self._graph = graph
        limit = graph.clock.hangs_after
        program = Path(__file__).with_name("freeze_process.py")
        shared, self._running = _shared_number()
        self._process = ChildProcess(
            "the process that watches for a hang", program,
            [str(os.getpid()), str(limit), str(int(as_json)), str(shared)],
            descriptors=[shared] if shared >= 0 else [],
        )  # fmt: skip
        if shared >= 0:
            os.close(shared)
        self._pipe = self._process.stdin
        self._over = threading.Event()
        self._beats = threading.Thread(
            target=self._beat, args=(limit / BEATS,), name="beats", daemon=True
        )

    def __enter__(self) -> Self:
        faulthandler.register(signal.SIGUSR1, self._pipe, all_threads=True)
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
        self._process.stop(asked=ENDING)

    def open(self, bound: BoundGraph) -> None:
        """Let the process begin to watch: setting blocks up may have taken any time. From now on it
        sees which block of a chain runs."""
        self._running[:] = bound.running
        bound.running = self._running
        with suppress(OSError):  # it could not start; the run goes on without it
            about = {**_describe_graph(self._graph), "kernels": _users_kernels(self._graph, bound)}
            self._pipe.write(json.dumps(about).encode() + b"\n")
            self._pipe.flush()
        self._beats.start()

    def close(self) -> None:
        """End the beats, once nothing can hang any more."""
        self._over.set()
        if self._beats.ident is not None:
            self._beats.join()
        faulthandler.unregister(signal.SIGUSR1)
        with suppress(OSError):
            self._pipe.close()

    def _beat(self, period: float) -> None:
        while not self._over.wait(period):
            with suppress(OSError):
                os.write(self._pipe.fileno(), b".")


def _shared_number() -> tuple[int, NDArray[np.int64]]:
    """Allocate an integer that another process can read, (1,), and return the file of its memory
    with it; where the system has none, memory of this process, and -1."""
    try:
        file = nameless_memory(8, "aloft-running")
        return file, np.frombuffer(mmap(file, 8), np.int64)
    except OSError:
        return -1, np.full(1, -1)


def _describe_graph(graph: CheckedGraph) -> dict[str, object]:
    """Describe the blocks: the file and the class of each, for stacks, and their order."""
    blocks = []
    for spec in graph.blocks:
        module = sys.modules.get(spec.block_type.__module__)
        blocks.append((spec.path, getattr(module, "__file__", "") or "", spec.block_type.__name__))
    about = {"graph": graph.name, "blocks": blocks, "installed": list(INSTALLED)}
    return {**about, "order": list(graph.order)}


def _users_kernels(graph: CheckedGraph, bound: BoundGraph) -> dict[str, list[tuple[str, int]]]:
    """Return the file and the first line of the kernels of each user's block, and of those that they call:
    compiled code has no stack to read. Loops of aloft's own kernels end."""
    found: dict[str, list[tuple[str, int]]] = {}
    for spec in graph.blocks:
        block = bound.blocks.get(spec.path)
        if block is None or is_own(spec.block_type.__module__):
            continue
        calls = (*getattr(block, "kernel_calls", ()), *getattr(block, "update_calls", ()))
        codes = [
            written_code(function)
            for call in calls
            if isinstance(call, KernelCall)
            for function in closure(call.kernel)
            if not is_own(function.__module__)
        ]
        found[spec.path] = [(code.co_filename, code.co_firstlineno) for code in codes]
    return found
