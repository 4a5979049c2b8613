"""Finds foot switches that are stuck or bounce."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ContactSwitches, Phase, PhaseState, SwitchFault, SwitchHealth

Array = NDArray[np.float64]
Counts = NDArray[np.int64]
Flags = NDArray[np.bool_]

_CLOSED, _OPEN = int(SwitchFault.STUCK_CLOSED), int(SwitchFault.STUCK_OPEN)
_BOUNCING = int(SwitchFault.BOUNCING)
_STAND, _FLIGHT, _LANDING = int(Phase.STAND), int(Phase.FLIGHT), int(Phase.LANDING)


class SwitchMemory(Signal):
    """The state of ``SwitchMonitor``."""

    last = Field("n_contacts", dtype="bool", text="whether each switch was closed in the last tick")
    started = Field(dtype="bool", text="whether there was a last tick")
    changes = Field("n_contacts", text="recent changes of each switch, older ones count less")
    closed = Field("n_contacts", dtype="int64", text="ticks in a row it was closed in the air")
    opened = Field("n_contacts", dtype="int64", text="ticks in a row it was open under a stand")
    fault = Field("n_contacts", dtype="int64", values=SwitchFault, text="what is wrong with it")


class Watched(NamedTuple):
    """What is kept of every switch, each (n_contacts,): see ``SwitchMemory``."""

    last: Flags
    changes: Array
    closed: Counts
    opened: Counts
    fault: Counts


class SwitchMonitor(Block):
    """Compares each foot switch with the phase of the jump, and with itself.

    * **Stuck closed**: in the air, it was closed for ``air_time`` in a row, all of it more than
      ``approach`` before the predicted touchdown.
    * **Stuck open**: while the robot stands before a jump, it was open for ``stand_time`` in a row.
      By default this is not judged, for it needs a robot that loads all its points when it stands.
    * **Bouncing**: the number of its changes, of which those ``bounce_window`` ago count by 1/e, is
      above ``bounce_changes``. A good switch with a load near its threshold chatters too: BRUCE's
      toes make up to 31 changes in a thrust on the spot, in simulation.

    A fault stays to the end of the run. The switches of ``health`` that are at fault are ignored by
    ``ContactDetector`` from the next tick on; ``stop`` asks ``SafetyMonitor`` to end the run. It is
    held back in flight and in the landing, in which damping would do more harm than a missing switch.

    A switch that sticks where it should be anyway is found when that changes, so one that is stuck
    closed is found in the first flight and not before.
    """

    class Params(Parameters):
        air_time: float = parameter(
            0.08, unit="s", gt=0.0, text="a switch closed for so long in the air is stuck"
        )
        approach: float = parameter(
            0.03, unit="s", ge=0.0, text="before touchdown by so much it may close"
        )
        stand_time: float | None = parameter(
            None, unit="s", gt=0.0,
            text="a switch open for so long while the robot stands is stuck; none: not judged",
        )  # fmt: skip
        bounce_window: float = parameter(
            0.8, unit="s", gt=0.0, text="the time in which changes are counted"
        )
        bounce_changes: float = parameter(
            80.0, gt=0.0, text="a switch with more changes in that time bounces"
        )

    params: Params
    switches = Input(ContactSwitches, text="the raw switches")
    phase = Input(PhaseState, text="the phase the robot is in")
    health = Output(SwitchHealth, text="which switches are at fault")
    memory = State(SwitchMemory, text="counts, and the faults found")

    def setup(self) -> None:
        p, memory = self.params, self.memory
        self._air = round(p.air_time / self.period)
        self._stand = 0 if p.stand_time is None else max(1, round(p.stand_time / self.period))
        self._fading = np.exp(-self.period / p.bounce_window).item()
        self._watched = Watched(*(getattr(memory, name) for name in Watched._fields))

    def step(self) -> None:
        memory, phase = self.memory, int(self.phase.phase)
        if not memory.started[()]:
            memory.last[...] = self.switches.closed
            memory.started[()] = True
        in_the_air = phase == _FLIGHT and float(self.phase.time_to_touchdown) > self.params.approach
        found = watch_switches(
            self.switches.closed, in_the_air, phase == _STAND, self._air, self._stand, self._fading,
            self.params.bounce_changes, self._watched,
        )  # fmt: skip
        self.health.fault[...] = memory.fault
        self.health.stop[()] = found and phase not in (_FLIGHT, _LANDING)


@kernel
def watch_switches(
    switches: Flags,
    in_the_air: bool,
    stands: bool,
    air: int,
    stand: int,
    fading: float,
    most: float,
    watched: Watched,
) -> bool:
    """Update the counts and faults of all switches in a tick; returns whether any is at fault.

    Args:
        switches: which are closed, (n_contacts,).
        in_the_air: no switch should be closed.
        stands: all should be.
        air, stand: ticks after which a switch that is not as it should be is stuck; 0: never.
        fading: by which the count of changes falls in a tick.
        most: changes that a good switch may have made.
    """
    any_fault = False
    for k in range(switches.shape[0]):
        closed = bool(switches[k])
        changed = closed != bool(watched.last[k])
        watched.last[k] = closed
        watched.changes[k] = float(watched.changes[k]) * fading + (1.0 if changed else 0.0)
        watched.closed[k] = int(watched.closed[k]) + 1 if in_the_air and closed else 0
        watched.opened[k] = int(watched.opened[k]) + 1 if stands and not closed else 0
        if watched.fault[k] == 0:
            if watched.changes[k] > most:
                watched.fault[k] = _BOUNCING
            elif watched.closed[k] > air:
                watched.fault[k] = _CLOSED
            elif stand > 0 and watched.opened[k] > stand:
                watched.fault[k] = _OPEN
        any_fault = any_fault or watched.fault[k] != 0
    return any_fault
