"""Solvers that are called from a process with several threads: the same answers, errors and ends.

A call that may never end: its answer, its error, and its end.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from aloft.planner.solving import solver_process
from aloft.planner.solving.solver_process import (
    _helper,
    bounded,
    call_bounded,
    call_solver,
    cpu_time,
    has_one_thread,
)


@pytest.fixture
def thread() -> Iterator[None]:
    """A second thread, which does nothing."""
    over = threading.Event()
    other = threading.Thread(target=over.wait)
    other.start()
    yield
    over.set()
    other.join()
    _helper.stop()


def quadratic(goal: float) -> Any:
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p")
    nlp = {"x": x, "p": p, "f": ca.sumsqr(x - goal) + p * ca.sumsqr(x), "g": ca.sum1(x)}
    options = {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes"}}
    return ca.nlpsol("quadratic", "ipopt", nlp, options)


def arguments(p: float) -> dict[str, Any]:
    return {"x0": np.zeros(3), "p": np.array([p]), "lbg": np.array([-9.0]), "ubg": np.array([9.0])}


def test_threads_are_counted(thread: None) -> None:
    assert not has_one_thread()
    alone = "from aloft.planner.solving.solver_process import has_one_thread as f; print(f())"
    single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", alone],
        check=True, capture_output=True, text=True, env={**os.environ, **single},
    )  # fmt: skip
    assert done.stdout == "True\n"


def test_the_answers_are_those_of_this_process(thread: None) -> None:
    before = cpu_time()
    for goal in (1.0, 2.0, 1.0):
        solver = quadratic(goal)
        for p in (0.0, 1.0):
            ended, answer = call_bounded(solver, arguments(p), 20)
            values, stats = call_solver(solver, arguments(p))
            assert ended and answer is not None
            assert np.array_equal(answer[0], values)
            assert answer[1] == stats and stats["success"]
            assert values == pytest.approx([goal / (1.0 + p)] * 3, abs=1e-6)
    process = _helper._process
    assert process is not None and process.is_alive()  # one process for all calls
    assert cpu_time() > before


def test_a_solver_is_sent_again_when_the_process_has_dropped_it(
    thread: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(solver_process, "KEPT", 1)
    solvers = [quadratic(1.0), quadratic(2.0)]
    for number in (0, 1, 0, 1):
        _, answer = call_bounded(solvers[number], arguments(0.0), 20)
        assert answer is not None and answer[0] == pytest.approx([number + 1.0] * 3, abs=1e-6)
    assert len(_helper._sent) == 1


def test_an_error_comes_back_and_the_next_call_works(thread: None) -> None:
    solver = quadratic(1.0)
    with pytest.raises(RuntimeError, match="no_such_argument"):
        call_bounded(solver, {"no_such_argument": np.zeros(1)}, 20)
    assert call_bounded(solver, arguments(0.0), 20)[0]


def test_a_process_that_died_is_started_again(thread: None) -> None:
    solver = quadratic(1.0)
    call_bounded(solver, arguments(0.0), 20)
    process = _helper._process
    assert process is not None
    os.kill(process.pid, signal.SIGKILL)
    assert process.wait(60.0) == -signal.SIGKILL
    assert call_bounded(solver, arguments(0.0), 20)[0]


@pytest.mark.long
def test_a_call_that_takes_too_long_is_given_up(thread: None) -> None:
    x = ca.SX.sym("x", 5000)  # Rosenbrock's function, in a chain: thousands of iterations
    chain = ca.sumsqr(1.0 - x[:-1]) + 100.0 * ca.sumsqr(x[1:] - x[:-1] ** 2)
    options = {
        "print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 10_000_000},
    }  # fmt: skip
    long = ca.nlpsol("long", "ipopt", {"x": x, "f": chain}, options)
    assert call_bounded(long, {"x0": np.full(5000, -1.0)}, 1) == (False, None)


def spin() -> None:
    while True:
        pass


def test_a_solver_is_prepared_here_and_not_by_every_copy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solver_process, "has_one_thread", lambda: True)

    class Solver:
        made = 0

        def prepare(self) -> None:
            self.made += 1

        def __call__(self) -> dict[str, float]:
            return {"x": float(self.made)}

        def stats(self) -> dict[str, bool]:
            return {"success": True}

    solver = Solver()
    ended, answer = call_bounded(solver, {}, 5)
    assert ended and answer[0].tolist() == [1.0]
    assert solver.made == 1


def test_what_the_call_returns_comes_back() -> None:
    ended, value = bounded(lambda: (np.arange(200_000.0), {"n": 3}), 10)
    assert ended and value[1] == {"n": 3}
    assert np.array_equal(value[0], np.arange(200_000.0))


def test_a_call_that_never_ends_is_given_up_and_its_time_counts() -> None:
    before = cpu_time()
    assert bounded(spin, 1) == (False, None)
    assert cpu_time() - before > 0.8


def test_an_error_is_raised_here() -> None:
    with pytest.raises(RuntimeError, match="ValueError: no such thing"):
        bounded(lambda: (_ for _ in ()).throw(ValueError("no such thing")), 5)


def test_it_changes_nothing_here() -> None:
    found: list[int] = []
    bounded(lambda: found.append(1), 5)
    assert found == []


def test_a_call_that_kills_its_process_is_given_up() -> None:
    assert bounded(lambda: os.kill(os.getpid(), 9), 5) == (False, None)


def test_no_process_is_left_behind() -> None:
    before = children()
    bounded(time.process_time, 5)
    assert children() <= before


def children() -> set[str]:
    """The numbers of the processes that this one has started and that have not ended."""
    found = set()
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has ended meanwhile
            parent = status.read_text().rpartition(")")[2].split()[1]
            if int(parent) == os.getpid():
                found.add(status.parent.name)
    return found
