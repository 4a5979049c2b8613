"""Detects by bouncing switches which contact points carry load."""

from __future__ import annotations

from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, live_parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ContactState, ContactSwitches, SwitchFault, SwitchHealth


class ContactTimers(Signal):
    """Time that each switch has been open or closed, and the points in contact."""

    closed = Field("n_contacts", dtype="int64", text="ticks in a row a switch has been closed")
    opened = Field("n_contacts", dtype="int64", text="ticks in a row it has been open")
    active = Field("n_contacts", dtype="bool", text="the point is in contact")


class ContactDetector(Block):
    """Debounces the switch of every contact point separately (paper, II-A).

    A point becomes active once its switch has been closed for ``close_samples`` ticks in a row, and
    stays active until the switch has been open for longer than ``hold``. So a bouncing switch does
    not interrupt a contact, and a foot that lands toe first is in contact at its toe only: the
    points of a foot do not influence one another.

    ``SwitchMonitor`` finds the switches that are not to be believed: one at fault counts as open, and a heavy one as
    closed.

    The hold delays the report of a lift-off by the same time; a block that needs lift-off sooner
    reads the switches or the plan's time. The block does not estimate forces.
    """

    class Params(Parameters):
        hold: float = live_parameter(
            0.03,
            unit="s",
            ge=0.0,
            text="time for which a point stays active after its switch opens",
        )
        close_samples: int = live_parameter(
            1, ge=1, text="ticks a switch must be closed before its point is active"
        )

    class Constants(Signal):
        """Constants derived from the parameters."""

        hold_samples = Field(dtype="int64", text="ticks a point stays active with an open switch")

    params: Params
    constants: Constants

    switches = Input(ContactSwitches, text="the raw switches")
    faults = Input(SwitchHealth, default={}, text="switches that are not to be believed")
    state = Output(ContactState, text="points that carry load")
    timers = State(ContactTimers, text="one timer a point")

    def prepare(self) -> None:
        self.constants.hold_samples = round(self.params.hold / self.period)

    @kernel
    @staticmethod
    def step(
        switches: ContactSwitches,
        faults: SwitchHealth,
        state: ContactState,
        timers: ContactTimers,
        params: Params,
        constants: Constants,
    ) -> None:
        for point in range(switches.closed.shape[0]):
            fault = faults.fault[point]
            if fault == SwitchFault.HEAVY or (switches.closed[point] and fault == SwitchFault.NONE):
                timers.closed[point] += 1
                timers.opened[point] = 0
                if timers.closed[point] >= params.close_samples:
                    timers.active[point] = True
            else:
                timers.closed[point] = 0
                timers.opened[point] += 1
                if timers.opened[point] > constants.hold_samples:
                    timers.active[point] = False
        state.active[:] = timers.active
