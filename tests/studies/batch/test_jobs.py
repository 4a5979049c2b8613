"""Jobs over processes: every result, also of what fails or is killed, and a prompt clean end."""

import math
import operator
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from aloft.processes.child_process import processors
from aloft.runtime.language.errors import AloftError
from aloft.runtime.language.units import parse_unit
from aloft.studies.batch.jobs import JobPool, JobResult, attempt, job_results


def results(function: Any, jobs: Any, workers: int = 2) -> dict[int, JobResult]:
    found = list(job_results(function, jobs, workers=workers))
    assert len({result.index for result in found}) == len(found)
    return {result.index: result for result in found}


def running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat")
    return not (state.is_file() and state.read_text().rpartition(")")[2].split()[0] == "Z")


def wait_until(condition: Any) -> None:
    end = time.monotonic() + 240.0
    while not condition():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.01)


def test_every_job_gives_one_result() -> None:
    found = results(math.sqrt, [4.0, 9.0, -1.0, "x", 16.0])
    assert [found[k].value for k in (0, 1, 4)] == [2.0, 3.0, 4.0]
    assert found[2].error.startswith("ValueError: ") and found[2].value is None
    assert found[3].error.startswith("TypeError: must be real number, not str (")


def test_no_jobs_need_no_process() -> None:
    assert results(math.sqrt, []) == {}


def test_errors_of_ours_are_told_as_they_are() -> None:
    value, error = attempt(parse_unit, "furlong")
    assert value is None
    assert error is not None
    assert error.startswith("cannot read unit 'furlong': unknown symbol 'furlong'; the symbols are")


def test_workers_use_one_thread_and_this_process_what_it_did(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "8")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    found = results(os.getenv, ["OMP_NUM_THREADS", "MKL_NUM_THREADS"])
    assert [found[k].value for k in (0, 1)] == ["1", "1"]
    assert os.environ["OMP_NUM_THREADS"] == "8"
    assert "MKL_NUM_THREADS" not in os.environ


def test_jobs_are_taken_as_they_are_needed() -> None:
    taken = 0

    def jobs() -> Any:
        nonlocal taken
        for number in range(1000):
            taken += 1
            yield float(number)

    with closing(job_results(math.sqrt, jobs(), workers=1)) as found:
        for _ in range(5):
            next(found)
    assert taken <= 6


def test_a_job_that_kills_its_process_costs_no_other() -> None:
    found = results(signal.raise_signal, [signal.SIGKILL, 0, 0, signal.SIGKILL, 0], workers=2)
    assert len(found) == 5
    for index in (0, 3):
        assert found[index].error == "its process was killed by SIGKILL, 2 times"
    assert [found[k].error for k in (1, 2, 4)] == ["", "", ""]
    assert results(os._exit, [3])[0].error == "its process ended with exit code 3, 2 times"


def test_a_process_that_is_killed_is_replaced_and_its_job_done_again(tmp_path: Path) -> None:
    """Killed from outside, once: the job's second attempt is left alone."""
    first = tmp_path / "first"
    script = f"echo $PPID >> {first}; [ $(wc -l < {first}) = 1 ] && kill -9 $PPID; exit 7"
    found = results(os.system, [script], workers=1)
    assert os.waitstatus_to_exitcode(found[0].value) == 7
    assert len(set(first.read_text().split())) == 2


def test_a_worker_lets_the_interruption_of_a_terminal_pass() -> None:
    """It is for the process that wants the results, which decides what becomes of the job."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a worker must not inherit
    try:  # that SIGINT is ignored, as it is where the tests run in the background
        found = results(signal.raise_signal, [signal.SIGINT], workers=1)
    finally:
        signal.signal(signal.SIGINT, before)
    assert found == {0: JobResult(0, None, "")}


def test_a_result_that_cannot_be_sent_is_an_error() -> None:
    found = results(open, [os.devnull])
    assert found[0].error.startswith("the result cannot be sent: cannot pickle")


def test_closing_the_results_stops_the_jobs() -> None:
    started = time.monotonic()
    with closing(job_results(time.sleep, [0.0, 300.0, 300.0, 300.0], workers=2)) as found:
        assert next(found) == JobResult(0, None, "")
    assert time.monotonic() - started < 300.0


def test_a_pool_serves_batches_with_the_same_processes_and_ends_them() -> None:
    with JobPool(work_here, workers=2) as pool:
        first = {result.value for result in pool.results(range(4))}
        second = {result.value for result in pool.results(range(4))}
        assert second <= first and len(first) <= 2 and os.getpid() not in first
        with closing(pool.results([0, 300])) as found:
            next(found)
        after = {result.value for result in pool.results([0])}
    assert len(after) == 1
    wait_until(lambda: not any(running(pid) for pid in first | after))


def work_here(seconds: float) -> int:
    if seconds > 3.0:
        time.sleep(seconds)
    return os.getpid()


def test_a_function_that_has_no_name_is_refused() -> None:
    with pytest.raises(AloftError, match="cannot be sent to another process"):
        results(lambda x: x, [1])


def test_processors() -> None:
    assert 1 <= processors() <= (os.cpu_count() or 1)


def test_a_script_without_a_guard_is_told(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "import math\nfrom aloft.studies.batch.jobs import job_results\n"
        "list(job_results(math.sqrt, [1.0] * 50, workers=2))\n"
    )
    done = subprocess.run(
        [sys.executable, script], capture_output=True, check=False, text=True, timeout=240
    )
    assert done.returncode == 1
    assert "a worker process cannot start" in done.stderr
    assert "if __name__ ==" in done.stderr


WORK = """
import os, time
def work(seconds):
    with open("pids", "a") as file:
        file.write(f"{os.getpid()}\\n")
    time.sleep(seconds)
"""
# A shell that runs its tests in the background (sh -c 'make test &') has them ignore SIGINT, and a
# Python that is started so never raises KeyboardInterrupt. The parent therefore asks for it.
PARENT = """
import signal, sys
from aloft.studies.batch.jobs import job_results
from work import work
if __name__ == "__main__":
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        print("go", flush=True)
        list(job_results(work, [600.0] * 4, workers=2))
    except KeyboardInterrupt:
        sys.exit(130)
"""


@contextmanager
def parent_process(folder: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that has begun to start its workers; whatever is left of them is killed."""
    (folder / "work.py").write_text(WORK)
    (folder / "parent.py").write_text(PARENT)
    with subprocess.Popen(
        [sys.executable, "parent.py"], cwd=folder, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, start_new_session=True,
    ) as parent:  # fmt: skip
        try:
            assert parent.stdout is not None
            assert parent.stdout.readline() == "go\n"
            yield parent
        finally:
            with suppress(ProcessLookupError):
                os.killpg(parent.pid, signal.SIGKILL)


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_workers_end_with_the_process_that_wants_their_results(
    tmp_path: Path, number: signal.Signals
) -> None:
    pids = tmp_path / "pids"
    with parent_process(tmp_path) as parent:
        wait_until(lambda: pids.is_file() and len(pids.read_text().split()) == 2)
        parent.send_signal(number)
        _, errors = parent.communicate(timeout=240)
        workers = [int(pid) for pid in pids.read_text().split()]
        wait_until(lambda: not any(map(running, workers)))
    assert errors == ""
    assert parent.returncode == (130 if number == signal.SIGINT else -number)


def test_interrupting_while_processes_start_prints_nothing(tmp_path: Path) -> None:
    """As a terminal does it: the whole process group gets the signal."""
    for pause in (0.0, 0.1, 0.3):
        with parent_process(tmp_path) as parent:
            time.sleep(pause)
            os.killpg(parent.pid, signal.SIGINT)
            _, errors = parent.communicate(timeout=240)
        assert parent.returncode == 130
        assert errors == ""


def test_the_function_is_what_the_jobs_go_through() -> None:
    assert results(operator.neg, range(40), workers=3).keys() == set(range(40))
