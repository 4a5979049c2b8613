"""Many independent jobs, spread over this machine's processes or over a Dask cluster.

    run_jobs(plan_one, tasks, workers=0, on_result=keep)

A job is the one argument of a function. Both are sent to other processes, so it must be possible to
import the function by its name and to pickle the argument. Results come one by one, each as soon as
it is there. A caller that stores every result at once loses only the jobs that were under way when
everything was killed. It continues later by leaving out the jobs whose results it has.

A job that fails does not stop the others. Any exception in a job, and the death of its process,
become the text of its result's ``error``. A process that dies is replaced, and its job is tried
once more.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable
from typing import Any

from .job import JobResult


def run_jobs(
    function: Callable[[Any], Any],
    jobs: Iterable[Any],
    *,
    workers: int = 0,
    cluster: str | None = None,
    on_result: Callable[[JobResult], None],
) -> None:
    """Do all jobs, and call ``on_result`` in this process with each result as soon as it is there.

    An exception in ``on_result`` stops the jobs under way and is passed on. For the parameters and
    the errors see ``job_results``.
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
    """The results of all jobs, in the order in which they are ready.

    Jobs are taken from ``jobs`` only as they are needed. Closing the generator, or an exception in
    it, stops the jobs under way: their processes get SIGTERM, and SIGKILL if they have not ended
    10 s later.

    Args:
        function: does one job.
        jobs: the arguments of ``function``.
        workers: how many processes of this machine work at once; 0 for one for every processor.
        cluster: the address of a Dask scheduler (``tcp://127.0.0.1:8786``) whose workers do the
            jobs instead, which needs the package ``distributed``. ``workers`` is ignored then.

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
