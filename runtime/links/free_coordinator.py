"""Keeps parts of a graph together that run free: they start together, and each keeps its own time."""

from __future__ import annotations

import threading

from ..language.errors import AloftError
from ..running.sink import Note
from .coordinator import LockstepCoordinator
from .peers import PartPhase

BEACON_PERIOD = 0.5
"""Seconds between two beacons during the run, from which clock offsets are estimated."""


class FreeRunningCoordinator(LockstepCoordinator):
    """Starts the parts together, as in lockstep, and then lets each keep its own time.

    A tick waits for nobody. A part whose run ends in order ends the others too, as no robot may run on
    without its controller, nor a controller on measurements that stand still; and so does a fault.
    Only a part that has run its whole length and sends the others nothing ends alone. One that is gone
    ends nobody: the policies of its links for late messages hold, and it may come back. Beacons
    during the run are sent by a thread of their own.
    """

    _quiet: threading.Event | None = None

    def listen(self) -> None:
        """Do nothing: a tick ends when it ends here."""

    def reach_phase(self, phase: PartPhase) -> None:
        """Wait for the others; a part that moves actuators does not join a run that goes on.

        Raises:
            AloftError: the others are running, and this part has actuators.
        """
        if phase is PartPhase.PREPARED and self.moves and self.peers.are_running():
            raise AloftError(
                "the other machines are running already, and this part moves actuators, which it "
                "never enables by itself. Stop the run everywhere and start it again"
            )
        super().reach_phase(phase)
        if phase is PartPhase.STARTED:
            self._quiet = threading.Event()
            threading.Thread(target=self._repeat, args=(self._quiet,), daemon=True).start()

    def _repeat(self, quiet: threading.Event) -> None:
        while not quiet.wait(BEACON_PERIOD):
            self.peers.send_beacon()

    def update(self) -> None:
        """Look whether another part has ended or failed and whether commands still come, and take
        over changed parameters.

        Raises:
            PeerError: another part failed.
        """
        clock = self._clock
        ended = self.peers.ended() or self._links.watch.complaint()
        if ended:
            clock.stop_reason = ended
        if clock.stop_request is not None:
            clock.agree(*clock.stop_request)
        if self._parameters.handed_in:
            self._change(clock.tick)

    def _change(self, tick: int) -> None:
        adjustment = self._parameters.proposal()
        if adjustment is None:
            return
        away = [path for path in adjustment.params if path in self.elsewhere]
        if away:
            adjustment.error = (
                f"block '{away[0]}' runs on {self.elsewhere[away[0]]}, and parts that run free "
                "change only their own parameters; change it there"
            )
        else:
            adjustment.error = self._parameters.try_out(adjustment)
            if not adjustment.error:
                self._parameters.keep(tick + 1)
        adjustment.answered = True

    def report_fault(self, note: Note, last_recorded: int) -> None:
        """Tell the others of a fault here, by a beacon."""
        known = self.peers.started and self.peers.fault_received
        if self._opened and not self._fault_reported and not known:
            self._fault_reported = True
            self.peers.send_beacon(str(note.data.get("message", note.text)))

    def close(self) -> None:
        """Stop the beacons, and disconnect as in lockstep."""
        if self._quiet is not None:
            self._quiet.set()
        super().close()

    def _ends_alone(self) -> bool:
        failed = self._fault_reported or self.peers.fault_received
        ran_whole = self.peers.started and self._clock.stop_request is None and not failed
        return ran_whole and not self._links.senders
