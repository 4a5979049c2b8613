"""Many independent jobs, spread over this machine's processes or over a Dask cluster.

    with closing(job_results(plan_one, tasks, workers=2)) as results:
        for result in results:
            keep(result)

A job is the one argument of a function. Both are sent to other processes, so it must be possible to
import the function by its name and to pickle the argument. Results come one by one, each as soon as
it is there. A caller that stores every result at once loses only the jobs that were under way when
everything was killed. It continues later by leaving out the jobs whose results it has.

A job that fails does not stop the others. Any exception in a job, and the death of its process,
become the text of its result's ``error``. A process that dies is replaced, and its job is tried
once more.

The standard library's process pool fails as a whole when one of its processes is killed, and hangs
when that happens while work is being cancelled. Here every process has its own pipe, so it is known
which process died and which job it had. The process is replaced, and the job is tried again. These
processes are started by ``multiprocessing`` and not as a ``ChildProcess``, because it lets them find
functions of a script that is run, too.

Jobs on a Dask cluster are sent by a client whose event loop has a thread of its own. A client can
start such a thread itself, but it gives up with an assertion without a text if the thread has not
come to run within 10 s, as happens on an overloaded machine. On one machine Dask is no substitute
for the processes: 400 jobs that do nothing take 0.5 s with them and 7.5 s with a cluster of two.
"""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import pickle
import signal
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from threading import Thread
from time import monotonic
from typing import Any, Self

from ...files.pip_line import pip_line
from ...processes.child import end_with
from ...processes.child_process import processors
from ...runtime.language.errors import AloftError


@dataclass(frozen=True)
class JobResult:
    """The result of one job.

    Attributes:
        index: the job's number, counted from zero.
        value: what the function returned; ``None`` where it failed.
        error: why it failed; empty where it did not.
    """

    index: int
    value: Any
    error: str = ""


def attempt(function: Callable[[Any], Any], job: Any) -> tuple[Any, str]:
    """Do a job in the process that is to do it.

    Returns:
        What the function returned, and an empty text; or ``None``, and why the job failed.
    """
    try:
        return function(job), ""
    except AloftError as error:
        return None, str(error)
    except Exception as error:  # noqa: BLE001  (a mistake in one job must not cost the others)
        last = traceback.format_exception_only(error)[-1].strip()
        frames = traceback.extract_tb(error.__traceback__)
        where = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
        return None, f"{last}{where}"


ATTEMPTS = 2
"""Number of attempts at a job whose process dies; after the last the job is taken for the cause."""
TIMEOUT = 10.0
"""Longest time that processes may take to stop before they are killed [s]."""
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")

Numbered = tuple[int, Any]


@dataclass
class _Worker:
    """One process, the pipe to it, and the job it is doing."""

    process: Any
    pipe: Connection
    ready: bool = False
    job: Numbered | None = None


def _process_results(
    function: Callable[[Any], Any], jobs: Iterable[Any], workers: list[_Worker], count: int
) -> Generator[JobResult, None, None]:
    """Yield the results of all jobs, done by ``workers``, which become at most ``count``."""
    numbered = enumerate(jobs)
    again: deque[Numbered] = deque()
    begun: dict[int, int] = {}

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
        at_work = [worker for worker in workers if worker.job is not None]
        _stop(at_work)
        workers[:] = [worker for worker in workers if worker not in at_work]


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
    """Return the reason for which a worker's process ended.

    Raises:
        AloftError: the process could not even start, so no other one would either.
    """
    worker.pipe.close()
    worker.process.join(TIMEOUT)
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
    end = monotonic() + TIMEOUT
    for worker in workers:
        worker.process.join(max(0.0, end - monotonic()))
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()


class _StoppedError(BaseException):
    """Raised in a worker that receives the signal to stop."""


_stopping = False


def _work(pipe: Connection, function: Callable[[Any], Any]) -> None:
    """Do one job after another in a worker's process until its pipe is closed.

    SIGTERM raises an exception in the job under way, so that the job can clean up. A running graph
    handles the signal itself, and its robot comes to rest.
    """
    global _stopping
    try:
        signal.signal(signal.SIGTERM, _on_terminate)
        parent = multiprocessing.parent_process()
        if parent is not None:
            end_with(parent.sentinel, signal.SIGKILL)
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
    """End the job under way at the first signal; a further one changes nothing."""
    global _stopping
    if not _stopping:
        _stopping = True
        raise _StoppedError


class JobPool:
    """Processes, or a connection to a cluster, that serve one batch of jobs after another.

    They begin with the first job and end with the ``with`` statement::

        with JobPool(run_one, workers=2) as pool:
            for batch in batches:
                with closing(pool.results(batch)) as results: ...

    Args:
        function: does one job.
        workers: how many processes of this machine work at once; 0 for one for every processor.
        cluster: the address of a Dask scheduler (``tcp://127.0.0.1:8786``) whose workers do the
            jobs instead, which needs the package ``distributed``. ``workers`` is ignored then.
    """

    def __init__(
        self, function: Callable[[Any], Any], *, workers: int = 0, cluster: str | None = None
    ) -> None:
        self.function = function
        self._count = workers or processors()
        self._cluster = cluster
        self._workers: list[_Worker] = []
        self._connection = ExitStack()
        self._client: Any = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        _stop(self._workers)
        self._workers.clear()
        self._connection.close()
        self._client = None

    def results(self, jobs: Iterable[Any]) -> Generator[JobResult, None, None]:
        """Yield the results of all jobs, in the order in which they are ready.

        Jobs are taken from ``jobs`` only as they are needed. Closing the generator, or an exception in
        it, stops the jobs under way: their processes get SIGTERM, and SIGKILL if they have not ended
        10 s later.

        Raises:
            AloftError: no process can be started, or the cluster cannot be reached or used.
        """
        if not self._cluster:
            yield from _process_results(self.function, jobs, self._workers, self._count)
            return
        if self._client is None:
            self._client = self._connection.enter_context(_connected(self._cluster))
        yield from _cluster_results(self.function, jobs, self._client, self._cluster)


def job_results(
    function: Callable[[Any], Any],
    jobs: Iterable[Any],
    *,
    workers: int = 0,
    cluster: str | None = None,
) -> Generator[JobResult, None, None]:
    """Yield the results of one batch of jobs; see ``JobPool``."""
    with JobPool(function, workers=workers, cluster=cluster) as pool:
        yield from pool.results(jobs)


@cache
def running_loop(wait: float = 120.0) -> Any:
    """Return the tornado ``IOLoop`` of this process, which runs until the process ends.

    Args:
        wait: for the thread to come to run [s].

    Raises:
        AloftError: the thread does not run by then.
    """
    ready: Future[Any] = Future()
    Thread(target=_run, args=(ready,), name="event loop", daemon=True).start()
    try:
        return ready.result(wait)
    except TimeoutError as error:
        raise AloftError(
            f"the thread of the Dask client did not run within {wait:g} s: the machine is "
            "overloaded; use fewer workers, or try again when it is quiet"
        ) from error


def _run(ready: Future[Any]) -> None:
    asyncio.run(_until_the_end(ready))


async def _until_the_end(ready: Future[Any]) -> None:
    from tornado.ioloop import IOLoop

    ready.set_result(IOLoop.current())
    await asyncio.Event().wait()


WAIT = 10.0
"""Longest wait for the scheduler and for a first worker [s]."""
AHEAD = 2
"""Number of jobs submitted for every thread of the cluster, so that no thread ever waits."""
MOST_LOSSES = 10
"""Number of times that the result of one job may be lost with its worker before the job is given
up."""


def _cluster_results(
    function: Callable[[Any], Any], jobs: Iterable[Any], client: Any, address: str
) -> Generator[JobResult, None, None]:
    """Yield the results of all jobs, done by a cluster.

    When a worker is lost, the scheduler gives its jobs to another one. It gives up on all jobs that
    were on several lost workers, because it cannot tell which of them was the cause. These jobs are
    done once more at the end, one at a time.
    """
    from distributed import as_completed

    numbered = enumerate(jobs)
    numbers: dict[Any, tuple[int, Any]] = {}
    suspects: list[tuple[int, Any]] = []
    losses: dict[Any, int] = {}
    under_way = as_completed(loop=client.loop)

    def submit_next() -> None:
        for index, job in numbered:
            future = client.submit(attempt, function, job, pure=False)
            numbers[future.key] = index, job
            under_way.add(future)
            return

    for _ in range(AHEAD * sum(client.nthreads().values())):
        submit_next()
    for future in under_way:
        index, job = numbers.pop(future.key)
        if future.status == "finished":
            yield JobResult(index, *future.result())
        elif future.status == "error":
            # An exception in a job is caught by the worker, so this is an error of the cluster.
            suspects.append((index, job))
        elif client.status == "running" and future.status in ("pending", "lost"):
            # Its worker ended before the result was fetched: the scheduler has the job done again.
            losses[future.key] = losses.get(future.key, 0) + 1
            if losses[future.key] <= MOST_LOSSES:
                numbers[future.key] = index, job
                under_way.add(future)
                continue
            yield JobResult(index, None, "the cluster gave up: it lost the result every time")
        else:
            raise AloftError(f"the Dask scheduler at {address} has gone; what is done is kept")
        future.release()
        submit_next()
    for index, job in suspects:
        future = client.submit(attempt, function, job, pure=False)
        error = future.exception()
        if error is None:
            yield JobResult(index, *future.result())
        else:
            yield JobResult(index, None, f"the cluster gave up: {error}")
        future.release()


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    """Connect to a cluster whose workers have the same version of aloft.

    Raises:
        AloftError: Dask is not installed, there is no scheduler at the address, or a worker has no
            aloft or another version of it.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise AloftError(
            f"a Dask cluster needs the package distributed: {pip_line('cluster')}"
        ) from error
    loop = running_loop()
    try:
        client = Client(address, timeout=WAIT, set_as_default=False, loop=loop)
    except (OSError, ValueError, TypeError) as error:
        raise AloftError(
            f"there is no Dask scheduler at {address!r} ({type(error).__name__}); expected an "
            "address such as tcp://127.0.0.1:8786"
        ) from error
    with closing(client):
        _check_workers(client, address)
        yield client


def _check_workers(client: Any, address: str) -> None:
    own = _version()
    try:
        client.wait_for_workers(1, timeout=WAIT)
        found = client.run(_version, on_error="return")
    except TimeoutError as error:
        raise AloftError(f"the Dask scheduler at {address} has no workers") from error
    wrong = {name: v for name, v in found.items() if v != own}
    if wrong:
        name, problem = next(iter(wrong.items()))
        raise AloftError(
            f"the Dask worker {name} cannot do what aloft {own} wants: {problem}; install "
            "the same aloft on every worker"
        )


def _version() -> str:
    """Return the version of aloft that is installed in the process that calls this."""
    return version("aloft-robotics")
