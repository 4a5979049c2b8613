"""Many independent jobs, spread over this machine's processes or over a Dask cluster.

    run_jobs(plan_one, tasks, workers=0, on_result=keep)

A job is the one argument of a function. Both travel to other processes, so the function is one
that can be imported by name and the argument one that can be pickled. Results come one by one, as
soon as each is there: whoever keeps them at once loses nothing but what was under way when the
whole is killed, and continues later by leaving out the jobs whose results are kept.

A job that fails stops no other: an exception, also one that nobody expected, and the death of its
process become the text of its result's ``error``. A process that dies is replaced, and its job is
tried once more.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class JobResult:
    """What came of the job with that number, counted from zero.

    Attributes:
        index: the job's number.
        value: what the function returned; ``None`` where it failed.
        error: why it failed; empty where it did not.
    """

    index: int
    value: Any
    error: str = ""


def run_jobs(
    function: Callable[[Any], Any],
    jobs: Iterable[Any],
    *,
    workers: int = 0,
    cluster: str | None = None,
    on_result: Callable[[JobResult], None],
) -> None:
    """Do all jobs; ``on_result`` is called here, with each result in the order they are ready.

    What ``on_result`` raises stops the jobs under way and is raised on. For the parameters and the
    errors see ``job_results``.
    """
    results = job_results(function, jobs, workers=workers, cluster=cluster)
    try:
        for result in results:
            on_result(result)
    finally:
        results.close()


def job_results(
    function: Callable[[Any], Any],
    jobs: Iterable[Any],
    *,
    workers: int = 0,
    cluster: str | None = None,
) -> Generator[JobResult, None, None]:
    """The results of all jobs, in the order they are ready; jobs are taken as they are needed.

    ``workers`` is how many processes of this machine work at once; 0 is one for every processor.
    With ``cluster``, the address of a Dask scheduler (``tcp://127.0.0.1:8786``), its workers do
    the work, which needs the package ``distributed``; ``workers`` is then not looked at.

    Closing the generator, or an exception in it, stops the jobs under way: their processes get
    SIGTERM, and SIGKILL if they have not ended 10 s later.

    Raises:
        AloftError: no process can be started, or the cluster cannot be reached or used.
    """
    if cluster:
        from .cluster import cluster_results

        return cluster_results(function, jobs, cluster)
    from .worker_processes import process_results

    return process_results(function, jobs, workers or processors())


def processors() -> int:
    """How many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def attempt(function: Callable[[Any], Any], job: Any) -> tuple[Any, str]:
    """The function's value, or ``None`` and why there is none. Used where the work is done."""
    import traceback

    from ...runtime.language.errors import AloftError

    try:
        return function(job), ""
    except AloftError as error:
        return None, str(error)
    except Exception as error:  # noqa: BLE001  (a mistake in one job must not cost the others)
        last = traceback.format_exception_only(error)[-1].strip()
        frames = traceback.extract_tb(error.__traceback__)
        where = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
        return None, f"{last}{where}"
