"""The path from the force on a foot's switch to its reading, besides threshold and bounce."""

from __future__ import annotations

import math

from ...mathematics.arrays import Array, Flags, Flags1D
from ...mathematics.compiling.call_sequence import Call
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...runtime.language.steps import signal_call
from .effect import Effect, StepViews
from .effects import SwitchEffects
from .state import PhysicsState


@kernel
def settle_switches(pressed: Flags1D, debounce: int, sticking: int, memory: PhysicsState) -> None:
    """Update ``memory.switch_closed`` after a physics step: a change counts once it has lasted for
    ``debounce`` steps, and that of a switch that opens for ``sticking`` steps more."""
    for point in range(pressed.shape[0]):
        if pressed[point] == memory.switch_closed[point]:
            memory.switch_waits[point] = 0
            continue
        memory.switch_waits[point] += 1
        wait = debounce if pressed[point] else debounce + sticking
        if memory.switch_waits[point] > wait:
            memory.switch_closed[point] = pressed[point]
            memory.switch_waits[point] = 0


class SwitchDelays(Effect):
    """The delays of all switches of a robot.

    Args:
        effects: how long they are.
        timestep: of the physics [s].
        memory: what the switches read, and for how long another reading waits.

    Attributes:
        closed: what the switches read before they bounce, (n_contacts,).
    """

    def __init__(self, effects: SwitchEffects, timestep: float, memory: PhysicsState) -> None:
        self.closed: Flags = memory.switch_closed
        self._memory = memory
        self._debounce = math.ceil(effects.debounce / timestep - 1e-9)
        self._sticking = math.ceil(effects.sticking / timestep - 1e-9)

    def begin(self, position: Array) -> None:
        """No switch is closed."""
        self._memory.switch_closed[:] = False
        self._memory.switch_waits[:] = 0

    def seen(self, views: StepViews) -> StepViews:
        """Return the views with the switches as late as they are."""
        return views._replace(closed=self.closed)

    def reading_calls(self, views: StepViews) -> list[Call]:
        """Update ``closed``."""
        return [self.settle_call(views.closed)]

    def settle_call(self, pressed: Flags) -> KernelCall:
        """Return the call that updates ``closed`` after a physics step."""
        return signal_call(settle_switches, pressed, self._debounce, self._sticking, self._memory)
