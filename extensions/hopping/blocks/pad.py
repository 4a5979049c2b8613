"""The velocity commanded on the page of a running graph."""

from __future__ import annotations

from ....mathematics.kernel import kernel
from ....runtime.language.block import Block, Output, State
from ....runtime.language.context import Clock
from ....runtime.language.parameters import Parameters, live_parameter, parameter
from ....runtime.language.signals import Field, Signal
from ..signals import BodyTwist


class PadHeld(Signal):
    """The state of ``Pad``."""

    beat = Field(dtype="int64", text="the last beat")
    since = Field(unit="s", text="time of its arrival")


class Pad(Block):
    """A velocity from live parameters, which the page of ``aloft run --live`` has a pad for.

    The page changes ``beat`` several times a second as long as the pad is held. When it has not changed for ``hold_time``, as where the page
    was closed or its machine is gone, the velocity is zero.
    """

    class Params(Parameters):
        ahead: float = live_parameter(0.0, unit="m/s", ge=-1.0, le=1.0, text="velocity ahead")
        aside: float = live_parameter(0.0, unit="m/s", ge=-1.0, le=1.0, text="velocity to the left")
        turn: float = live_parameter(0.0, unit="rad/s", ge=-2.0, le=2.0, text="turn to the left")
        beat: int = live_parameter(0, ge=0, text="changes as long as the pad is held")
        hold_time: float = parameter(
            1.0, unit="s", gt=0.0, le=10.0, text="time for which a beat holds"
        )

    params: Params
    twist = Output(BodyTwist, text="the commanded velocity")
    memory = State(PadHeld, text="the last beat")

    @kernel
    @staticmethod
    def step(twist: BodyTwist, memory: PadHeld, params: Params, clock: Clock) -> None:
        now = clock.base_period * clock.tick
        if params.beat != memory.beat:
            memory.beat = params.beat
            memory.since = now
        held = memory.beat > 0 and now - memory.since < params.hold_time
        twist.linear[:] = 0.0
        twist.angular[:] = 0.0
        if held:
            twist.linear[0], twist.linear[1] = params.ahead, params.aside
            twist.angular[2] = params.turn
