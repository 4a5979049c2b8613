"""What the tests of links share: blocks that fail or stop at will, and graphs of them."""

from collections.abc import Mapping

import numpy as np

from aloft import Block, BlockError, Field, Input, Output, Parameters, Signal, State, parameter
from aloft.blocks.general.arithmetic import Gain, Sum
from aloft.blocks.general.integrators_and_delays import Integrator
from aloft.blocks.general.sources import SineWave
from aloft.runtime.language.stages import CheckedGraph, Wire
from aloft.runtime.placement.placed import spread
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Number(Signal):
    value = Field(text="a number")
    spare = Field(3, dtype="int64", text="read by nobody")


class Read(Signal):
    value = Field(text="a number")


class Failing(Block):
    """Passes its input on, and fails, stops or writes NaN when told to."""

    class Params(Parameters):
        fail_at: int = parameter(-1, text="the tick at which it raises")
        stop_at: int = parameter(-1, text="the tick at which it ends the run")
        nan_at: int = parameter(-1, text="the tick at which its output is not a number")
        factor: float = parameter(1.0, le=10.0, live=True, text="times the input")

    params: Params
    u = Input(Read)
    y = Output(Number)

    def prepare(self) -> None:
        if self.params.factor == 7.0:
            raise BlockError("seven is refused")

    def step(self) -> None:
        if self.tick == self.params.fail_at:
            raise BlockError("the spring broke")
        if self.tick == self.params.stop_at:
            self.request_stop("counted enough")
        self.y.value[()] = self.u.value * self.params.factor
        if self.tick == self.params.nan_at:
            self.y.value[()] = np.nan


class Counter(Block):
    """Counts its ticks plus what it reads: a Moore block with a motor that must come to rest."""

    LOG: list[str] = []

    u = Input(Read, default={})
    y = Output(Number)
    count = State(Number)

    def start(self) -> None:
        self.LOG.append(f"{self.context.path} starts")

    def emit(self) -> None:
        self.y.value[()] = self.count.value

    def update(self) -> None:
        self.count.value += 1.0 + 0.1 * self.u.value

    def stop_cycle(self) -> None:
        self.LOG.append(f"{self.context.path} rests")

    def close(self) -> None:
        self.LOG.append(f"{self.context.path} closes")


def endpoints(*names: str) -> dict[str, str]:
    return {name: f"tcp/127.0.0.1:{7450 + k}" for k, name in enumerate(names)}


def ring(params: Mapping[str, object] | None = None, ticks: int = 40) -> CheckedGraph:
    """A robot on one machine, a controller of two blocks on two others: there and back in a tick."""
    graph = checked_graph(
        {
            "robot": BlockUse(Counter, {}, {"u": "last.y"}),
            "first": BlockUse(Failing, params or {}, {"u": "robot.y"}),
            "last": BlockUse(Failing, {}, {"u": "first.y"}),
        },
        ticks=ticks,
    )
    return spread(graph, endpoints("onboard", "near", "far"), {"first": "near", "last": "far"})


def random_graph(rng: np.random.Generator, blocks: int = 14, ticks: int = 60) -> CheckedGraph:
    """Blocks of both kinds at several rates with delays and loops, placed at random."""
    uses: dict[str, BlockUse] = {"wave": BlockUse(SineWave, {"n": 2, "frequency": 3.7})}
    names = [f"b{k}" for k in range(blocks)]
    moore = [bool(rng.random() < 0.3) for _ in names]
    for k, name in enumerate(names):
        period = int(rng.choice([1, 1, 1, 2, 3]))
        offset = int(rng.integers(0, period))

        def source(k: int = k) -> str | Wire:
            """Any block: a later one through a delay, unless it is a Moore block."""
            pick = int(rng.integers(-1, blocks))
            if pick < 0:
                return "wave.y"
            delay = int(rng.integers(1, 3)) if pick >= k and not moore[pick] else 0
            delay = delay or int(rng.random() < 0.1)
            return Wire(f"b{pick}.y", "", delay) if delay else f"b{pick}.y"

        if moore[k]:
            uses[name] = BlockUse(Integrator, {"n": 2}, {"u": source()}, period, offset)
        elif rng.random() < 0.5:
            uses[name] = BlockUse(Gain, {"n": 2, "gain": 0.9}, {"u": source()}, period, offset)
        else:
            uses[name] = BlockUse(
                Sum,
                {"n": 2, "weights": [0.5, -0.6]},
                {"a": source(), "b": source()},
                period,
                offset,
            )
    graph = checked_graph(uses, ticks=ticks)
    machines = endpoints(*"abcd"[: int(rng.integers(2, 5))])
    paths = [spec.path for spec in graph.blocks]
    return spread(graph, machines, {path: str(rng.choice(list(machines))) for path in paths})
