"""For how long something has held."""

from __future__ import annotations

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from .flags import Flag
from .number import Seconds, Tally


class Timer(Block):
    """For how long ``u`` has held without a break: 0 in the first run in which it holds.

    ``done`` says whether u holds and that is at least ``duration``. Time is counted in whole runs,
    so it has no error of rounding that grows.
    """

    class Params(Parameters):
        duration: float = live_parameter(
            1.0, unit="s", ge=0.0, text="how long it must hold to be done"
        )

    params: Params
    u = Input(Flag, text="what must hold")
    elapsed = Output(Seconds, text="for how long it has held; 0 where it does not")
    done = Output(Flag, text="whether it has held long enough")
    x = State(Tally, text="runs in which it has held")

    def step(self) -> None:
        """Count the runs."""
        count = int(self.x.count) + 1 if self.u.value else 0
        self.x.count[...] = count
        elapsed = max(count - 1, 0) * self.period
        self.elapsed.value.fill(elapsed)
        self.done.value[...] = count > 0 and elapsed >= self.params.duration - 1e-6 * self.period
