"""The control loop: which calls a tick makes, in which order, and what happens when one fails.

A tick calls ``emit`` and ``step`` of the blocks in the computed order, checks once that the whole
bus is finite, calls every ``update``, and then each recorder. For every phase of the hyperperiod
these calls are one flat list that is made beforehand, in which ``fuse`` makes one call of blocks of
kernels that follow each other. Changed parameters are taken over between two ticks.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from itertools import groupby
from typing import Any, Protocol

from ...mathematics.compiling.call_sequence import CallSequence, Owner
from ...mathematics.compiling.chain_code import clock_address
from ...mathematics.compiling.compile_calls import compile_calls
from ..language.block import Block
from ..language.errors import RunError
from ..language.schedule import phases
from ..language.stages import ClockSpec
from .failures import Hang, describe
from .finite import FiniteCheck, NotFiniteError
from .memory import BoundGraph
from .pacing import RobotDriven, TimeSource, make_pacer
from .sink import Note, Sink
from .tick_calls import TickCall, can_be_chained, tick_calls
from .timing import BlockTimes, Program


class Pauses(Protocol):
    """Pauses of a run between two ticks; see ``run_control``."""

    def begin(self, ticks: int | None, interrupted: Callable[[], bool]) -> None:
        """All blocks have started, and there are so many ticks to run."""

    def may_go_on(self) -> bool:
        """Hold the run while it is paused. Returns whether there are ticks to run."""

    @property
    def ticks(self) -> int | None:
        """Number of ticks to run next."""


class Ticker:
    """Runs the ticks of a bound graph; its caller starts and stops the blocks.

    Args:
        bound: the graph.
        clock: how to pace it.
        time_source: where the time comes from.
        timing: whether to time every block.
        finite_check: whether to check every tick.

    Attributes:
        records: called with the tick after each tick, also after one with a value that is not
            finite.
        notes: called with every note: of overruns, and those given to ``tell``.
        overruns_by_block: for each block, the number of deadlines that passed while it ran, and
            of results that were late.
        policy: how the run is paced.
        sinks: all sinks of the run.
        control: what may pause the run, if anything.
        paused: whether ``advance`` ends at once; only the control thread sets it, between two ticks.
    """

    def __init__(
        self,
        bound: BoundGraph,
        clock: ClockSpec,
        time_source: TimeSource,
        *,
        timing: bool = True,
        finite_check: bool = True,
    ) -> None:
        self.bound = bound
        self.records: list[Callable[[int], None]] = []
        self.notes: list[Callable[[Note], None]] = []
        self.overruns_by_block = dict.fromkeys(bound.blocks, 0)
        self.pacer = make_pacer(clock, bound, time_source)
        self.policy = clock
        self._now = time_source.now
        self._timing = timing
        self._fused = False
        self._checks: dict[frozenset[str], FiniteCheck] | None = None
        if finite_check:
            self._checks = {frozenset(): bound.finite_check}
        self.programs, self._table = self._make_programs()
        self._previous: Program | None = None
        self.sinks: Sequence[Sink] = ()
        self.control: Pauses | None = None
        self.paused = False

    def _make_programs(self) -> tuple[list[Program], list[Program]]:
        """Return the different programs, and for each tick of the hyperperiod the program it
        runs."""
        outputs, updates = tick_calls(self.bound.graph, self.bound.blocks)
        programs: dict[tuple[int, ...], Program] = {}
        table = []
        for active in phases([(call.period, call.offset) for call in outputs]):
            if active not in programs:
                due = [outputs[i] for i in active]
                paths = {call.path for call in due}
                programs[active] = self._make_program(due, [c for c in updates if c.path in paths])
            table.append(programs[active])
        return list(programs.values()), table

    def fuse(self) -> bool:
        """Run consecutive blocks of compiled kernels as one call each, from the next tick on.

        Call it before the first tick, when the kernels are compiled. Returns whether there is
        anything to fuse. Where times are taken by another clock than the system's, or the system
        offers no clock to machine code, everything stays as it is.
        """
        blocks = self.bound.blocks.values()
        own_clock = self._now is time.perf_counter_ns and clock_address() != 0
        self._fused = (own_clock or not self._timing) and any(map(can_be_chained, blocks))
        if self._fused:
            checks = (self._checks or {}).values()
            compile_calls([call for check in checks for call in check.calls])
            self.programs, self._table = self._make_programs()
        return self._fused

    def _make_program(self, outputs: Sequence[TickCall], updates: Sequence[TickCall]) -> Program:
        checks = list[FiniteCheck]()
        if self._checks is not None:
            unchanged = frozenset(self.bound.blocks.keys() - {call.path for call in outputs})
            if unchanged not in self._checks:
                self._checks[unchanged] = FiniteCheck(self.bound.memory.bus, unchanged)
            checks = [self._checks[unchanged]]
        made = self._in_chains([*outputs, *checks, *updates])
        owners, calls = [owner for owner, _ in made], [call for _, call in made]
        sampled = self.pacer is None and any(isinstance(owner, CallSequence) for owner in owners)
        return Program(calls, owners, self._now if self._timing else None, sampled=sampled)

    def _in_chains(
        self, calls: Sequence[TickCall | FiniteCheck]
    ) -> list[tuple[str | CallSequence, Callable[[], Any]]]:
        """Pair the calls with their owners; kernels that follow each other are one call of a chain."""
        numbers = {path: k for k, path in enumerate(self.bound.graph.order)}
        found: list[tuple[str | CallSequence, Callable[[], Any]]] = []

        def entry(call: TickCall | FiniteCheck) -> tuple[bool, Owner, Callable[[], Any]]:
            if isinstance(call, FiniteCheck):
                owner = Owner(call, "", -1, lambda: call.calls, call.found, call.check)
                return self._fused and call.compiled, owner, call.check
            block = self.bound.blocks[call.path]
            chained = self._fused and can_be_chained(block, call.calls)
            return chained, _owner(block, numbers[call.path], call), getattr(block, call.method)

        for chained, group in groupby(map(entry, calls), lambda made: made[0]):
            if not chained:
                found += [(owner.name, method) for _, owner, method in group]
                continue
            chain = CallSequence(
                owners=[owner for _, owner, _ in group], running=self.bound.running
            )
            _prepare(chain)
            found.append((chain, chain.run))
        return found

    def advance(self, ticks: int | None = None) -> int:
        """Run up to ``ticks`` ticks, or without a limit until stopped. Returns how many were run.

        The blocks must have been started by the caller. The run ends early when a block or a signal
        (SIGINT, SIGTERM) requests it, or when it is paused.

        Raises:
            RunError: a block failed, a value is not finite or the overrun policy is to stop.
        """
        clock = self.bound.clock
        first = tick = clock.tick
        end = None if ticks is None else first + ticks
        table, length, records = self._table, len(self._table), self.records
        wait = None if self.pacer is None else self.pacer.wait
        now, timing = self._now, self._timing
        parameters = self.bound.parameters
        requests = parameters.requests
        call: Callable[..., Any] | None = None
        try:
            while tick != end and clock.stop_reason is None:
                if requests:
                    call = parameters.answer
                    parameters.answer(tick)
                    self.refresh_chains()
                    if self.paused:
                        break
                if wait is not None:
                    call = wait
                    late = wait(tick)
                    if late:
                        self._count_overrun(tick, late)
                    if clock.stop_reason is not None:
                        break
                program = table[tick % length]
                if timing and (not program.sampled or program.times_this_run()):
                    clock.began = now()
                    row = [clock.began]
                    for call in program.calls:
                        call()
                        row.append(now())
                    program.keep(row)
                    self._previous = program
                else:
                    for call in program.calls:
                        call()
                for call in records:
                    call(tick)
                tick += 1
                clock.tick = tick
        except RunError as error:
            if error.record_tick:
                self._record_last(tick)
            raise
        except BaseException as error:
            if isinstance(error, NotFiniteError):
                self._record_last(tick)
            raise self._run_error(call, tick, error) from error
        return tick - first

    def refresh_chains(self) -> None:
        """Take over the calls of kernels that changed parameters have made anew, between two ticks."""
        for program in self.programs:
            for chain in program.chains:
                _prepare(chain)

    def _record_last(self, tick: int) -> None:
        """Record the tick whose values are wrong, because it is the one to be looked at."""
        for record in self.records:
            record(tick)

    def _run_error(
        self, call: Callable[..., Any] | None, tick: int, error: BaseException
    ) -> RunError:
        owner = owner_of(call)
        block = owner.context.path if isinstance(owner, Block) else ""
        if isinstance(owner, Block) or not isinstance(error, NotFiniteError):
            who = f"block '{block}'" if block else f"the runtime ({type(owner).__name__})"
            if isinstance(error, Hang):
                text = hang_text(who, self.instant(tick), self.policy.hangs_after)
                return RunError(text, block=block, tick=tick)
            if isinstance(owner, Block) and str(error).startswith("compiled kernel "):
                from ...mathematics.compiling.rehearsal import explained

                error = explained(error, self.bound.kernel_calls) or error
            text = f"{who} failed at {self.instant(tick)}: {describe(error)}"
            if isinstance(error, ValueError) and "read-only" in str(error):
                text += "; an input cannot be written: copy it into an array made in setup()"
        else:
            block = error.place.rpartition(".")[0].rpartition(".")[0]
            text = f"block '{block}' wrote a value that is not finite at {self.instant(tick)}: "
            text += str(error)
        return RunError(text, block=block, tick=tick)

    def instant(self, tick: int) -> str:
        """Name a tick for reports."""
        return f"tick {tick} ({tick * self.bound.clock.base_period:.3f} s)"

    def tell(self, note: Note) -> None:
        """Give a note to every keeper of notes; an error of a keeper does not stop the run."""
        for take in self.notes:
            with suppress(Exception):
                take(note)

    def _count_overrun(self, tick: int, late: int) -> None:
        """Count a late tick, for the block that ran when its deadline passed if one did.

        Raises ``RunError`` where the overrun policy is to stop.
        """
        pacer = self.pacer
        assert pacer is not None
        block = ""
        if self._previous is not None and pacer.missed_deadline:
            block = self._previous.running_at(pacer.missed_deadline)
        if block:
            self.overruns_by_block[block] += 1
        if self.notes:
            ran = f"; block '{block}' was running" if block else "; no block was running"
            data = {"late_ns": late, "block": block, "skipped_periods": pacer.skipped_periods}
            text = f"overrun: {late * 1e-6:.3f} ms late{ran}"
            self.tell(Note(tick, "overrun", text, "WARN", data))
        if self.policy.overrun == "stop" and pacer.in_a_row >= self.policy.stop_after:
            who = f"block '{block}' was running" if block else "no block was running"
            raise RunError(
                f"overrun at {self.instant(tick)}: {late * 1e-6:.3f} ms late, {pacer.in_a_row} in "
                f"a row; {who} when the deadline passed, and the overrun policy is 'stop'",
                block=block,
                tick=tick,
            )


def _owner(block: Block, number: int, call: TickCall) -> Owner:
    event = None if call.method == "update" else block.event
    return Owner(
        block, call.path, number, partial(getattr, block, call.calls), event, block.on_event
    )


def _prepare(chain: CallSequence) -> None:
    """Prepare a chain. Raises ``RunError`` where a call in it is not compiled."""
    chain.prepare()
    for owner in chain.owners if not chain.native else ():
        if any(getattr(call, "compiled", None) is None for call in owner.calls()):
            text = f"block '{owner.name}' has a kernel that did not compile"
            raise RunError(text, block=owner.name)


def owner_of(call: Callable[..., Any] | None) -> object:
    """Return the block that makes a call, or the part of the runtime; of a chain the block that
    runs."""
    owner: object = getattr(call, "__self__", None)
    if isinstance(owner, RobotDriven):
        return owner.block
    return owner.current if isinstance(owner, CallSequence) else owner


class WorkerBlock(Block):
    """A block that computes elsewhere: it takes its own times, and tells of late results."""

    def watch_ticker(self, ticker: Ticker) -> None:
        """Take whom to tell, before the first tick."""

    def worker_times(self) -> BlockTimes:
        """Return the times of its runs."""
        return BlockTimes()


def hang_text(who: str, instant: str, limit: float) -> str:
    """Describe a call that did not return."""
    return (
        f"{who} hung at {instant}: it did not return within {limit:g} s "
        "(clock.hangs_after allows longer)"
    )
