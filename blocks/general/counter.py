"""How often something held."""

from __future__ import annotations

from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, parameter
from .flags import NEVER, Flag
from .number import Number, Tally


class Counter(Block):
    """In how many runs ``u`` held so far, this one included; from 0 again behind ``last``.

    Where ``reset`` holds the count is 0, whatever ``u`` is. To count how often something begins to
    hold put an ``EdgeDetector`` before it.
    """

    class Params(Parameters):
        last: int | None = parameter(
            None, ge=1, text="the greatest count, behind which it is 0 again"
        )

    params: Params
    u = Input(Flag, text="what is counted")
    reset = Input(Flag, text="whether to begin at 0 again", default=NEVER)
    y = Output(Number, text="the count")
    x = State(Tally, text="the count")

    def step(self) -> None:
        """Count."""
        count = int(self.x.count) + bool(self.u.value)
        if self.reset.value or (self.params.last is not None and count > self.params.last):
            count = 0
        self.x.count[...] = count
        self.y.value.fill(count)
