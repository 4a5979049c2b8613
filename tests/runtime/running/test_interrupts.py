"""Real signals to a real process: a clean stop within a tick, stop cycles, exit codes."""

import os
import random
import signal
import subprocess
import sys
import threading
import time

import pytest

from aloft.runtime.language.block import Clock
from aloft.runtime.running.interrupts import Interrupts
from aloft.runtime.running.life_cycle import LifeCycle

PROGRAM = """
import signal, sys, time
from aloft.runtime.language.block import Block, Output
from aloft.runtime.running.executor import run
from aloft.blocks.general.vector import Vector
from aloft.runtime.language.stages import ClockSpec
from aloft.runtime.testing.graphs import Use, checked_graph

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

graph = checked_graph({"robot": Use(Robot)}, dimensions={"n": 1}, clock=ClockSpec("paced"))
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
    output, _ = process.communicate(timeout=240)
    name = signal.Signals(number).name
    assert output.splitlines() == [*["stop cycle"] * 5, "close", f"stopped by {name}"]
    assert process.returncode == code


def test_the_first_ctrl_c_says_what_happens() -> None:
    process = start("runs")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=240)
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


@pytest.mark.parametrize("seed", range(3))
def test_a_burst_of_signals_never_keeps_stop_cycles_from_going_out(seed: int) -> None:
    process = start("burst")
    pauses = random.Random(seed)
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
