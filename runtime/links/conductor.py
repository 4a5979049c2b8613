"""Keeps the parts of a graph together in lockstep: they start, end each tick and stop as one."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from struct import Struct
from typing import Any

from ..language.block import Block
from ..language.errors import RunError
from ..language.parameter_change import Adjustment
from ..running.memory import BoundGraph
from ..running.notes import Note
from .command_watch import CommandWatch
from .inbox import Inbox
from .latest import LatestInbox
from .mailbox import Mailbox, MailTimeoutError
from .others import Others, PeerError, Phase
from .outbox import Send
from .part_clock import PartClock
from .spread_parameters import SpreadParameters
from .transport import Take, Transport, tick_key

_HEAD = Struct("<8sqB")
_ROUNDS = 16
"""The most messages that a part sends to another about one tick."""
REST_TIME = 2.0
"""Seconds that a part waits at its end until the actuators of the others are in damping."""


class Kind(IntEnum):
    """What a part says about a tick."""

    DONE = 0
    """All its blocks have run."""
    STOP = 1
    """They have run, and a block or a signal asks for the end."""
    FAULT = 2
    """A block failed; the tick counts for nobody."""
    WRONG_VALUE = 3
    """A value is not finite; the tick is recorded and is the last."""
    PROPOSE = 4
    """The tick is done, and parameters are to change before the next one."""
    ANSWER = 5
    """Whether this part can take over a proposal."""


@dataclass(frozen=True)
class Word:
    """What another part said about a tick."""

    kind: Kind
    data: Mapping[str, Any] = field(default_factory=dict)


class Conductor(Block):
    """The block of the runtime that starts first and ends each tick last.

    ``start`` waits until every part runs the same graph and a message has come through every link
    in both directions. ``update`` tells the others how the tick ended here, and waits until all
    have said so. Hence a stop, a fault and a change of parameters take effect everywhere in one
    tick.
    """

    waits_for_others = True

    def connect(
        self,
        others: Others,
        transport: Transport,
        inboxes: Sequence[Inbox | LatestInbox],
        senders: Mapping[str, Send],
        parameters: SpreadParameters,
        *,
        clock: PartClock,
        on_open: Callable[[], None],
        patience: float,
        connect_time: float,
        watch: CommandWatch,
        moves: bool = False,
        elsewhere: Mapping[str, str] | None = None,
    ) -> None:
        """Take what it needs: the other parts, and the ends of all links, senders by the link's name.

        Args:
            on_open: declares the links; it is called once the transport is open.
            patience: the seconds to wait for a message.
            connect_time: the seconds to wait for the other parts to start.
            watch: watches the links that bring commands.
            moves: whether this part has actuators.
            elsewhere: which machine runs each block that is not here.
        """
        self.moves, self.elsewhere = moves, elsewhere or {}
        self._watch = watch
        self.others = others
        self._transport = transport
        self._inboxes = inboxes
        self._senders = senders
        self._parameters = parameters
        self._clock = clock
        self._on_open = on_open
        self._patience, self._connect_time = patience, connect_time
        self._tell: dict[str, Take] = {}
        self._mail: dict[str, Mailbox[Word]] = {}
        self._tick = 0
        self._opened = self._told = False

    # -- before the first tick ---------------------------------------------------------------------

    def start(self) -> None:
        """Connect, compare graphs, and try every link both ways."""
        self._opened = True
        self.others.open()
        self.listen()
        self._on_open()
        self.others.reach(Phase.HELLO, self._connect_time)
        self.others.reach(Phase.LINKED, self._connect_time, before=self._all_links_work)

    def listen(self) -> None:
        """Listen to what the others say of each tick."""
        for name in self.others.names:
            box: Mailbox[Word] = Mailbox(lambda: self.others.check(self._tick))
            self._mail[name] = box
            self.others.mailboxes.append(box.wake)
            self._tell[name] = self._transport.publisher(tick_key(self.others.machine, name))
            self._transport.subscribe(
                tick_key(name, self.others.machine), self._listener(name, box)
            )

    def _all_links_work(self) -> bool:
        """Send a message through each link that has not been heard; whether all were, both ways."""
        waiting = [
            sender
            for link, sender in self._senders.items()
            if not any(self.others.has_checked(name, link) for name in self.others.names)
        ]
        for sender in waiting:
            sender.probe()
        return not waiting and all(self.others.checked(box.link.name) for box in self._inboxes)

    def reach(self, phase: Phase) -> None:
        """Wait until all parts have started those blocks that ``phase`` says."""
        self.others.reach(phase, self._connect_time)

    # -- at the end of each tick -------------------------------------------------------------------

    def emit(self) -> None:
        """Do nothing: this block has no outputs."""

    def update(self) -> None:
        """Say how the tick ended here, and hear how it ended elsewhere.

        Raises:
            PeerError: another part failed in this tick, or is gone.
            RunError: another part said nothing for too long.
        """
        clock = self._clock
        tick = self._tick = clock.tick
        own: Adjustment | None = None
        wish = clock.wish
        if wish is not None:
            self._say(tick, 0, Kind.STOP, {"reason": wish[0], "block": wish[1]})
        elif self._parameters.handed_in and (own := self._parameters.proposal()) is not None:
            settings = {path: new for path, _, new in own.values}
            self._say(tick, 0, Kind.PROPOSE, {"settings": settings})
        else:
            self._say(tick, 0, Kind.DONE)
        words = {name: self._hear(name, tick, 0) for name in self.others.names}
        for name, word in words.items():
            if word.kind in (Kind.FAULT, Kind.WRONG_VALUE):
                raise self._error(name, word)
        wishes = {self.others.machine: wish} if wish is not None else {}
        for name, word in words.items():
            if word.kind is Kind.STOP:
                wishes[name] = (str(word.data["reason"]), str(word.data["block"]))
        if wishes:
            clock.agree(*wishes[min(wishes)])  # of several wishes all take the same one
        if own is not None or any(word.kind is Kind.PROPOSE for word in words.values()):
            self._agree(tick, own, words)

    def _agree(self, tick: int, own: Adjustment | None, words: Mapping[str, Word]) -> None:
        """Try all proposals, one after the other, and keep those that every part can take over."""
        ended = self._clock.stop_reason is not None
        for number, name in enumerate(sorted([self.others.machine, *self.others.names])):
            mine = name == self.others.machine
            if (mine and own is None) or (not mine and words[name].kind is not Kind.PROPOSE):
                continue
            if ended:
                refusal = "the run has ended"
            elif mine and own is not None:
                refusal = self._parameters.try_out(own)
            else:
                refusal = self._parameters.try_settings(words[name].data["settings"])
            self._say(tick, number + 1, Kind.ANSWER, {"refusal": refusal})
            answers = [self._hear(n, tick, number + 1).data["refusal"] for n in self.others.names]
            refusals = [text for text in (refusal, *answers) if text]
            if not refusals:
                self._parameters.keep(tick + 1)
            elif not refusal:
                self._parameters.undo()
            if mine and own is not None:
                own.error = refusals[0] if refusals else ""
                own.answered = True

    def _say(
        self, tick: int, round_: int, kind: Kind, data: Mapping[str, Any] | None = None
    ) -> None:
        head = _HEAD.pack(self.others.run, tick * _ROUNDS + round_, kind)
        message = head + json.dumps(data).encode() if data is not None else head
        for tell in self._tell.values():
            tell(message)

    def _hear(self, name: str, tick: int, round_: int) -> Word:
        try:
            # longer than for a message, so that who misses one can say which
            return self._mail[name].take(tick * _ROUNDS + round_, 2.0 * self._patience)
        except MailTimeoutError:
            text = f"machine {name!r} has not ended tick {tick} in {2.0 * self._patience:g} s"
            raise RunError(text, tick=tick) from None

    def _listener(self, name: str, box: Mailbox[Word]) -> Callable[[bytes], None]:
        def hear(data: bytes) -> None:
            try:
                run, number, kind = _HEAD.unpack_from(data)
                if run != self.others.run_of(name):
                    return
                word = Word(
                    Kind(kind), json.loads(data[_HEAD.size :]) if data[_HEAD.size :] else {}
                )
                if not isinstance(word.data, dict):
                    return
            except Exception:  # noqa: BLE001  # damaged; the tick's end is waited for in vain
                return
            if word.kind in (Kind.FAULT, Kind.WRONG_VALUE):
                error = self._error(name, word)
                at = number // _ROUNDS
                self.others.fail(name, at + (word.kind is Kind.WRONG_VALUE), error)
            box.put(number, word)

        return hear

    @staticmethod
    def _error(name: str, word: Word) -> PeerError:
        data = word.data
        error = PeerError(
            f"machine {name!r}: {data.get('message', 'failed')}",
            block=str(data.get("block", "")),
            tick=int(data.get("tick", -1)),
        )
        error.heard = True
        error.record_tick = word.kind is Kind.WRONG_VALUE
        error.where, error.traceback = str(data.get("where", "")), str(data.get("traceback", ""))
        return error

    # -- at the end of the run ---------------------------------------------------------------------

    def tell_fault(self, note: Note, last_recorded: int) -> None:
        """Tell the others of a fault here, once, unless they told of it."""
        if not self._opened or self._told:
            return
        data = {"message": note.text, **note.data, "traceback": ""}
        if not self.others.started:  # all hear why, from whomever they hear it first
            self._told = True
            self.others.say(str(data["message"]))
            return
        if self.others.heard_fault:
            return
        self._told = True
        tick = self.context.clock.tick
        self._say(tick, 0, Kind.WRONG_VALUE if last_recorded == tick else Kind.FAULT, data)

    def close(self) -> None:
        """Say that the actuators here are in damping, wait until the others' are, and disconnect."""
        if self._opened:
            try:
                self.others.rest(REST_TIME, self.context.clock.tick)
            finally:
                self._transport.close()


class FaultTeller:
    """The sink through which a conductor hears of faults in its own part."""

    def __init__(self, conductor: Conductor) -> None:
        self._conductor = conductor
        self._last = -1

    def open(self, bound: BoundGraph) -> None:
        """Nothing to do."""

    def record(self, tick: int) -> None:
        """Remember which tick was recorded last."""
        self._last = tick

    def note(self, note: Note) -> None:
        """Pass on a fault."""
        if note.kind == "fault":
            self._conductor.tell_fault(note, self._last)

    def close(self) -> None:
        """Nothing to do."""


class Gate(Block):
    """A block of the runtime whose ``start`` waits until all parts have come as far as this one."""

    waits_for_others = True

    def connect(self, conductor: Conductor, phase: Phase) -> None:
        """Take what it waits with, and how far all must be."""
        self._conductor, self._phase = conductor, phase

    def start(self) -> None:
        """Wait for the others."""
        self._conductor.reach(self._phase)

    def step(self) -> None:
        """Never called: a gate is not in the order of execution."""
