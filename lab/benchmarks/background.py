"""Cost of a block in the background to the control thread, and the late ticks beside it.

The graph is the whole jump's in real time, without the score that would end it; so the control thread
has its real work. Runs with and without a block that computes two thirds of the time take turns.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from ...runtime.background.background_block import Background, background_block_type
from ...runtime.language.block import Block, Input, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ...runtime.language.stages import BlockSpec, CheckedGraph, ClockSpec
from ...runtime.running.executor import Executor
from ...runtime.running.timing import block_times
from .recorder import endless_jump
from .rows import Row

PERIOD = 0.06
"""The block's period and its latency [s]."""


class Values(Signal):
    """A signal of as many numbers as a plan's knots may take."""

    value = Field(200, text="numbers")


class Busy(Block):
    """Computes for a while: a planner of sorts."""

    class Params(Parameters):
        time: float = parameter(0.04, text="the processor time of a run", unit="s")

    params: Params
    u = Input(Values, default={}, text="read by nobody")
    y = Output(Values, text="the runs so far")

    def setup(self) -> None:
        self._matrix = np.eye(60)

    def step(self) -> None:
        end = time.thread_time() + self.params.time
        while time.thread_time() < end:
            np.linalg.solve(self._matrix, self._matrix)
        self.y.value[:] += 1.0


def with_busy_block(graph: CheckedGraph) -> CheckedGraph:
    """Add a block in the background that nothing reads."""
    runs = round(PERIOD * graph.base_rate)
    kind = background_block_type(Busy, Background(1, late="hold"))
    busy = BlockSpec("busy", kind, Busy.Params(), {}, {}, runs)
    return replace(graph, blocks=(busy, *graph.blocks), order=("busy", *graph.order))


def background(seconds: float = 10.0, rounds: int = 3) -> list[Row]:
    """Measure and return the rows.

    Args:
        seconds: how long each run in real time is.
        rounds: of one run with the block and one without.
    """
    alone = endless_jump()
    cases = {"without": alone, "with": with_busy_block(alone)}
    ticks = round(seconds * alone.base_rate)
    late = {name: np.zeros(rounds) for name in cases}
    costs, results = [], 0
    for turn in range(rounds):
        for name in sorted(cases, reverse=bool(turn % 2)):
            executor = Executor(cases[name], clock=ClockSpec("paced"), log=False)
            result = executor.run(ticks)
            result.raise_if_failed()
            late[name][turn] = 1e3 * result.overruns / result.ticks
            if name == "with":
                costs.append(block_times(executor.ticker.programs, "busy"))
                results += int(result.metrics["late_results"])
    mean = {name: float(values.mean()) for name, values in late.items()}
    what = f"{rounds} runs of {seconds:g} s each; {mean['without']:.3g} without"
    return [
        Row("sampling and showing", float(np.median([c.p50_us for c in costs])), "us a run",
            note="200 numbers there and back, on the control thread"),
        Row("late ticks beside 40 ms of work every 60 ms", mean["with"], "in 1000",
            peer="the same graph without the block",
            ratio=mean["with"] / mean["without"] if mean["without"] else None, goal=1.0, note=what),
        Row("late results", float(results), "", note=f"of {rounds * int(seconds / PERIOD)}"),
    ]  # fmt: skip
