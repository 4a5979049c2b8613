"""Does jobs in processes of this machine. Other modules use it through ``jobs``.

The standard library's process pool fails as a whole when one of its processes is killed, and hangs
when that happens while work is being cancelled. Here every process has its own pipe, so it is known
which process died and which job it had. The process is replaced, and the job is tried again.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
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
from .job import JobResult, attempt

ATTEMPTS = 2
"""How often a job is tried whose process dies; if it dies twice, the job is taken for the cause."""
PATIENCE = 10.0
"""How long processes may take to stop before they are killed [s]."""
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
    """The results of all jobs, done by at most ``count`` processes; see ``jobs.job_results``."""
    numbered = enumerate(jobs)
    again: deque[Numbered] = deque()
    begun: dict[int, int] = {}
    workers: list[_Worker] = []

    def next_job() -> Numbered | None:
        return again.popleft() if again else next(numbered, None)

    try:
        while True:
            for worker in workers:
                if worker.job is None and not _assign(worker, next_job(), begun):
                    break
            while len(workers) < count and (job := next_job()) is not None:
                workers.append(_start(function))
                _assign(workers[-1], job, begun)
            busy = {worker.pipe: worker for worker in workers if worker.job is not None}
            if not busy:
                return
            for pipe in wait(list(busy)):
                worker = busy[pipe]  # type: ignore[index]  # wait gives what it got
                try:
                    message = worker.pipe.recv()
                except (EOFError, OSError):
                    workers.remove(worker)
                    reason, job = _exit_reason(worker), worker.job
                    if job is not None and begun[job[0]] < ATTEMPTS:
                        again.append(job)
                    elif job is not None:
                        yield JobResult(job[0], None, reason)
                    continue
                if message is None:
                    worker.ready = True
                else:
                    worker.job = None
                    begun.pop(message[0], None)
                    yield JobResult(*message)
    finally:
        _stop(workers)


def _assign(worker: _Worker, job: Numbered | None, begun: dict[int, int]) -> bool:
    """Let a worker begin a job. Returns whether there was one."""
    if job is None:
        return False
    worker.job = job
    begun[job[0]] = begun.get(job[0], 0) + 1
    with suppress(OSError):  # it died while it was idle; the next read from its pipe shows that
        worker.pipe.send(job)
    return True


def _start(function: Callable[[Any], Any]) -> _Worker:
    """Start a worker's process. It is spawned, not forked, so it has no state of this process."""
    try:
        pickle.dumps(function)
    except Exception as error:  # the errors and their texts differ between versions of Python
        raise AloftError(
            f"{getattr(function, '__qualname__', function)} cannot be sent to another process, which "
            f"imports it by its name: write it at the top level of a module ({error})"
        ) from error
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_work, args=(there, function), daemon=True)
    with _worker_environment():
        process.start()
    there.close()  # while this end is open too, the end of the process would not be noticed
    return _Worker(process, here)


@contextmanager
def _worker_environment() -> Iterator[None]:
    """Set what a process that is started within the context inherits.

    Linear algebra gets one thread, because the workers already use all processors. SIGINT is
    blocked: a terminal sends it to all processes, and only this one is to react to it.
    """
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    # Otherwise the start of the new process would start the tracker, which lets SIGINT through.
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


def _exit_reason(worker: _Worker) -> str:
    """Why a worker's process ended.

    Raises:
        AloftError: the process could not even start, so no other one would either.
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
    """End all processes: idle ones at once, working ones as soon as they have cleaned up."""
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
    """Raised in a worker that is told to stop."""


_stopping = False


def _work(pipe: Connection, function: Callable[[Any], Any]) -> None:
    """What a worker's process does: one job after another until its pipe is closed.

    SIGTERM raises an exception in the job under way, so that the job can clean up. A running graph
    handles the signal itself, and its robot comes to rest.
    """
    global _stopping
    try:
        signal.signal(signal.SIGTERM, _on_terminate)
        threading.Thread(target=_end_with_parent, daemon=True).start()
        pipe.send(None)
        while not _stopping:
            index, job = pipe.recv()
            value, error = attempt(function, job)
            try:
                pipe.send((index, value, error))
            except (TypeError, AttributeError, ValueError) as problem:
                pipe.send((index, None, f"the result cannot be sent: {problem}"))
    except (EOFError, OSError, _StoppedError):
        pass  # the process that wants the results has ended, or wants no more of them
    finally:
        # This process ends anyway. Python complains of a signal that arrives while its handler is taken away, so
        # none may arrive then.
        _stopping = True
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
        signal.signal(signal.SIGTERM, signal.SIG_IGN)


def _on_terminate(number: int, frame: object) -> None:
    """The first signal ends the job under way; a further one changes nothing."""
    global _stopping
    if not _stopping:
        _stopping = True
        raise _StoppedError


def _end_with_parent() -> None:
    """End this process when the one that wants the results ends, whatever the cause."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
