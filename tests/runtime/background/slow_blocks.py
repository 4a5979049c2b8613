"""Blocks of a user that the tests move to the background."""

import os
import signal
import time

import numpy as np

from aloft import (
    Block,
    BlockError,
    Field,
    Input,
    Output,
    Parameters,
    Signal,
    State,
    kernel,
    live_parameter,
    parameter,
)


class Number(Signal):
    """A number and a vector."""

    value = Field(text="a number")


class Pair(Signal):
    """Values of several types."""

    vector = Field(3, text="numbers")
    count = Field(dtype="int64", text="a count")
    positive = Field(dtype="bool", text="a sign")


class Wave(Block):
    """A source."""

    y = Output(Number, text="a sine")

    def step(self) -> None:
        self.y.value[()] = np.sin(3.0 * self.time)


class Sum(Block):
    """Two numbers together."""

    a = Input(Number, text="a number")
    b = Input(Number, text="another")
    y = Output(Number, text="their sum")

    def step(self) -> None:
        self.y.value[()] = self.a.value + self.b.value


class Slow(Block):
    """Sums what it reads, and fails, ends the run, hangs or dies when told to."""

    class Params(Parameters):
        gain: float = live_parameter(1.0, text="times the input")
        fail_at: int = parameter(-1, text="the tick in which it raises")
        stop_at: int = parameter(-1, text="the tick in which it ends the run")
        sleep_at: int = parameter(-1, text="the tick in which it sleeps")
        sleep: float = parameter(60.0, text="how long", unit="s")
        broken: bool = parameter(False, text="whether it cannot be set up")
        die_at: int = parameter(-1, text="the tick in which its process is killed")

    params: Params
    u = Input(Number, text="what is summed")
    bias = Input(Number, default={"value": 0.25}, text="added in every run")
    y = Output(Number, text="the sum")
    pair = Output(Pair, text="values of several types")
    total = State(Number, text="the sum")

    def setup(self) -> None:
        if self.params.broken:
            raise BlockError("the spring is missing")
        self.total.value[()] = 1.0
        self.pair.vector[:] = 5.0  # of which a run writes a part only

    def prepare(self) -> None:
        if self.params.gain == 7.0:
            raise BlockError("seven is refused")

    def step(self) -> None:
        if self.tick == self.params.fail_at:
            raise ValueError("the spring broke")
        if self.tick == self.params.stop_at:
            self.request_stop("counted enough")
        if self.tick == self.params.sleep_at:
            time.sleep(self.params.sleep)
        if self.tick == self.params.die_at:
            os.kill(os.getpid(), signal.SIGKILL)
        self.total.value += self.params.gain * self.u.value + self.bias.value + self.time
        self.y.value[()] = self.total.value
        self.pair.count += 1
        self.pair.positive[()] = self.u.value > 0.0
        self.pair.vector[self.tick % 3] = self.total.value

    def metrics(self) -> dict[str, float]:
        return {"total": float(self.total.value)}


class Follower(Block):
    """A Moore block whose state is in its process, and is saved only for snapshots."""

    u = Input(Number, text="what is followed")
    y = Output(Number, text="the last inputs, weighted")
    kept = State(Number, text="for snapshots")

    def setup(self) -> None:
        self.last = 2.0

    def emit(self) -> None:
        self.y.value[()] = self.last

    def update(self) -> None:
        self.last = 0.5 * self.last + self.u.value.item()

    def save_state(self) -> None:
        self.kept.value[()] = self.last

    def load_state(self) -> None:
        self.last = self.kept.value.item()


class Filter(Block):
    """A kernel."""

    class Params(Parameters):
        share: float = live_parameter(0.1, text="of the new value")

    params: Params
    u = Input(Number, text="the input")
    y = Output(Number, text="the filtered input")
    x = State(Number, text="the last output")

    @kernel
    @staticmethod
    def step(u: Number, y: Number, x: Number, params: Params) -> None:
        x.value = x.value + params.share * (u.value - x.value)
        y.value = x.value


class Motor(Block):
    """What must come to rest: a file says so."""

    class Params(Parameters):
        file: str = parameter("", text="where it says so")

    params: Params
    u = Input(Number, text="the command")
    y = Output(Number, text="the place")
    x = State(Number, text="the place")

    def emit(self) -> None:
        self.y.value[()] = self.x.value

    def update(self) -> None:
        self.x.value += 0.01 * self.u.value

    def stop_cycle(self) -> None:
        if self.params.file:
            with open(self.params.file, "a", encoding="utf-8") as file:
                file.write("rests\n")


class Solver(Block):
    """The root of x^3 + x = u, found by CasADi."""

    u = Input(Number, text="the right side")
    y = Output(Number, text="the root")

    def setup(self) -> None:
        import casadi as ca

        x, u = ca.SX.sym("x"), ca.SX.sym("u")
        problem = {"x": x, "p": u, "g": x**3 + x - u}
        self._solve = ca.rootfinder("root", "newton", problem)

    def step(self) -> None:
        self.y.value[()] = float(self._solve(self.y.value.item(), self.u.value.item()))
