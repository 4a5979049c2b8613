"""Detects by bouncing switches which contact points carry load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.kernel import kernel
from ...runtime.language.block import Input, Output, State
from ...runtime.language.kernel_block import KernelBlock
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ContactState, ContactSwitches, SwitchHealth


class ContactTimers(Signal):
    """How long each switch has been open or closed, and which points are in contact."""

    closed = Field("n_contacts", dtype="int64", text="ticks in a row a switch has been closed")
    opened = Field("n_contacts", dtype="int64", text="ticks in a row it has been open")
    active = Field("n_contacts", dtype="bool", text="whether the point is in contact")


class ContactDetector(KernelBlock):
    """Debounces the switch of every contact point separately (paper, II-A).

    A point becomes active once its switch has been closed for ``close_samples`` ticks in a row, and
    stays active until the switch has been open for longer than ``hold``. So a bouncing switch does
    not interrupt a contact, and a foot that lands toe first is in contact at its toe only: the
    points of a foot do not influence one another.

    A switch that is said to be at ``fault`` counts as open (``SwitchMonitor``).

    The hold delays the report of a lift-off by the same time; a block that needs lift-off sooner
    reads the switches or the plan's time. The block does not estimate forces.
    """

    class Params(Parameters):
        hold: float = live_parameter(
            0.03, unit="s", ge=0.0, text="how long a point stays active after its switch opens"
        )
        close_samples: int = live_parameter(
            1, ge=1, text="ticks a switch must be closed before its point is active"
        )

    params: Params

    switches = Input(ContactSwitches, text="the raw switches")
    faults = Input(SwitchHealth, default={}, text="which switches are not to be believed")
    state = Output(ContactState, text="which points carry load")
    timers = State(ContactTimers, text="one timer a point")

    def setup(self) -> None:
        timers = self.timers
        self._close_samples, self._hold_samples = np.zeros(1, np.int64), np.zeros(1, np.int64)
        self.on_parameters()
        latching = KernelCall(
            latch, self.switches.closed, self.faults.fault, self._close_samples,
            self._hold_samples, timers.closed, timers.opened, timers.active, self.state.active,
        )  # fmt: skip
        self.kernel_calls = (latching,)

    def on_parameters(self) -> None:
        self._close_samples[0] = self.params.close_samples
        self._hold_samples[0] = round(self.params.hold / self.period)


@kernel
def latch(
    switches: NDArray[np.bool_],
    faults: NDArray[np.int64],
    close_samples: NDArray[np.int64],
    hold_samples: NDArray[np.int64],
    closed: NDArray[np.int64],
    opened: NDArray[np.int64],
    active: NDArray[np.bool_],
    out: NDArray[np.bool_],
) -> None:
    """Update ``closed``, ``opened`` and ``active`` (n_contacts,) by the switches of one tick.

    A switch with a fault counts as open. ``close_samples`` and ``hold_samples`` have one element;
    ``out`` becomes a copy of ``active``.
    """
    for point in range(switches.shape[0]):
        if switches[point] and faults[point] == 0:
            closed[point] += 1
            opened[point] = 0
            if closed[point] >= close_samples[0]:
                active[point] = True
        else:
            closed[point] = 0
            opened[point] += 1
            if opened[point] > hold_samples[0]:
                active[point] = False
        out[point] = active[point]
