"""Starts the process that ends a run which is held by compiled code; see ``freeze_process``."""

from __future__ import annotations

import faulthandler
import json
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

from ..language.stages import CheckedGraph
from .failures import INSTALLED
from .memory import BoundGraph

BEATS = 4
"""Beats in every limit of time."""


class FreezeGuard:
    """A sink that lets a process watch over this one, from the start of the blocks to their end.

    Use it in a ``with`` statement, within which the signal SIGUSR1 writes the stacks of all threads.

    Args:
        graph: what runs; its blocks are named, and its clock says after how long a call hangs.
        as_json: whether the process prints a JSON object, too, when it ends this one.
    """

    def __init__(self, graph: CheckedGraph, *, as_json: bool = False) -> None:
        self._graph = graph
        limit = graph.clock.hangs_after
        program = Path(__file__).with_name("freeze_process.py")
        command = [sys.executable, "-I", "-S", str(program), str(os.getpid()), str(limit)]
        self._process = subprocess.Popen([*command, str(int(as_json))], stdin=subprocess.PIPE)
        assert self._process.stdin is not None
        self._pipe = self._process.stdin
        self._over = threading.Event()
        self._beats = threading.Thread(
            target=self._beat, args=(limit / BEATS,), name="beats", daemon=True
        )

    def __enter__(self) -> Self:
        faulthandler.register(signal.SIGUSR1, self._pipe, all_threads=True)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
        self._process.wait()

    def open(self, bound: BoundGraph) -> None:
        """Let the process begin to watch: setting blocks up may have taken any time."""
        with suppress(OSError):  # it could not start; the run goes on without it
            self._pipe.write(json.dumps(_told(self._graph)).encode() + b"\n")
            self._pipe.flush()
        self._beats.start()

    def record(self, tick: int) -> None:
        """Nothing to record: the beats come from a thread of their own."""

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


def _told(graph: CheckedGraph) -> dict[str, object]:
    """What names a block from a stack: the file and the class of each."""
    blocks = []
    for spec in graph.blocks:
        module = sys.modules.get(spec.block_type.__module__)
        blocks.append((spec.path, getattr(module, "__file__", "") or "", spec.block_type.__name__))
    return {"graph": graph.name, "blocks": blocks, "installed": list(INSTALLED)}
