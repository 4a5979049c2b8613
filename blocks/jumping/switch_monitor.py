"""Finds foot switches that are stuck or bounce."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...mathematics.arrays import (
    Array0D,
    Array1D,
    Flags0D,
    Flags1D,
    Indices0D,
    Indices1D,
)
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...runtime.language.block import Input, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ContactSwitches, Phase, PhaseState, SwitchFault, SwitchHealth

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


class SwitchLimits(NamedTuple):
    """Ticks in the air and of standing after which a switch is stuck, 0 for never; the time before
    touchdown [s] in which it may close; by which factor the count of changes falls in a tick; and the
    changes that a good switch may have made."""

    air: int
    stand: int
    approach: float
    fading: float
    changes: float


class Watched(NamedTuple):
    """What is kept of the switches: see ``SwitchMemory``."""

    started: Flags0D
    last: Flags1D
    changes: Array1D
    closed: Indices1D
    opened: Indices1D
    fault: Indices1D


class SwitchMonitor(KernelBlock):
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
        limits = SwitchLimits(
            round(p.air_time / self.period),
            0 if p.stand_time is None else max(1, round(p.stand_time / self.period)),
            p.approach,
            np.exp(-self.period / p.bounce_window).item(),
            p.bounce_changes,
        )
        watched = Watched(*(getattr(memory, name) for name in Watched._fields))
        watching = KernelCall(
            watch_switches, self.switches.closed, self.phase.phase, self.phase.time_to_touchdown,
            limits, watched, self.health.fault, self.health.stop,
        )  # fmt: skip
        self.kernel_calls = (watching,)


@kernel
def watch_switches(
    switches: Flags1D,
    phase: Indices0D,
    time_to_touchdown: Array0D,
    limits: SwitchLimits,
    watched: Watched,
    fault: Indices1D,
    stop: Flags0D,
) -> None:
    """Update what is kept of all switches in a tick, and write what is wrong to ``fault`` and ``stop``.

    Args:
        switches: which are closed, (n_contacts,).
        phase: see ``Phase``, ().
        time_to_touchdown: in flight [s], ().
    """
    now = phase[()]
    in_the_air = now == _FLIGHT and time_to_touchdown[()] > limits.approach
    found = False
    for k in range(switches.shape[0]):
        closed = bool(switches[k])
        changed = bool(watched.started[()]) and closed != bool(watched.last[k])
        watched.last[k] = closed
        watched.changes[k] = watched.changes[k] * limits.fading + (1.0 if changed else 0.0)
        watched.closed[k] = watched.closed[k] + 1 if in_the_air and closed else 0
        watched.opened[k] = watched.opened[k] + 1 if now == _STAND and not closed else 0
        if watched.fault[k] == 0:
            if watched.changes[k] > limits.changes:
                watched.fault[k] = _BOUNCING
            elif watched.closed[k] > limits.air:
                watched.fault[k] = _CLOSED
            elif 0 < limits.stand < watched.opened[k]:
                watched.fault[k] = _OPEN
        fault[k] = watched.fault[k]
        found = found or fault[k] != 0
    watched.started[()] = True
    stop[()] = found and now != _FLIGHT and now != _LANDING
