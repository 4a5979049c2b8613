"""Keeps the parts of a graph together where each runs on its own clock."""

from __future__ import annotations

import threading

from ..language.errors import AloftError
from ..running.notes import Note
from .conductor import Conductor
from .others import Phase

BEACON_PERIOD = 0.5
"""Seconds between two beacons during the run, from which clock offsets are estimated."""


class FreeConductor(Conductor):
    """Starts the parts together, as in lockstep, and then lets each keep its own time.

    A tick waits for nobody. A part whose run ends in order ends the others too, and so does a
    fault. One that is gone does not: what its links' policies say of late messages holds, and it
    may come back. Beacons during the run are sent by a thread of their own.
    """

    _quiet: threading.Event | None = None

    def listen(self) -> None:
        """Nothing to listen to: a tick ends when it ends here."""

    def reach(self, phase: Phase) -> None:
        """Wait for the others; a part that moves actuators does not join a run that goes on.

        Raises:
            AloftError: the others are running, and this part has actuators.
        """
        if phase is Phase.PREPARED and self.moves and self.others.are_running():
            raise AloftError(
                "the other machines are running already, and this part moves actuators, which it "
                "never enables by itself. Stop the run everywhere and start it again"
            )
        super().reach(phase)
        if phase is Phase.STARTED:
            self._quiet = threading.Event()
            threading.Thread(target=self._repeat, args=(self._quiet,), daemon=True).start()

    def _repeat(self, quiet: threading.Event) -> None:
        while not quiet.wait(BEACON_PERIOD):
            self.others.say()

    def update(self) -> None:
        """Look whether another part has ended or failed and whether commands still come, and take
        over changed parameters.

        Raises:
            PeerError: another part failed.
        """
        clock = self._clock
        ended = self.others.ended() or self._watch.complaint()
        if ended:
            clock.stop_reason = ended
        if clock.wish is not None:
            clock.agree(*clock.wish)
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

    def tell_fault(self, note: Note, last_recorded: int) -> None:
        """Tell the others of a fault here, by a beacon."""
        known = self.others.started and self.others.heard_fault
        if self._opened and not self._told and not known:
            self._told = True
            self.others.say(str(note.data.get("message", note.text)))

    def close(self) -> None:
        """Stop the beacons, and disconnect as in lockstep."""
        if self._quiet is not None:
            self._quiet.set()
        super().close()
