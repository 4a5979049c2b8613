"""A call that hangs is named with its line, ends the run, and keeps nobody from the stop cycles.

Real signals to a real process: a clean stop within a tick, stop cycles, exit codes.
"""

import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.block import Block, Clock, Output
from aloft.runtime.language.errors import ExitCode
from aloft.runtime.language.parameters import Parameters
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.running.executor import run
from aloft.runtime.running.life_cycle import LifeCycle
from aloft.runtime.running.run_result import RunResult
from aloft.runtime.running.watchdog import Interrupts
from aloft.runtime.testing.graphs import BlockUse, checked_graph

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
    graph = checked_graph({"arm.robot": BlockUse(kind), "other": BlockUse(Robot)})
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


def test_what_ended_the_run_comes_before_what_hung_afterwards() -> None:
    for failed, reason in (
        (lambda self: {"success": False, "reason": "too hot"}, "too hot; "),
        (lambda self: {}, ""),
    ):
        _, result = hanging(lambda: None, close=lambda self: sleeping(), metrics=failed)
        assert result.exit_code is ExitCode.RUN_FAILED
        assert (
            result.reason == f"{reason}block 'arm.robot' failed in close: it did not return in time"
        )


def test_a_block_that_waits_for_others_has_a_limit_of_its_own() -> None:
    _, result = hanging(lambda: time.sleep(3 * LIMIT), waits_for_others=True)
    assert result.exit_code is ExitCode.SUCCESS


def test_many_slow_calls_in_a_tick_do_not_hang() -> None:
    limit = 1.5  # far above a call, as a busy machine may keep one from returning
    slow = type("Slow", (Robot,), {"work": staticmethod(lambda: time.sleep(0.2 * limit))})
    graph = checked_graph({f"robot_{i}": BlockUse(slow) for i in range(6)})
    assert run(graph, 1, clock=ClockSpec(hangs_after=limit)).exit_code is ExitCode.SUCCESS


ABANDONED = """
import threading
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.language.block import Block, Output
from aloft.blocks.general.vectors import Vector
from aloft.runtime.running.executor import run
from aloft.runtime.testing.graphs import BlockUse, checked_graph

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

graph = checked_graph({"robot": BlockUse(Robot)}, dimensions={"n": 1})
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


def test_the_first_cause_is_said_where_closing_is_abandoned() -> None:
    program = ABANDONED.replace("def step(self):", "def close(self):", 1).replace(
        '    def close(self):\n        print("close", flush=True)\n',
        '    def step(self):\n        raise ValueError("the true cause")\n',
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        check=False, capture_output=True, text=True, timeout=240, env={**os.environ},
    )  # fmt: skip
    assert done.stdout.splitlines() == ["stop cycle"] * 5
    cause = "block 'robot' failed at tick 0 (0.000 s): ValueError: the true cause; then block 'robot' hung"
    assert cause in done.stderr
    assert done.returncode == ExitCode.RUN_FAILED


PROGRAM = """
import signal, sys, time
from aloft.runtime.language.block import Block, Output
from aloft.runtime.running.executor import run
from aloft.blocks.general.vectors import Vector
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.testing.graphs import BlockUse, checked_graph

MODE = sys.argv[1]
if MODE == "burst":  # what comes after the run is not of interest
    signal.signal(signal.SIGINT, signal.SIG_IGN)

class Robot(Block):
    "Says when it runs."
    y = Output(Vector, text="nothing")

    def step(self):
        if self.tick == 20:
            print("running", flush=True)
        if MODE == "hangs" and self.tick == 20:
            interrupts = signal.getsignal(signal.SIGTERM).__self__
            while interrupts.received is None:
                time.sleep(0.01)
            print("heard", flush=True)
            while True:
                time.sleep(0.01)

    def stop_cycle(self):
        print("stop cycle", flush=True)
        if MODE == "stop_hangs":
            while True:
                time.sleep(0.01)

    def close(self):
        print("close", flush=True)

graph = checked_graph({"robot": BlockUse(Robot)}, dimensions={"n": 1}, clock=ClockSpec("paced"))
result = run(graph, log=False)
if MODE == "burst":
    print(*result.stop_problems, sep="\\n", flush=True)
print(result.reason, flush=True)
sys.exit(result.exit_code)
"""


def start(mode: str) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, mode],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "running\n"
    return process


@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=["SIGINT", "SIGTERM"]
)
def test_a_signal_stops_cleanly(number: signal.Signals, code: int) -> None:
    process = start("runs")
    process.send_signal(number)
    output, errors = process.communicate(timeout=240)
    name = signal.Signals(number).name
    assert output.splitlines() == [*["stop cycle"] * 5, "close", f"stopped by {name}"]
    assert process.returncode == code
    if number is signal.SIGINT:
        assert errors == (
            "\nstopping after this tick, the robot in damping; Ctrl-C again ends a block that hangs\n"
        )


def test_a_second_signal_ends_a_block_that_hangs() -> None:
    process = start("hangs")
    assert process.stdout is not None
    process.send_signal(signal.SIGTERM)
    assert process.stdout.readline() == "heard\n"
    time.sleep(0.2)
    assert process.poll() is None  # it hangs all the same
    process.send_signal(signal.SIGTERM)
    output, _ = process.communicate(timeout=240)
    assert output.splitlines() == [
        *["stop cycle"] * 5,
        "close",
        "block 'robot' failed at tick 20 (0.040 s): KeyboardInterrupt",
    ]
    assert process.returncode == 143


def test_stop_cycles_that_hang_can_be_ended_one_by_one() -> None:
    process = start("stop_hangs")
    assert process.stdout is not None
    process.send_signal(signal.SIGINT)
    for _ in range(5):
        assert process.stdout.readline() == "stop cycle\n"
        time.sleep(0.05)
        process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=240)
    assert output.splitlines() == ["close", "stopped by SIGINT"]
    assert process.returncode == 130


def test_a_burst_of_signals_never_keeps_stop_cycles_from_going_out() -> None:
    process = start("burst")
    pauses = random.Random(0)
    for _ in range(40):
        process.send_signal(signal.SIGINT)
        time.sleep(pauses.uniform(0.0, 0.001))
    output, _ = process.communicate(timeout=240)
    # Each of the five was done, or was itself what a signal broke off: in the block, or in the
    # runtime around it. Most go out.
    done, broken_off = output.count("stop cycle\n"), output.count("KeyboardInterrupt")
    assert done >= 3 and done + broken_off >= 5, output
    assert "close\n" in output or "failed in close: KeyboardInterrupt" in output
    assert process.returncode == 130


def test_handlers_are_restored() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    clock = Clock(0.002)
    with Interrupts(clock, LifeCycle({})) as interrupts:
        assert signal.getsignal(signal.SIGTERM) != before[1]
        os.kill(os.getpid(), signal.SIGTERM)
        for _ in range(1000):  # handlers run between bytecodes
            if interrupts.received:
                break
        assert interrupts.received is signal.SIGTERM
        assert clock.stop_reason == "stopped by SIGTERM"
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_in_another_thread_no_handler_is_touched() -> None:
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def work() -> None:
        with Interrupts(Clock(0.002), LifeCycle({})):
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [before]
