"""Does jobs on the workers of a Dask cluster. Other modules use it through ``jobs``."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from importlib.metadata import version
from typing import Any

from ...runtime.language.errors import AloftError
from .event_loop import running_loop
from .job import JobResult, attempt

WAIT = 10.0
"""How long to wait for the scheduler and for a first worker [s]."""
AHEAD = 2
"""How many jobs are submitted for every thread of the cluster, so that no thread ever waits."""
MOST_LOSSES = 10
"""How often the result of one job may be lost with its worker before the job is given up."""


def cluster_results(
    function: Callable[[Any], Any], jobs: Iterable[Any], address: str
) -> Generator[JobResult, None, None]:
    """The results of all jobs; see ``jobs.job_results`` for the parameters.

    When a worker is lost, the scheduler gives its jobs to another one. It gives up on all jobs that
    were on several lost workers, because it cannot tell which of them was the cause. These jobs are
    done once more at the end, one at a time.
    """
    with _connected(address) as client:
        yield from _results(function, jobs, client, address)


def _results(
    function: Callable[[Any], Any], jobs: Iterable[Any], client: Any, address: str
) -> Generator[JobResult, None, None]:
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
    """A client of a cluster whose workers have the same version of aloft.

    Raises:
        AloftError: Dask is not installed, there is no scheduler at the address, or a worker has no
            aloft or another version of it.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise AloftError(
            "a Dask cluster needs the package distributed: pip install 'aloft[cluster]'"
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
    """The version of aloft that is installed in the process that calls this."""
    return version("aloft")
