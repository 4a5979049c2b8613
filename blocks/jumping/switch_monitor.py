"""Finds foot switches that are stuck or bounce."""

from __future__ import annotations

from ...mathematics.elementary import exp
from ...mathematics.kernel import kernel
from ...runtime.language.block import Block, Input, Output, State
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from ..signals import ContactSwitches, Phase, PhaseState, SwitchFault, SwitchHealth


class SwitchMemory(Signal):
    """The state of ``SwitchMonitor``."""

    last = Field("n_contacts", dtype="bool", text="the switch was closed in the last tick")
    started = Field(dtype="bool", text="there was a last tick")
    changes = Field("n_contacts", text="recent changes of each switch, older ones count less")
    closed = Field("n_contacts", dtype="int64", text="ticks in a row it was closed in the air")
    opened = Field("n_contacts", dtype="int64", text="ticks in a row it was open under a stand")
    missing = Field("n_contacts", dtype="int64", text="ticks in all it was open under a stand")
    pressed = Field("n_contacts", dtype="bool", text="the switch was ever closed")
    heavy = Field("n_contacts", dtype="bool", text="the switch was open for long and is not stuck")
    fault = Field("n_contacts", dtype="int64", values=SwitchFault, text="fault of the switch")


class SwitchMonitor(Block):
    """Compares each foot switch with the phase of the jump, and with itself.

    * **Stuck closed**: in the air, it was closed for ``air_time`` in a row, all of it more than
      ``approach`` before the predicted touchdown.
    * **Stuck open**: while the robot stands before a jump, it was open for ``stand_time`` in a row after it had been
      closed with no more than ``few_changes``; or it was never closed before the robot was in the air.
      By default this is not judged, for it needs a robot that loads all its points when it stands.
    * **Heavy**, which is no fault: it was open for half of ``stand_time`` in all while the robot stood, so its threshold is
      about the load on its point or above. Where the plan has the robot stand, an open heavy switch means nothing,
      and its point counts as loaded: in ``STAND``, ``SQUAT`` and ``RECOVER``.
    * **Bouncing**: the number of its changes, of which those ``bounce_window`` ago count by 1/e, is
      above ``bounce_changes``. A good switch with a load near its threshold chatters too: BRUCE's
      toes make up to 31 changes in a thrust on the spot, in simulation.

    A fault stays to the end of the run. ``ContactDetector`` ignores the switches that are at fault in ``health``
    from the next tick on; ``stop`` asks ``SafetyMonitor`` to end the run. It is
    held back in flight and in the landing, in which damping would do more harm than a missing switch.

    A switch that sticks where it should be anyway is found when that changes, so one that is stuck
    closed is found in the first flight and not before. One that was open from the first tick on may be
    heavy, so it is found when a thrust has not closed it, and the robot lands on the others.
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
        few_changes: float = parameter(
            3.5,
            gt=0.0,
            text="a switch near its threshold has changed more often before it stays open",
        )
        bounce_window: float = parameter(
            0.8, unit="s", gt=0.0, text="the time in which changes are counted"
        )
        bounce_changes: float = parameter(
            80.0, gt=0.0, text="a switch with more changes in that time bounces"
        )

    class Constants(Signal):
        """Constants derived from the parameters."""

        air_samples = Field(dtype="int64", text="ticks closed in the air that are no fault yet")
        stand_samples = Field(dtype="int64", text="ticks open while standing; 0: not judged")
        fading = Field(unit="", text="share of the count of changes that stays in a tick")

    params: Params
    constants: Constants
    switches = Input(ContactSwitches, text="the raw switches")
    phase = Input(PhaseState, text="the phase the robot is in")
    health = Output(SwitchHealth, text="faults of the switches")
    memory = State(SwitchMemory, text="counts, and the faults found")

    def prepare(self) -> None:
        p, constants = self.params, self.constants
        constants.air_samples = round(p.air_time / self.period)
        if p.stand_time is not None:
            constants.stand_samples = max(1, round(p.stand_time / self.period))
        constants.fading = exp(-self.period / p.bounce_window)

    @kernel
    @staticmethod
    def step(
        switches: ContactSwitches,
        phase: PhaseState,
        health: SwitchHealth,
        memory: SwitchMemory,
        params: Params,
        constants: Constants,
    ) -> None:
        in_the_air = phase.phase == Phase.FLIGHT and phase.time_to_touchdown > params.approach
        stands = (
            phase.phase == Phase.STAND or phase.phase == Phase.SQUAT or phase.phase == Phase.RECOVER
        )
        found = False
        for k in range(switches.closed.shape[0]):
            closed = switches.closed[k]
            changed = memory.started and closed != memory.last[k]
            memory.last[k] = closed
            memory.changes[k] = memory.changes[k] * constants.fading + (1.0 if changed else 0.0)
            memory.closed[k] = memory.closed[k] + 1 if in_the_air and closed else 0
            memory.pressed[k] = memory.pressed[k] or closed
            if phase.phase == Phase.STAND and not closed:
                memory.opened[k] += 1
                memory.missing[k] += 1
            else:
                memory.opened[k] = 0
            if memory.fault[k] == 0:
                if memory.changes[k] > params.bounce_changes:
                    memory.fault[k] = SwitchFault.BOUNCING
                elif memory.closed[k] > constants.air_samples:
                    memory.fault[k] = SwitchFault.STUCK_CLOSED
                elif constants.stand_samples > 0:
                    stuck = in_the_air and not memory.pressed[k] and memory.missing[k] > 0
                    if memory.opened[k] > constants.stand_samples and not memory.heavy[k]:
                        memory.heavy[k] = (
                            not memory.pressed[k] or memory.changes[k] > params.few_changes
                        )
                        stuck = not memory.heavy[k]
                    if stuck:
                        memory.fault[k] = SwitchFault.STUCK_OPEN
            health.fault[k] = memory.fault[k]
            found = found or memory.fault[k] != 0
            heavy = 0 < constants.stand_samples < 2 * memory.missing[k]
            if heavy and stands and memory.fault[k] == 0:
                health.fault[k] = SwitchFault.HEAVY
        memory.started = True
        health.stop = found and phase.phase != Phase.FLIGHT and phase.phase != Phase.LANDING
