"""Keeps the parts of a graph together in lockstep: they start, end each tick and stop as one.

A change of live parameters takes effect in one tick on all machines, or on none.
"""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from struct import Struct
from typing import Any

from ..language.block import Block, Clock
from ..language.errors import AloftError, RunError
from ..language.parameter_change import Adjustment
from ..language.parameters import Parameters
from ..loading.checking.parameters import adjust
from ..running.failures import describe
from ..running.live_parameters import LiveParameters
from ..running.sink import Note, Sink
from ..transports.transport import MessageCallback, Transport, tick_key
from .command_watch import CommandWatch
from .free_link import LatestReceiver
from .lockstep_link import LinkOutput, LockstepReceiver, Mailbox, MailTimeoutError
from .peers import REPEAT, PartPhase, PeerError, PeerStates


class PartClock(Clock):
    """A clock that ends the run only when all parts have agreed to end after the same tick.

    A block or a signal asks for the end as ever, by ``stop_reason`` and ``stopped_by``. The request of
    whoever asks first is kept in ``stop_request``, and the coordinator tells it to the others. A signal may
    come at any time, so without this a part could end a tick before the others.
    """

    def __init__(self, base_period: float) -> None:
        self.stop_request: tuple[str, str] | None = None
        self._agreed: tuple[str, str] | None = None
        self._is_first_request = False
        self.heard: Callable[[], int] | None = None
        """Source of the time of the last commands; see ``CommandWatch.heard``."""
        super().__init__(base_period)

    def commands_heard(self) -> int:
        """Return the time [ns] of the last commands on the most silent link that brings
        commands."""
        return 0 if self.heard is None else self.heard()

    def agree(self, reason: str, block: str) -> None:
        """End the run after this tick."""
        self._agreed = (reason, block)

    @property
    def stop_reason(self) -> str | None:
        """Reason for which all parts end after this tick."""
        return self._agreed[0] if self._agreed else None

    @stop_reason.setter
    def stop_reason(self, reason: str | None) -> None:
        if reason is None:
            self.stop_request = self._agreed = None
        self._is_first_request = reason is not None and self.stop_request is None
        if reason is not None and self._is_first_request:
            self.stop_request = (reason, "")

    @property
    def stopped_by(self) -> str:
        """The path of the block that asked first."""
        return self._agreed[1] if self._agreed else ""

    @stopped_by.setter
    def stopped_by(self, block: str) -> None:
        if self._is_first_request and self.stop_request is not None:
            self.stop_request = (self.stop_request[0], block)


class DistributedParameters(LiveParameters):
    """The parameters of one part, and of what stands for the other parts' blocks.

    An adjustment that is handed in here waits until the tick ends. Then all parts get it as a
    proposal, each tries it, and only if all can take it over it stays.
    """

    def __init__(self, blocks: Mapping[str, Block]) -> None:
        super().__init__(blocks)
        self.handed_in: deque[Adjustment] = deque(maxlen=1)
        self._tried: Adjustment | None = None
        self._before: Mapping[str, Parameters] = {}

    def proposal(self) -> Adjustment | None:
        """Return the adjustment that waits here, if any."""
        return self.handed_in.popleft() if self.handed_in else None

    def try_settings(self, settings: Mapping[str, Any]) -> str:
        """Take over another part's proposal for now. Returns why it cannot be, or an empty text."""
        try:
            return self.try_out(adjust(self.blocks, settings))
        except AloftError as error:
            return str(error)

    def try_out(self, adjustment: Adjustment) -> str:
        """Take over an adjustment for now. Returns why it cannot be, or an empty text."""
        self._before = {path: self.blocks[path].params for path in adjustment.params}
        self._tried = adjustment
        for path, params in adjustment.params.items():
            self.blocks[path].params = params
            try:
                self._take_over(self.blocks[path])
            except Exception as error:  # noqa: BLE001  # the block's reason goes to whoever asked
                self.undo()
                return f"block '{path}' refuses the change: {describe(error)}"
        return ""

    def undo(self) -> None:
        """Go back to the parameters before what was tried, if anything was."""
        for path, params in self._before.items():
            self.blocks[path].params = params
            self._take_over(self.blocks[path])
        self._before, self._tried = {}, None

    def keep(self, tick: int) -> None:
        """Keep what was tried; it holds from ``tick`` on."""
        assert self._tried is not None
        self._tried.tick = tick
        for change in self._tried.changes():
            self.changes.append(change)
            for listener in self.listeners:
                listener(change)
        self._before, self._tried = {}, None


_HEAD = Struct("<8sqB")
_ROUNDS = 16
"""The most messages that a part sends to another about one tick."""
REST_TIMEOUT = 2.0
"""Seconds that a part waits at its end until the actuators of the others are in damping."""


class TickMessageKind(IntEnum):
    """Kind of a part's message about a tick."""

    DONE = 0
    """All its blocks have run."""
    STOP = 1
    """They have run, and a block or a signal asks for the end."""
    FAULT = 2
    """A block failed; the tick is invalid on all parts."""
    WRONG_VALUE = 3
    """A value is not finite; the tick is recorded and is the last."""
    PROPOSE = 4
    """The tick is done, and parameters are to change before the next one."""
    ANSWER = 5
    """Answer to a proposal: this part can take it over, or not."""


@dataclass(frozen=True)
class TickMessage:
    """Message of another part about a tick."""

    kind: TickMessageKind
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class PartLinks:
    """The ends of all links of a part.

    Attributes:
        transport: what carries the messages.
        receivers: the ends that receive.
        senders: the ends that send, by the link's name.
        declare: declares all links to the transport; it is called once the transport is open.
        watch: watches the links that bring commands.
    """

    transport: Transport
    receivers: Sequence[LockstepReceiver | LatestReceiver]
    senders: Mapping[str, LinkOutput]
    declare: Callable[[], None]
    watch: CommandWatch


class LockstepCoordinator(Block):
    """The block of the runtime that starts first and ends each tick last.

    ``start`` waits until every part runs the same graph and a message has come through every link
    in both directions. ``update`` sends the others the outcome of the tick here, and waits for
    theirs. Hence a stop, a fault and a change of parameters take effect everywhere in one tick.
    """

    waits_for_others = True

    def connect(
        self,
        peers: PeerStates,
        links: PartLinks,
        parameters: DistributedParameters,
        *,
        clock: PartClock,
        timeout: float,
        connect_timeout: float,
        moves: bool,
        elsewhere: Mapping[str, str],
    ) -> None:
        """Take what the coordinator needs of its part.

        Args:
            timeout: the seconds to wait for a message.
            connect_timeout: the seconds to wait for the other parts to start.
            moves: whether this part has actuators.
            elsewhere: which machine runs each block that is not here.
        """
        self.peers = peers
        self._links = links
        self._parameters = parameters
        self._clock = clock
        self.moves, self.elsewhere = moves, elsewhere
        self._timeout, self._connect_timeout = timeout, connect_timeout
        self._publishers: dict[str, MessageCallback] = {}
        self._mail: dict[str, Mailbox[TickMessage]] = {}
        self._tick = 0
        self._next_probe, self._probe_period = 0.0, 0.5 * REPEAT
        self._opened = self._fault_reported = False

    # -- before the first tick ---------------------------------------------------------------------

    def start(self) -> None:
        """Connect, compare graphs, and try every link both ways."""
        self._opened = True
        self.peers.open()
        self.listen()
        self._links.declare()
        self.peers.reach_phase(PartPhase.HELLO, self._connect_timeout)
        self.peers.reach_phase(PartPhase.LINKED, self._connect_timeout, before=self._all_links_work)

    def listen(self) -> None:
        """Listen to what the others say of each tick."""
        for name in self.peers.names:
            box: Mailbox[TickMessage] = Mailbox(lambda: self.peers.check(self._tick))
            self._mail[name] = box
            self.peers.mailboxes.append(box.wake)
            self._publishers[name] = self._links.transport.publisher(
                tick_key(self.peers.machine, name)
            )
            self._links.transport.subscribe(
                tick_key(name, self.peers.machine), self._listener(name, box)
            )

    def _all_links_work(self) -> bool:
        """Send a message through each link that has not been heard; whether all were, both ways."""
        waiting = [
            sender
            for link, sender in self._links.senders.items()
            if not any(self.peers.has_checked(name, link) for name in self.peers.names)
        ]
        if waiting and time.monotonic() >= self._next_probe:
            for sender in waiting:
                sender.probe()
            # ever more rarely: on a slow network large messages would queue up faster than they leave
            self._probe_period *= 2.0
            self._next_probe = time.monotonic() + self._probe_period
        return not waiting and all(
            self.peers.checked(box.link.name) for box in self._links.receivers
        )

    def reach_phase(self, phase: PartPhase) -> None:
        """Wait until all parts have started the blocks of ``phase``."""
        self.peers.reach_phase(phase, self._connect_timeout)

    # -- at the end of each tick -------------------------------------------------------------------

    def emit(self) -> None:
        """Do nothing: this block has no outputs."""

    def update(self) -> None:
        """Send the outcome of the tick here, and receive that of the others.

        Raises:
            PeerError: another part failed in this tick, or is gone.
            RunError: another part was silent for too long.
        """
        clock = self._clock
        tick = self._tick = clock.tick
        own: Adjustment | None = None
        stop_request = clock.stop_request
        if stop_request is not None:
            self._send(
                tick, 0, TickMessageKind.STOP, {"reason": stop_request[0], "block": stop_request[1]}
            )
        elif self._parameters.handed_in and (own := self._parameters.proposal()) is not None:
            settings = {path: new for path, _, new in own.values}
            self._send(tick, 0, TickMessageKind.PROPOSE, {"settings": settings})
        else:
            self._send(tick, 0, TickMessageKind.DONE)
        messages = {name: self._receive(name, tick, 0) for name in self.peers.names}
        for name, message in messages.items():
            if message.kind in (TickMessageKind.FAULT, TickMessageKind.WRONG_VALUE):
                raise self._error(name, message)
        stop_requests = {self.peers.machine: stop_request} if stop_request is not None else {}
        for name, message in messages.items():
            if message.kind is TickMessageKind.STOP:
                stop_requests[name] = (str(message.data["reason"]), str(message.data["block"]))
        if stop_requests:
            # of several requests all parts take the same one
            clock.agree(*stop_requests[min(stop_requests)])
        if own is not None or any(
            message.kind is TickMessageKind.PROPOSE for message in messages.values()
        ):
            self._agree(tick, own, messages)

    def _agree(
        self, tick: int, own: Adjustment | None, messages: Mapping[str, TickMessage]
    ) -> None:
        """Try all proposals, one after the other, and keep those that every part can take over."""
        ended = self._clock.stop_reason is not None
        for number, name in enumerate(sorted([self.peers.machine, *self.peers.names])):
            mine = name == self.peers.machine
            if (mine and own is None) or (
                not mine and messages[name].kind is not TickMessageKind.PROPOSE
            ):
                continue
            if ended:
                refusal = "the run has ended"
            elif mine and own is not None:
                refusal = self._parameters.try_out(own)
            else:
                refusal = self._parameters.try_settings(messages[name].data["settings"])
            self._send(tick, number + 1, TickMessageKind.ANSWER, {"refusal": refusal})
            answers = [self._receive(n, tick, number + 1).data["refusal"] for n in self.peers.names]
            refusals = [text for text in (refusal, *answers) if text]
            if not refusals:
                self._parameters.keep(tick + 1)
            elif not refusal:
                self._parameters.undo()
            if mine and own is not None:
                own.error = refusals[0] if refusals else ""
                own.answered = True

    def _send(
        self, tick: int, round_: int, kind: TickMessageKind, data: Mapping[str, Any] | None = None
    ) -> None:
        head = _HEAD.pack(self.peers.run, tick * _ROUNDS + round_, kind)
        message = head + json.dumps(data).encode() if data is not None else head
        for tell in self._publishers.values():
            tell(message)

    def _receive(self, name: str, tick: int, round_: int) -> TickMessage:
        try:
            # longer than for a message, so that who misses one can say which
            return self._mail[name].take(tick * _ROUNDS + round_, 2.0 * self._timeout)
        except MailTimeoutError:
            text = (
                f"machine {name!r} has not ended tick {tick} in {2.0 * self._timeout:g} s. From {name} "
                f"{self.peers.measured(name)}"
            )
            raise RunError(text, tick=tick) from None

    def _listener(self, name: str, box: Mailbox[TickMessage]) -> Callable[[bytes], None]:
        def on_message(data: bytes) -> None:
            self.peers.traffic[name].add(len(data))
            try:
                run, number, kind = _HEAD.unpack_from(data)
                if run != self.peers.run_of(name):
                    return
                message = TickMessage(
                    TickMessageKind(kind),
                    json.loads(data[_HEAD.size :]) if data[_HEAD.size :] else {},
                )
                if not isinstance(message.data, dict):
                    return
            except Exception:  # noqa: BLE001  # damaged; the tick's end is waited for in vain
                return
            if message.kind in (TickMessageKind.FAULT, TickMessageKind.WRONG_VALUE):
                error = self._error(name, message)
                at = number // _ROUNDS
                self.peers.fail(name, at + (message.kind is TickMessageKind.WRONG_VALUE), error)
            box.put(number, message)

        return on_message

    @staticmethod
    def _error(name: str, message: TickMessage) -> PeerError:
        data = message.data
        error = PeerError(
            f"machine {name!r}: {data.get('message', 'failed')}",
            block=str(data.get("block", "")),
            tick=int(data.get("tick", -1)),
        )
        error.heard = True
        error.record_tick = message.kind is TickMessageKind.WRONG_VALUE
        error.where, error.traceback = str(data.get("where", "")), str(data.get("traceback", ""))
        return error

    # -- at the end of the run ---------------------------------------------------------------------

    def report_fault(self, note: Note, last_recorded: int) -> None:
        """Report a fault of this part to the others, once, unless they reported one first."""
        if not self._opened or self._fault_reported:
            return
        data = {"message": note.text, **note.data, "traceback": ""}
        if not self.peers.started:  # all hear why, from whomever they hear it first
            self._fault_reported = True
            self.peers.send_beacon(str(data["message"]))
            return
        if self.peers.fault_received:
            return
        self._fault_reported = True
        tick = self.context.clock.tick
        self._send(
            tick,
            0,
            TickMessageKind.WRONG_VALUE if last_recorded == tick else TickMessageKind.FAULT,
            data,
        )

    def close(self) -> None:
        """Say that the actuators here are in damping, wait until the others' are, and disconnect."""
        if self._opened:
            try:
                tick = self.context.clock.tick
                self.peers.wait_for_rest(REST_TIMEOUT, tick, alone=self._ends_alone())
            finally:
                self._links.transport.close()

    def _ends_alone(self) -> bool:
        """Return whether the others go on after this part's end."""
        return False


class FaultReporter(Sink):
    """The sink through which a coordinator receives faults in its own part."""

    def __init__(self, coordinator: LockstepCoordinator) -> None:
        self._coordinator = coordinator
        self._last = -1

    def record(self, tick: int) -> None:
        """Remember which tick was recorded last."""
        self._last = tick

    def note(self, note: Note) -> None:
        """Pass on a fault."""
        if note.kind == "fault":
            self._coordinator.report_fault(note, self._last)


class StartBarrier(Block):
    """A block of the runtime whose ``start`` waits until all parts have come as far as this one."""

    waits_for_others = True

    def connect(self, coordinator: LockstepCoordinator, phase: PartPhase) -> None:
        """Take what it waits with, and how far all must be."""
        self._coordinator, self._phase = coordinator, phase

    def start(self) -> None:
        """Wait for the others."""
        self._coordinator.reach_phase(self._phase)

    def step(self) -> None:
        """Never called: a gate is not in the order of execution."""
