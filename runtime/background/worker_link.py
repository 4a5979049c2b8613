"""A worker as the control thread sees it: started, given jobs, waited for where time is virtual, and ended."""

from __future__ import annotations

import json
import os
import pickle
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from select import select
from time import monotonic
from typing import Any

from ...processes.child_process import ChildError, ChildProcess
from ..language.block import Metric
from ..language.context import Clock, Context
from ..language.errors import AloftError
from ..language.parameters import Parameters
from .job_memory import JobMemory
from .worker import BELL, CHANGE, MESSAGE, RESTORE, WAKE, WorkerTask, main

START_TIME = 900.0
"""Seconds that a worker may take to be ready: it may have to compile its block's kernels first, or the planner's functions
of a new robot, which takes minutes where others need the processor, too. That it has died is noticed at once."""
LOOK_EVERY, LOOK_SHARE = 1e-3, 0.02
"""Seconds after which a worker in real time looks for jobs, at most, and as a share of the latency."""


class WorkerError(AloftError):
    """A worker has died, or hangs."""


def parameter_text(params: Parameters) -> str:
    """Parameters as JSON that reads back as the same."""
    return params.model_dump_json(round_trip=True, by_alias=True)


class WorkerLink:
    """A worker's process, and the memory that it shares with this one.

    Args:
        use: the block, as a graph file names it.
        params: its parameters.
        context: of the block.
        slots, inputs, results: see ``JobMemory``.
        in_real_time: whether the control thread must not lose its processor to the worker.

    Attributes:
        memory: the shared memory.
        has_failed: whether it has died or hangs, so that nothing more comes from it.

    Raises:
        WorkerError: it does not start.
    """

    def __init__(
        self,
        use: str,
        params: Parameters,
        context: Context,
        slots: int,
        inputs: int,
        results: int,
        *,
        in_real_time: bool,
    ) -> None:
        self.has_failed = False
        self._wakes = not in_real_time
        self._job = 0
        latency = slots * context.period
        look_every = min(LOOK_EVERY, LOOK_SHARE * latency) if in_real_time else None
        clock = Clock(context.clock.base_period, context.clock.tick)
        shared = JobMemory.make(slots, inputs, results)
        self._answers, theirs = os.pipe()
        try:
            os.set_blocking(theirs, False)
            task = WorkerTask(
                use, parameter_text(params), replace(context, clock=clock), shared, theirs, slots,
                inputs, results, look_every,
            )  # fmt: skip
            self._process = ChildProcess(
                f"the worker of {context.path}", f"{main.__module__}:main",
                descriptors=[shared, theirs],
            )  # fmt: skip
            self.memory = JobMemory(shared, slots, inputs, results)
        finally:
            os.close(theirs)
            os.close(shared)
        self._process.name = f"its worker (process {self._process.pid})"
        self._requests = self._process.stdin.fileno()
        self._message = bytearray(MESSAGE.size)
        try:
            self._process.stdin.write(pickle.dumps(task))
            self._process.stdin.flush()
            self._process.wait_until_ready(START_TIME)
        except OSError as error:
            raise WorkerError(str(self._process.failure())) from error
        except ChildError as error:
            self.kill()
            raise WorkerError(str(error)) from error

    def ask(self, slot: int, tick: int) -> int:
        """Ask for the job whose inputs, sampled in that tick, are in a slot. Returns its number."""
        self._job += 1
        self.memory.ask(slot, self._job, tick)
        if self._wakes:
            self._send(WAKE)
        return self._job

    def restore(self, *, with_outputs: bool) -> None:
        """Let the worker go on from the last slot, with the jobs that are requested after this."""
        self._send(RESTORE, int(with_outputs))

    def change(self, params: Parameters) -> None:
        """Change the worker's parameters, for the jobs that are requested after this."""
        text = parameter_text(params).encode()
        self._send(CHANGE, len(text), text)

    def _send(self, kind: int, number: int = 0, text: bytes = b"") -> None:
        MESSAGE.pack_into(self._message, 0, kind, self._job + 1, number)
        with suppress(OSError):  # it has died: that is an error when its result is due
            os.write(self._requests, self._message + text if text else self._message)

    def wait_for(self, slot: int, job: int, seconds: float) -> None:
        """Wait until a job is finished.

        Raises:
            WorkerError: the worker has died, or the job takes longer.
        """
        end, is_finished = monotonic() + seconds, self.memory.is_finished
        while not is_finished(slot, job):
            left = end - monotonic()
            if left <= 0.0:
                raise self.hang(slot, seconds)
            if select([self._answers], [], [], left)[0] and not os.read(self._answers, 1 << 16):
                if is_finished(slot, job):
                    return  # it died afterwards
                raise self.death(slot)

    def expect_alive(self, slot: int) -> None:
        """Raise ``WorkerError`` if the worker has died before it finished the job of a slot."""
        if not self._process.is_alive():
            raise self.death(slot)

    def death(self, slot: int) -> WorkerError:
        """Return the error of a worker that has died, with the cause."""
        self.has_failed = True
        return WorkerError(f"{self._process.failure()}, in the run of {self._sampled(slot)}")

    def hang(self, slot: int, seconds: float) -> WorkerError:
        """Return the error of a worker that does not finish a job."""
        self.has_failed = True
        return WorkerError(
            f"{self._process.name} hangs in the run of {self._sampled(slot)}: it did not finish it "
            f"within {seconds:g} s (clock.hangs_after allows longer)"
        )

    def _sampled(self, slot: int) -> str:
        return f"tick {self.memory.tick_of(slot)}"

    def end(self, seconds: float) -> tuple[Mapping[str, Metric], Sequence[str]] | None:
        """Let the worker close its block and end.

        Returns:
            The block's metrics and warnings; none where the worker computes for longer than that, and
            is killed.

        Raises:
            WorkerError: it fails.
        """
        with suppress(OSError):
            self._process.stdin.close()
        end, said, has_ended = monotonic() + seconds, b"", False
        while not has_ended and (left := end - monotonic()) > 0.0:
            if select([self._answers], [], [], left)[0]:
                piece = os.read(self._answers, 1 << 16)
                said += piece
                has_ended = not piece
        answer: dict[str, Any] | None = None
        with suppress(ValueError):
            answer = json.loads(said.lstrip(BELL))
        failure = self._process.failure() if has_ended and answer is None else None
        self.kill()
        if failure is not None:
            raise WorkerError(str(failure))
        return (answer["metrics"], answer["warnings"]) if answer is not None else None

    def kill(self) -> None:
        """End the process, whatever it does."""
        self.has_failed = True
        self._process.stop()
        with suppress(OSError):
            os.close(self._answers)
