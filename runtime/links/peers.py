"""State of the other parts, as known to one part: phase, links checked, and failures.

Every part sends its phase to all others in *beacons*, which it repeats until all have answered. So
a beacon that is lost, doubled or late does no harm. A beacon carries the latest that its sender has
heard of the receiver, which answers at once if that is old. Beacons also give the offset of the
other machine's clock.
"""

from __future__ import annotations

import json
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from enum import IntEnum
from typing import Any

from ..language.errors import RunError
from ..placement.placed import PlacedGraph
from ..transports.transport import MessageCallback, Transport, beacon_key
from .identity import Identity
from .traffic import Traffic

KEPT = 20
"""Estimates among which the best is chosen: as clocks drift, older ones are forgotten."""


class ClockOffset:
    """Estimates how far the monotonic clock of one other machine is ahead. All times are in nanoseconds.

    The method is that of NTP. With t1 when a beacon left here, t2 when it arrived there, t3 when one
    left there and t4 when that arrived here, the other clock is ahead by
    ((t2 - t1) + (t3 - t4)) / 2. The error is at most half of the time on the way,
    (t4 - t1) - (t3 - t2), whatever share of it each direction took. Of the last ``KEPT`` estimates
    the one with the shortest time on the way counts.

    Attributes:
        offset: how far the other clock is ahead; zero before there is an estimate.
        uncertainty: the largest possible error of ``offset``; -1 before there is an estimate.
    """

    def __init__(self) -> None:
        self.offset = 0
        self.uncertainty = -1
        self._estimates: deque[tuple[int, int]] = deque(maxlen=KEPT)
        self._theirs = self._arrived = 0

    def stamp(self, now: int) -> list[int]:
        """Return the stamps of a beacon that leaves now: its time, and those of the latest beacon
        received."""
        return [now, self._theirs, self._arrived]

    def update(self, stamp: Sequence[int], now: int) -> None:
        """Take the stamp of a beacon that has arrived now."""
        left_there, left_here, arrived_there = (int(value) for value in stamp)
        self._theirs, self._arrived = left_there, now
        if not left_here:
            return
        on_the_way = (now - left_here) - (left_there - arrived_there)
        if on_the_way < 0:
            return  # the clock of a machine that was started again
        ahead = ((arrived_there - left_here) + (left_there - now)) // 2
        self._estimates.append((on_the_way, ahead))
        shortest, self.offset = min(self._estimates)
        self.uncertainty = shortest // 2


REPEAT = 0.05
"""Seconds between two beacons while a part waits for the others."""
REFUSED_FOR = 4.0
"""Seconds for which a part that is refused goes on asking: longer than any transport needs to notice that a
process has ended, so that a part may be started again at once."""


class PartPhase(IntEnum):
    """Phase of a part in its life."""

    HELLO = 0
    """The part is there and announces its graph."""
    LINKED = 1
    """Its graph is that of the others, and a message has come through each of its links."""
    PREPARED = 2
    """All its blocks have started except those that move actuators."""
    STARTED = 3
    """All its blocks have started."""
    RESTING = 4
    """Its actuators are in damping."""


class PeerError(RunError):
    """Another machine failed or is gone. ``heard`` is true if it reported the failure itself."""

    heard = False


class PeerStates:
    """The other parts of a graph, as one part sees them.

    Args:
        placed: the graph.
        machine: the name of this part's machine.
        transport: an open transport.
        stop_reason: called while waiting; returns the reason to stop waiting, if any.
        free: whether parts keep their own time. Then one that is gone may come back.

    Attributes:
        run: the number by which this run of this part is known.
        names: the other machines.
        traffic: what has come from each.
    """

    def __init__(
        self,
        placed: PlacedGraph,
        machine: str,
        transport: Transport,
        stop_reason: Callable[[], str | None],
        *,
        free: bool = False,
    ) -> None:
        self.machine = machine
        self.run = os.urandom(8)
        self.names = tuple(spec.name for spec in placed.machines if spec.name != machine)
        self.mailboxes: list[Callable[[], None]] = []
        self._endpoints = {spec.name: spec.endpoint for spec in placed.machines}
        self._identity = Identity.of(placed)
        self._hashes = self._identity.hashes
        self._senders = {link.name: link.sender for link in placed.links}
        self._free = free
        self._clocks = {name: ClockOffset() for name in self.names}
        self.traffic = {name: Traffic(placed, name, machine) for name in self.names}
        self._stop_reason = stop_reason
        self._phase = PartPhase.HELLO
        self._problem = ""
        self._ended = -1
        self._ends_alone = False
        self._checked: dict[str, None] = {}
        self._states: dict[str, Mapping[str, Any]] = {}
        self._failed: dict[str, tuple[int, PeerError]] = {}
        self._gone: dict[str, None] = {}
        self._refused: dict[str, str] = {}
        self._refused_since: dict[str, float] = {}
        self._changed_event = threading.Event()
        self._transport = transport
        self._publishers: dict[str, MessageCallback] = {}

    def open(self) -> None:
        """Connect, and begin to listen to the others' beacons."""
        self._transport.open(self.machine, self._on_lost)
        for name in self.names:
            self._publishers[name] = self._transport.publisher(beacon_key(self.machine, name))
            self._transport.subscribe(beacon_key(name, self.machine), self._on_beacon)

    def run_of(self, name: str) -> bytes | None:
        """Return the number of the present run of another part; ``None`` before it was heard."""
        return bytes.fromhex(self._states[name]["run"]) if name in self._states else None

    def assume_started(self, name: str, run: bytes) -> None:
        """Take another part for started without having heard it: for runs in virtual time."""
        state = {"run": run.hex(), "phase": int(PartPhase.STARTED), "checked": [], "ended": -1}
        self._states[name] = state

    def note_checked(self, link: str) -> None:
        """Note that a message has come through this link; any thread may call this."""
        if link not in self._checked:
            self._checked[link] = None
            self._changed_event.set()

    def checked(self, link: str) -> bool:
        """Return whether a message has come through this link here."""
        return link in self._checked

    @property
    def graph_hash(self) -> str:
        """The hash of the graph that this part runs."""
        return self._hashes[0]

    @property
    def phase(self) -> PartPhase:
        """Phase of this part."""
        return self._phase

    @property
    def started(self) -> bool:
        """True if all blocks of this part have started."""
        return self._phase >= PartPhase.STARTED

    def are_running(self) -> bool:
        """Return whether some other part is past its start."""
        return any(heard["phase"] >= PartPhase.STARTED for heard in tuple(self._states.values()))

    def ended(self) -> str:
        """Return the reason for this part to end, where another has ended in order; else empty.

        Raises:
            PeerError: another part failed.
        """
        for _, error in self._failures():
            if error.heard:
                raise error
            return str(error)
        return ""

    def _failures(self) -> tuple[tuple[int, PeerError], ...]:
        """Return a copy, as a thread of the network may add one at any time."""
        return tuple(self._failed.values())

    def clock_of(self, name: str) -> ClockOffset:
        """Return the estimate of another machine's clock."""
        return self._clocks[name]

    @property
    def fault_received(self) -> bool:
        """True if another part has reported that it failed."""
        return any(error.heard for _, error in self._failures())

    def has_checked(self, name: str, link: str) -> bool:
        """Return whether another part has received a message through this link."""
        return link in self._states.get(name, {}).get("checked", ())

    def fail(self, name: str, tick: int, error: PeerError) -> None:
        """Another part failed at ``tick``; whoever waits for it looks up."""
        self._failed.setdefault(name, (tick, error))
        self._changed_event.set()
        for wake in self.mailboxes:
            wake()

    def check(self, tick: int | None = None) -> None:
        """Raise if waiting in ``tick`` has no sense any more.

        Raises:
            PeerError: another part failed at this tick or before, or is gone.
        """
        for at, error in self._failures():
            if tick is None or at <= tick:
                raise error

    def reach_phase(
        self,
        phase: PartPhase,
        timeout: float,
        *,
        before: Callable[[], bool] | None = None,
        names: Iterable[str] | None = None,
    ) -> None:
        """Wait until this part may enter ``phase``, enter it, and wait until the others have.

        Args:
            phase: the phase.
            timeout: the seconds to wait for the others.
            before: called every ``REPEAT`` seconds; this part enters the phase when it returns true.
            names: the parts to wait for; by default all others.

        Raises:
            RunError: the others did not come so far in time; it names them.
            PeerError: another part failed, is gone, or would run another graph.
        """
        expected = tuple(self.names if names is None else names)
        now = time.monotonic()
        end, next_time = now + timeout, now
        while True:
            self.check()
            fits = self._compare()
            now = time.monotonic()
            if now >= next_time:  # not on all news, or two parts would answer each other for ever
                ready = fits and not self._refused_since and (before is None or before())
                if self._phase < phase and ready:
                    self._phase = phase
                self.send_beacon()
                next_time = now + REPEAT
            missing = [n for n in expected if self._states.get(n, {}).get("phase", -1) < phase]
            if self._phase >= phase and not missing:
                return
            reason = self._stop_reason()
            if reason:
                raise RunError(f"stopped while waiting for {self._listed(missing)}: {reason}")
            if now > end:
                raise RunError(self._missing_text(missing, phase, timeout))
            self._changed_event.wait(max(0.0, next_time - now))
            self._changed_event.clear()

    def wait_for_rest(self, timeout: float, tick: int, *, alone: bool = False) -> None:
        """Report that the actuators here are in damping, and wait until the others have reported
        so.

        It never raises, and does not wait for a part that is gone. Where this part could not start,
        it sends the reason until all have heard it. ``tick`` is the first that this part will not
        run. With ``alone`` the others go on, and this part waits only until they have heard of its end.
        """
        end = time.monotonic() + timeout
        self._phase, self._ended, self._ends_alone = PartPhase.RESTING, tick, alone
        answer = "heard" if alone else "phase"
        next_time = 0.0
        while (now := time.monotonic()) < end:
            if now >= next_time:
                self.send_beacon()
                next_time = now + REPEAT
            waiting = [
                name
                for name in self.names
                if name not in self._gone
                and (self._problem or name in self._states)
                and self._states.get(name, {}).get(answer, -1) < PartPhase.RESTING
            ]
            if not waiting:
                return
            self._changed_event.wait(max(0.0, next_time - now))
            self._changed_event.clear()

    def send_beacon(self, problem: str = "") -> None:
        """Tell all others how far this part is, and what keeps it from going on."""
        self._problem = self._problem or problem
        for name in self.names:
            self._send_beacon_to(name)

    def _send_beacon_to(self, name: str) -> None:
        state: dict[str, Any] = {
            "machine": self.machine,
            "run": self.run.hex(),
            "phase": int(self._phase),
            "problem": self._problem,
            "ended": self._ended,
            "alone": self._ends_alone,
            "hashes": self._hashes,
            "clock": self._clocks[name].stamp(time.monotonic_ns()),
            "checked": list(self._checked),
            "heard": self._states.get(name, {}).get("phase", -1),
            "refuses": self._refused.get(name, ""),
        }
        others = self._states.get(name, {}).get("hashes", self._hashes)
        if self._phase is PartPhase.HELLO and others != self._hashes:
            # only where they are needed: twenty times a second they would fill a slow network
            state["graph"] = self._identity.graph
            state["schema"] = self._identity.schema
            state["code"] = self._identity.code
        if name in self._publishers:
            self._publishers[name](json.dumps(state).encode())

    def _on_beacon(self, data: bytes) -> None:
        """Keep a beacon; whatever is none is thrown away."""
        with suppress(Exception):  # whatever bytes do, a thread of the network goes on
            state = json.loads(data)
            name, phase, checked = state["machine"], int(state["phase"]), list(state["checked"])
            state["hashes"] = list(state["hashes"])
            if name not in self.names or len(bytes.fromhex(state["run"])) != len(self.run):
                return
            now = time.monotonic_ns()
            self.traffic[name].add(len(data))
            before = self._states.get(name, {})
            self._take_refusal(name, state)
            if before and before["run"] != state["run"]:
                if self._runs_with(name):  # somebody has started a second one
                    self._refused[name] = state["run"]
                    self._send_beacon_to(name)
                    return
                self._forget(name)
                before = {}
            self._clocks[name].update(state["clock"], now)
            if before.get("run") == state["run"]:
                # beacons may come in another order
                phase = max(phase, before["phase"])
                checked = list(dict.fromkeys([*before["checked"], *checked]))
            self._states[name] = {**before, **state, "phase": phase, "checked": checked}
            if state["problem"]:
                what = "does not start" if phase < PartPhase.STARTED else "failed"
                error = PeerError(f"machine {name!r} {what}: {state['problem']}")
                error.heard = True
                self.fail(name, -1, error)
            elif phase >= PartPhase.RESTING and not (state["alone"] and self.started):
                error = PeerError(f"machine {name!r} has ended its run")
                self.fail(name, int(state["ended"]), error)
            self._changed_event.set()
            if int(state["heard"]) < self._phase:
                self._send_beacon_to(name)

    def _runs_with(self, name: str) -> bool:
        """Return whether this part is in a run with the part ``name``, which is still there."""
        return (
            self._phase >= PartPhase.STARTED
            and self._states[name]["phase"] == PartPhase.STARTED
            and name not in self._gone
            and name not in self._failed
        )

    def _take_refusal(self, name: str, state: Mapping[str, Any]) -> None:
        """Give up where another part has a run with somebody else in this one's place."""
        if state["refuses"] != self.run.hex():
            self._refused_since.pop(name, None)
            return
        now = time.monotonic()
        if now - self._refused_since.setdefault(name, now) > REFUSED_FOR:
            text = (
                f"{self.machine!r} is running already, with {name!r}, and that run goes on: stop it first, or "
                "call this machine otherwise"
            )
            self.fail(name, -1, PeerError(text))

    def _on_lost(self, name: str) -> None:
        heard = self._states.get(name)
        if heard is None or heard["phase"] >= PartPhase.RESTING:
            return  # it was not there yet, or has ended in good order
        self._gone[name] = None
        if self._free and self._phase >= PartPhase.STARTED:
            return  # its links say what to do without it
        text = f"machine {name!r} is gone: {self.traffic[name].why_gone()}; before, {self.measured(name)}"
        self.fail(name, -1, PeerError(text))

    def measured(self, name: str) -> str:
        """Say what was measured of the network from another machine."""
        uncertainty = self._clocks[name].uncertainty
        return self.traffic[name].measured(2e-9 * uncertainty if uncertainty >= 0 else -1.0)

    def _forget(self, name: str) -> None:
        """Another part was started again: what was known of it no longer holds."""
        self._gone.pop(name, None)
        self._refused.pop(name, None)
        self._failed.pop(name, None)
        for link in [link for link, sender in self._senders.items() if sender == name]:
            self._checked.pop(link, None)

    def _compare(self) -> bool:
        """Refuse to go on beside a part that would run something else.

        Returns:
            Whether all that were heard fit; where one does not, it is not yet known in what.

        Raises:
            PeerError: both hashes, and the first difference.
        """
        if self._phase > PartPhase.HELLO:
            return True
        fits = True
        for name in self.names:
            heard = self._states.get(name, {})
            if heard.get("hashes", self._hashes) == self._hashes:
                continue
            fits = False
            if "graph" not in heard:
                if heard["phase"] > PartPhase.HELLO:
                    raise PeerError(
                        f"{self.machine} and {name} do not fit together: graph, schema and code are "
                        f"{', '.join(self._hashes)} on {self.machine}, "
                        f"{', '.join(heard['hashes'])} on {name}, which is running already"
                    )
                continue  # what differs comes with its next beacon
            other = Identity(*(tuple(heard.get(key, ())) for key in ("graph", "schema", "code")))
            difference = self._identity.difference(other, self.machine, name)
            if difference:
                error = PeerError(f"{self.machine} and {name} do not fit together: {difference}")
                self.send_beacon(str(error))
                raise error
        return fits

    def _missing_text(self, missing: list[str], phase: PartPhase, timeout: float) -> str:
        silent = [name for name in missing if name not in self._states]
        if silent:
            return (
                f"nothing was heard of {self._listed(silent)} for {timeout:g} s. Start each part "
                "with 'aloft run GRAPH --machine NAME', and see that its endpoint can be reached"
            )
        if missing:
            return (
                f"{self._listed(missing)} did not become {phase.name.lower()} in {timeout:g} s; "
                f"see what is printed there. From {missing[0]} {self.measured(missing[0])}"
            )
        return f"this machine did not become {phase.name.lower()} in {timeout:g} s"

    def _listed(self, names: Iterable[str]) -> str:
        return ", ".join(f"{name} ({self._endpoints[name]})" for name in names) or "the others"
