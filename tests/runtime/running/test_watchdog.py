"""A call that hangs is named with its line, ends the run, and keeps nobody from the stop cycles."""

import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from aloft.blocks.general.vector import Vector
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.errors import ExitCode
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.running.executor import run
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.testing.graphs import Use, checked_graph

LIMIT = 0.4
"""Seconds; a hanging call here ends by itself after 60 s, so that a failure does not hang."""


class Robot(Block):
    """Counts its stop cycles; tick 3 is what the test makes of it."""

    y = Output(Vector, text="nothing")
    rests = 0
    closed = False

    class Params(Parameters):
        n: int = 1

    def step(self) -> None:
        if self.tick == 3:
            self.work()

    def work(self) -> None:
        """Nothing."""

    def stop_cycle(self) -> None:
        type(self).rests += 1

    def close(self) -> None:
        type(self).closed = True


def turning() -> None:
    end = time.monotonic() + 60.0
    while time.monotonic() < end:
        pass


def sleeping() -> None:
    time.sleep(60.0)


def stubborn() -> None:
    for _ in range(3):
        with suppress(BaseException):  # a block may do so
            turning()


def hanging(work: Callable[[], None], **attributes: object) -> tuple[type[Robot], RunResult]:
    kind = type("Hanging", (Robot,), {"work": staticmethod(work), "rests": 0, **attributes})
    graph = checked_graph({"arm.robot": Use(kind), "other": Use(Robot)})
    return kind, run(graph, 10, clock=ClockSpec(hangs_after=LIMIT))


@pytest.mark.parametrize(
    ("work", "line"),
    [(turning, "while time.mono|pass"), (sleeping, "time.sleep")],
)
def test_a_block_that_hangs_ends_the_run_in_damping(work: Callable[[], None], line: str) -> None:
    kind, result = hanging(work)
    assert result.exit_code is ExitCode.RUN_FAILED
    assert result.reason == (
        "block 'arm.robot' hung at tick 3 (0.006 s): it did not return within 0.4 s "
        "(clock.hangs_after allows longer)"
    )
    assert result.error is not None and (result.error.block, result.error.tick) == ("arm.robot", 3)
    file, _, number = result.error.where.rpartition(":")
    assert file == __file__
    assert re.search(line, Path(__file__).read_text().splitlines()[int(number) - 1])
    assert f"in {work.__name__}" in result.error.traceback
    assert (kind.rests, kind.closed) == (5, True)
    assert result.wall_time_s < 50.0


def test_a_block_that_catches_the_interruption_ends_the_run_all_the_same() -> None:
    kind, result = hanging(stubborn)
    assert result.exit_code is ExitCode.RUN_FAILED
    assert "block 'arm.robot' hung at tick 3 (0.006 s)" in result.reason
    assert (kind.rests, kind.closed) == (5, True)


def test_it_is_found_in_another_thread_too() -> None:
    found: list[RunResult] = []
    thread = threading.Thread(target=lambda: found.append(hanging(turning)[1]))
    thread.start()
    thread.join()
    assert "block 'arm.robot' hung at tick 3" in found[0].reason


def test_stop_cycles_that_hang_are_ended_one_by_one() -> None:
    _, result = hanging(lambda: None, stop_cycle=lambda self: sleeping())
    assert result.reason == "block 'arm.robot' failed in stop cycle 1: it did not return in time"
    assert len(result.stop_problems) == 5
    assert Robot.rests >= 5  # the other block had its turn


def test_a_block_that_waits_for_others_has_a_limit_of_its_own() -> None:
    _, result = hanging(lambda: time.sleep(3 * LIMIT), waits_for_others=True)
    assert result.exit_code is ExitCode.SUCCESS


def test_many_slow_calls_in_a_tick_do_not_hang() -> None:
    slow = type("Slow", (Robot,), {"work": staticmethod(lambda: time.sleep(0.6 * LIMIT))})
    graph = checked_graph({f"robot_{i}": Use(slow) for i in range(4)})
    assert run(graph, 5, clock=ClockSpec(hangs_after=LIMIT)).exit_code is ExitCode.SUCCESS


ABANDONED = """
import threading
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.language.block import Block, Output
from aloft.blocks.general.vector import Vector
from aloft.runtime.running.executor import run
from aloft.runtime.testing.graphs import Use, checked_graph

class Robot(Block):
    "Waits for a lock that nobody opens."
    y = Output(Vector, text="nothing")

    def step(self):
        lock = threading.Lock()
        lock.acquire()
        lock.acquire()

    def stop_cycle(self):
        print("stop cycle", flush=True)

    def close(self):
        print("close", flush=True)

graph = checked_graph({"robot": Use(Robot)}, dimensions={"n": 1})
run_it = threading.Thread(target=lambda: run(graph, clock=ClockSpec(hangs_after=0.4)))
run_it.start()  # in another thread than the main one nothing interrupts a lock
run_it.join()
"""


def test_what_nothing_interrupts_is_abandoned_in_damping() -> None:
    done = subprocess.run(
        [sys.executable, "-c", ABANDONED],
        check=False, capture_output=True, text=True, timeout=240, env={**os.environ},
    )  # fmt: skip
    assert done.stdout.splitlines() == [*["stop cycle"] * 5, "close"]
    assert "block 'robot' hung at tick 0 (0.000 s): it did not return within 0.4 s" in done.stderr
    assert "nothing interrupts it\n  it is at <string>:16\n" in done.stderr
    assert done.returncode == ExitCode.RUN_FAILED
