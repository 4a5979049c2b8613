"""Jobs done by a Dask cluster's workers; ``jobs`` is how others use it."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable
from typing import Any

from ...runtime.language.errors import AloftError
from .jobs import JobResult, attempt

WAIT = 10.0
"""How long to wait for the scheduler and for a first worker [s]."""
AHEAD = 2
"""Jobs that are handed over for every thread of the cluster, so that none ever waits."""

MOST_LOSSES = 10
"""How often the result of one job may be lost with its worker before it is given up."""


def cluster_results(
    function: Callable[[Any], Any], jobs: Iterable[Any], address: str
) -> Generator[JobResult, None, None]:
    """See ``jobs.job_results``. A worker that is lost is the scheduler's affair: it gives the job
    to another one, and gives up on a job that costs it several. It cannot tell that job from
    others that were at the same worker, so all that it gave up are done once more, one by one."""
    client = _connect(address)
    from distributed import as_completed

    numbered = enumerate(jobs)
    numbers: dict[Any, tuple[int, Any]] = {}
    suspects: list[tuple[int, Any]] = []
    losses: dict[Any, int] = {}
    under_way = as_completed(loop=client.loop)

    def hand_over() -> None:
        for index, job in numbered:
            future = client.submit(attempt, function, job, pure=False)
            numbers[future.key] = index, job
            under_way.add(future)
            return

    try:
        for _ in range(AHEAD * sum(client.nthreads().values())):
            hand_over()
        for future in under_way:
            index, job = numbers.pop(future.key)
            if future.status == "finished":
                yield JobResult(index, *future.result())
            elif future.status == "error":
                # What a job raises is caught where it is done: this is the cluster's own error.
                suspects.append((index, job))
            elif client.status == "running" and future.status in ("pending", "lost"):
                # Its worker ended before the result was fetched: the scheduler has it done again.
                losses[future.key] = losses.get(future.key, 0) + 1
                if losses[future.key] <= MOST_LOSSES:
                    numbers[future.key] = index, job
                    under_way.add(future)
                    continue
                yield JobResult(index, None, "the cluster gave up: it lost the result every time")
            else:
                raise AloftError(f"the Dask scheduler at {address} has gone; what is done is kept")
            future.release()
            hand_over()
        for index, job in suspects:
            future = client.submit(attempt, function, job, pure=False)
            error = future.exception()
            if error is None:
                yield JobResult(index, *future.result())
            else:
                yield JobResult(index, None, f"the cluster gave up: {error}")
            future.release()
    finally:
        client.close()


def _connect(address: str) -> Any:
    """A client of a cluster that has workers which know aloft.

    Raises:
        AloftError: there is no Dask here, no scheduler there, or no such worker.
    """
    from ... import __version__

    try:
        from distributed import Client
    except ImportError as error:
        raise AloftError(
            "a Dask cluster needs the package distributed: pip install 'aloft[cluster]'"
        ) from error
    try:
        client = Client(address, timeout=WAIT, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        raise AloftError(
            f"there is no Dask scheduler at {address!r} ({type(error).__name__}); expected an "
            "address such as tcp://127.0.0.1:8786"
        ) from error
    try:
        client.wait_for_workers(1, timeout=WAIT)
        found = client.run(_version, on_error="return")
    except TimeoutError as error:
        client.close()
        raise AloftError(f"the Dask scheduler at {address} has no workers") from error
    wrong = {name: v for name, v in found.items() if v != __version__}
    if wrong:
        client.close()
        name, problem = next(iter(wrong.items()))
        raise AloftError(
            f"the Dask worker {name} cannot do what aloft {__version__} wants: {problem}; install "
            "the same aloft on every worker"
        )
    return client


def _version() -> str:
    from ... import __version__

    return __version__
