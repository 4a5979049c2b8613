"""Commands of jumps from a list, each at its time or when the one before has been taken."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ....mathematics.arrays import Array1D, Array2D, Flags1D
from ....mathematics.kernel import kernel
from ....mathematics.ticks import first_tick
from ....runtime.language.block import Block, Context, Input, Output, State
from ....runtime.language.context import Clock
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import Field, Signal
from ..signals import JumpCommand, PlanRequest


class TimedCommand(Parameters):
    """One command."""

    at: float = parameter(0.0, unit="s", ge=0.0, text="not before this time of the run")
    ahead: float = parameter(0.0, unit="m", ge=-100.0, le=100.0, text="distance ahead")
    aside: float = parameter(0.0, unit="m", ge=-100.0, le=100.0, text="distance to the left")
    turn: float = parameter(0.0, unit="rad", ge=-3.2, le=3.2, text="turn to the left")
    up: float = parameter(
        0.0,
        unit="m",
        ge=-10.0,
        le=10.0,
        text="height of the ground there above that of the last landing",
    )
    placed: bool = parameter(
        False,
        text="the place is x, y, heading and height in the world, where the run began at zero",
    )
    replaces: bool = parameter(
        False, text="takes the place of the command before, if its jump has not begun"
    )


class CommandRows(NamedTuple):
    """The commands: ``at`` (n,) [s]; ``jumps`` (n, 4), ahead, aside [m], turn [rad] and up [m]; ``placed`` and
    ``replaces`` (n,)."""

    at: Array1D
    jumps: Array2D
    placed: Flags1D
    replaces: Flags1D


class CommandsGiven(Signal):
    """The state of ``CommandSchedule``."""

    given = Field(dtype="int64", text="number of commands given so far")


class CommandSchedule(Block):
    """Gives commands of jumps one after the other.

    The first is given at its time ``at``. Each of the others is given at its time, but not before a jump has
    been asked for by the one before: ``taken`` is the request of ``SteeredPlan``. So a list without times
    is a course in which each jump becomes known when the one before has landed.
    """

    class Params(Parameters):
        commands: tuple[TimedCommand, ...] = parameter(
            (), text="in the order in which they are given"
        )

    params: Params

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        """Export the ``count`` of commands."""
        assert isinstance(params, cls.Params)
        return {"count": len(params.commands)}

    taken = Input(PlanRequest, text="the last request, by the number of its command")
    command = Output(JumpCommand, text="the command that holds; number zero: none yet")
    memory = State(CommandsGiven, text="number of commands given")

    def setup(self) -> None:
        given = self.params.commands
        self.rows = CommandRows(
            np.array([one.at for one in given], dtype=np.float64),
            np.array([[c.ahead, c.aside, c.turn, c.up] for c in given]).reshape(-1, 4),
            np.array([c.placed for c in given], dtype=np.bool_),
            np.array([c.replaces for c in given], dtype=np.bool_),
        )

    @kernel
    @staticmethod
    def step(
        taken: PlanRequest,
        command: JumpCommand,
        memory: CommandsGiven,
        rows: CommandRows,
        clock: Clock,
    ) -> None:
        number = memory.given
        if (
            number < rows.at.shape[0]
            and taken.command >= number
            and clock.tick >= first_tick(rows.at[number], clock.base_period)
        ):
            memory.given = number + 1
        command.number = memory.given
        command.placed, command.replaces = False, False
        command.ahead, command.aside, command.turn, command.up = 0.0, 0.0, 0.0, 0.0
        if memory.given > 0:
            last = memory.given - 1
            command.placed, command.replaces = rows.placed[last], rows.replaces[last]
            command.ahead, command.aside = rows.jumps[last, 0], rows.jumps[last, 1]
            command.turn, command.up = rows.jumps[last, 2], rows.jumps[last, 3]
