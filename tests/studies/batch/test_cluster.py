"""Jobs on a Dask cluster: a real scheduler and real worker processes, on the loopback only.

An event loop in a thread runs what it is given, and says when it cannot start.
"""

import asyncio
import math
import os
import signal
import sys
import threading
from collections.abc import Iterator

import pytest

from aloft.runtime.language.errors import AloftError
from aloft.studies.batch.jobs import JobResult, job_results, running_loop

from ...local_cluster import local_cluster
from ...needed import needs

needs("distributed")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a cluster of two workers."""
    with local_cluster(tmp_path_factory.mktemp("cluster")) as address:
        yield address


def results(function: object, jobs: object, address: str) -> dict[int, JobResult]:
    found = list(job_results(function, jobs, cluster=address))  # type: ignore[arg-type]
    assert len({result.index for result in found}) == len(found)
    return {result.index: result for result in found}


@pytest.mark.long
def test_every_job_gives_one_result(cluster: str) -> None:
    found = results(math.sqrt, [4.0, -1.0, *[9.0] * 30], cluster)
    assert found[0].value == 2.0
    assert found[1].error.startswith("ValueError")
    assert [found[k].value for k in range(2, 32)] == [3.0] * 30


@pytest.mark.long
def test_it_is_the_workers_that_work(cluster: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WHO", "the test")
    found = results(os.getenv, ["WHO", "OMP_NUM_THREADS"], cluster)
    assert [found[k].value for k in (0, 1)] == [None, "1"]


@pytest.mark.long
def test_a_job_that_kills_its_workers_is_given_up_and_the_others_are_done(cluster: str) -> None:
    found = results(signal.raise_signal, [signal.SIGKILL, *[0] * 10], cluster)
    assert found[0].error.startswith("the cluster gave up: ")
    assert all(not found[k].error for k in range(1, 11))


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x", "127.0.0.1"])
def test_no_scheduler_is_one_clear_error(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from aloft.studies.batch import jobs as module

    monkeypatch.setattr(module, "WAIT", 0.5)
    with pytest.raises(AloftError, match=f"there is no Dask scheduler at '{address}'"):
        results(math.sqrt, [1.0], address)


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(AloftError, match=r"pip install 'distributed"):
        results(math.sqrt, [1.0], "tcp://127.0.0.1:1")


async def _thread_name() -> str:
    await asyncio.sleep(0)
    return threading.current_thread().name


def test_it_runs_in_a_thread_of_its_own_and_is_made_once() -> None:
    loop = running_loop()
    found = asyncio.run_coroutine_threadsafe(_thread_name(), loop.asyncio_loop)
    assert found.result(60) == "event loop"
    assert running_loop() is loop


@pytest.mark.long
def test_a_thread_that_does_not_come_to_run_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threading.Thread, "start", lambda thread: None)
    with pytest.raises(AloftError, match=r"did not run within 0.01 s: the machine is overloaded"):
        running_loop(0.01)
