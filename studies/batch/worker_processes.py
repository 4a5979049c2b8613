"""Jobs done by processes of this machine; ``jobs`` is how others use it.

The standard library's pool breaks as a whole when one of its processes is killed, and hangs where
that happens while work is being cancelled. Here every process has a pipe of its own: what died is
known, replaced, and its job tried again.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from time import monotonic
from typing import Any

from ...runtime.language.errors import AloftError
from .jobs import JobResult, attempt

ATTEMPTS = 2
"""How often a job is begun at most where its process dies: a second time is its own fault."""
PATIENCE = 10.0
"""How long processes that are told to stop may take [s]."""
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Numbered = tuple[int, Any]


@dataclass
class _Worker:
    """One process, the pipe to it, and the job it is doing."""

    process: Any
    pipe: Connection
    ready: bool = False
    job: Numbered | None = None


def process_results(
    function: Callable[[Any], Any], jobs: Iterable[Any], count: int
) -> Generator[JobResult, None, None]:
    """See ``jobs.job_results``; ``count`` processes at most."""
    numbered = enumerate(jobs)
    again: deque[Numbered] = deque()
    begun: dict[int, int] = {}
    workers: list[_Worker] = []

    def next_job() -> Numbered | None:
        return again.popleft() if again else next(numbered, None)

    try:
        while True:
            for worker in workers:
                if worker.job is None and not _give(worker, next_job(), begun):
                    break
            while len(workers) < count and (job := next_job()) is not None:
                workers.append(_start(function))
                _give(workers[-1], job, begun)
            busy = {worker.pipe: worker for worker in workers if worker.job is not None}
            if not busy:
                return
            for pipe in wait(list(busy)):
                worker = busy[pipe]  # type: ignore[index]
                try:
                    said = worker.pipe.recv()
                except (EOFError, OSError):
                    workers.remove(worker)
                    reason, job = _buried(worker), worker.job
                    if job is not None and begun[job[0]] < ATTEMPTS:
                        again.append(job)
                    elif job is not None:
                        yield JobResult(job[0], None, reason)
                    continue
                if said is None:
                    worker.ready = True
                else:
                    worker.job = None
                    begun.pop(said[0], None)
                    yield JobResult(*said)
    finally:
        _stop(workers)


def _give(worker: _Worker, job: Numbered | None, begun: dict[int, int]) -> bool:
    """Let a worker begin a job; whether there was one."""
    if job is None:
        return False
    worker.job = job
    begun[job[0]] = begun.get(job[0], 0) + 1
    with suppress(OSError):  # it died while it had nothing to do, which reading from it will tell
        worker.pipe.send(job)
    return True


def _start(function: Callable[[Any], Any]) -> _Worker:
    # Spawned, not forked: no state of this process reaches a job.
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(there, function), daemon=True)
    with _surroundings():
        process.start()
    there.close()  # or its end would not be noticed
    return _Worker(process, here)


@contextmanager
def _surroundings() -> Iterator[None]:
    """What a new process inherits: one thread for its linear algebra, because as many as there are
    processors would fight each other, and no SIGINT, which a terminal sends to all processes and
    is this one's to deal with."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    # It would otherwise be started by the new process's start and let SIGINT through.
    resource_tracker.ensure_running()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _buried(worker: _Worker) -> str:
    """Why a process is no more.

    Raises:
        AloftError: it could not even start, as no other would.
    """
    worker.pipe.close()
    worker.process.join(PATIENCE)
    code = worker.process.exitcode
    if not worker.ready and code is not None and code > 0:
        raise AloftError(
            "a worker process cannot start: its own message is above; a script that is run needs "
            "'if __name__ == \"__main__\":' around what it does"
        )
    if code is not None and code < 0:
        return f"its process was killed by {signal.Signals(-code).name}, {ATTEMPTS} times"
    return f"its process ended with exit code {code}, {ATTEMPTS} times"


def _stop(workers: list[_Worker]) -> None:
    """End all processes: at once where they wait, soon where they work."""
    for worker in workers:
        worker.pipe.close()
        if worker.job is not None:
            worker.process.terminate()
    end = monotonic() + PATIENCE
    for worker in workers:
        worker.process.join(max(0.0, end - monotonic()))
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()


class _StoppedError(BaseException):
    """In a worker: told to stop."""


_told_to_stop = False


def _serve(pipe: Connection, function: Callable[[Any], Any]) -> None:
    """The life of a worker: one job after another until the pipe is closed.

    SIGTERM ends the job under way as an exception does, so that it can clean up; a graph that runs
    takes the signal itself, and its robot comes to rest.
    """
    try:
        signal.signal(signal.SIGTERM, _told)
        threading.Thread(target=_follow_parent, daemon=True).start()
        pipe.send(None)
        while not _told_to_stop:
            index, job = pipe.recv()
            value, error = attempt(function, job)
            try:
                pipe.send((index, value, error))
            except (TypeError, AttributeError, ValueError) as problem:
                pipe.send((index, None, f"the result cannot be sent: {problem}"))
    except (EOFError, OSError, _StoppedError):
        pass  # nobody is there any more, or nobody wants more
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # what ends anyway needs no telling


def _told(number: int, frame: object) -> None:
    global _told_to_stop
    _told_to_stop = True
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise _StoppedError


def _follow_parent() -> None:
    """End when the process that wants the results does, however it ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
