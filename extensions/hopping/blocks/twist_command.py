"""Jump commands from a commanded velocity: of a stick, a pad on a page, or another program."""

from __future__ import annotations

from ....mathematics.kernel import kernel
from ....runtime.language.block import Block, Input, Output, State
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import Field, Signal
from ..signals import BodyTwist, JumpCommand, PlanRequest


class TwistTaken(Signal):
    """The state of ``TwistCommand``."""

    last = Field(3, text="the command of the last tick: ahead, aside [m] and turn [rad]")
    taken = Field(3, text="the command that was taken last")
    number = Field(dtype="int64", text="its number")


class TwistCommand(Block):
    """Commands one jump after the other as long as a velocity is commanded.

    A jump goes as far as the velocity leads in ``jump_time``, which is the time from one jump to the next. As long as a
    velocity is commanded there is a next command, with the velocity of the moment. It is withdrawn when the
    velocity ends. Where the velocity has changed by more than ``change`` after a command was
    taken, a command that ``replaces`` it is given; ``SteeredPlan`` takes it if that jump has not begun. An upward velocity alone is a
    jump on the spot. What is out of reach is the planner's to shorten.
    """

    class Params(Parameters):
        jump_time: float = parameter(
            1.6, unit="s", gt=0.0, le=10.0, text="from one jump to the next one"
        )
        least: float = parameter(0.02, unit="m", ge=0.0, le=0.2, text="shorter jumps are none")
        least_turn: float = parameter(
            0.05, unit="rad", ge=0.0, le=0.5, text="smaller turns on the spot are none"
        )
        change: float = parameter(
            0.2, gt=0.0, le=1.0, text="change of a command that replaces it, as a share of `most`"
        )
        most: float = parameter(0.3, unit="m", gt=0.0, le=1.0, text="the longest jump")
        most_turn: float = parameter(0.8, unit="rad", gt=0.0, le=3.2, text="the largest turn")

    params: Params
    twist = Input(BodyTwist, text="the commanded velocity")
    taken = Input(PlanRequest, text="the last request, by the number of its command")
    command = Output(JumpCommand, text="the next jump; the number of one that was taken: none")
    memory = State(TwistTaken, text="last commands taken")

    @kernel
    @staticmethod
    def step(
        twist: BodyTwist,
        taken: PlanRequest,
        command: JumpCommand,
        memory: TwistTaken,
        params: Params,
    ) -> None:
        if taken.command != memory.number:
            memory.number = taken.command
            memory.taken[:] = memory.last
        most, turn = params.most, params.most_turn
        command.ahead = min(max(twist.linear[0] * params.jump_time, -most), most)
        command.aside = min(max(twist.linear[1] * params.jump_time, -most), most)
        command.turn = min(max(twist.angular[2] * params.jump_time, -turn), turn)
        command.up, command.placed, command.replaces = 0.0, False, False
        moves = max(abs(command.ahead), abs(command.aside)) >= params.least
        if moves or abs(command.turn) >= params.least_turn or twist.linear[2] > 0.0:
            command.number = memory.number + 1
            apart = max(abs(command.ahead - memory.taken[0]), abs(command.aside - memory.taken[1]))
            turned = abs(command.turn - memory.taken[2])
            changed = apart > params.change * most or turned > params.change * turn
            command.replaces = taken.waits and changed
        else:
            command.number = memory.number
        memory.last[0], memory.last[1], memory.last[2] = command.ahead, command.aside, command.turn
