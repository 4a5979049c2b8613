"""The executor takes a graph through its whole life cycle and ends every run in good order.

During a run the garbage collector is off, so that it interrupts no tick.
"""

from __future__ import annotations

import gc
import os
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from ...mathematics.compiling.compile_calls import compile_calls
from ..language.block import Block, Metric
from ..language.collector import collector_off, collector_paused, objects_frozen
from ..language.errors import AloftError, ExitCode, RunError
from ..language.stages import CheckedGraph, ClockSpec
from .failures import describe, locate
from .life_cycle import LifeCycle, LifeState
from .memory import BoundGraph
from .pacing import TimeSource, WallTime
from .real_time import NO_REAL_TIME, RealTimeOptions
from .run_result import RunResult, merge_metrics
from .sink import Note, Sink
from .sinks import MemoryLog, RunHash
from .ticker import Ticker, WorkerBlock, hang_text
from .timing import BlockTimes, block_times
from .watchdog import Interrupts, Watchdog


class Executor:
    """Runs a graph once.

    Args:
        graph: a checked graph, or a bound one.
        clock: how to pace it; by default that of the graph.
        sinks: what records the run, beside the log and the hash.
        log: whether to keep every tick in memory.
        run_hash: whether to hash every tick.
        timing: whether to time every block. Only benchmarks switch it off.
        finite_check: whether to check every tick. Only benchmarks switch it off.
        time_source: where the time comes from; by default the system's monotonic clock.
        on_ready: called once all blocks have started, before the first tick; a replay restores a
            keyframe here.
        plain: whether to run all kernels as plain Python, which is slower and gives the same bytes.
        fuse: whether blocks of kernels that follow each other are one compiled call.
        real_time: what the control thread asks of the operating system while it ticks.

    Raises:
        RunError: a block could not be set up.
        RealTimeError: the operating system refuses what ``real_time`` asks.
        AloftError: the graph's clock is the robot's, and there is none to drive it.
    """

    @collector_paused()
    def __init__(
        self,
        graph: CheckedGraph | BoundGraph,
        *,
        clock: ClockSpec | None = None,
        sinks: Sequence[Sink] = (),
        log: bool = True,
        run_hash: bool = True,
        timing: bool = True,
        finite_check: bool = True,
        time_source: TimeSource | None = None,
        on_ready: Callable[[], None] | None = None,
        plain: bool = False,
        fuse: bool = True,
        real_time: RealTimeOptions = NO_REAL_TIME,
    ) -> None:
        real_time.check()
        self._real_time = real_time
        self.bound = graph if isinstance(graph, BoundGraph) else BoundGraph(graph)
        self.life = LifeCycle(self.bound.blocks)
        self._time: TimeSource = time_source or WallTime()
        spec = clock or self.bound.graph.clock
        self.bound.clock.kind = spec.kind
        self._spec = spec
        self.ticker = Ticker(
            self.bound,
            spec,
            self._time,
            timing=timing,
            finite_check=finite_check,
        )
        self._log = MemoryLog() if log else None
        self._hash = RunHash() if run_hash else None
        own: list[Sink] = [sink for sink in (self._log, self._hash) if sink is not None]
        self._sinks: list[Sink] = [*own, *sinks]
        self._opened: list[Sink] = []
        self._on_ready = on_ready
        self._plain = plain
        self._fuse = fuse and not plain
        self._warnings: list[str] = []
        self._paused = 0  # [ns]
        self._error: RunError | None = None

    @collector_paused()
    def start(self, ticks: int | None = None) -> None:
        """Compile the kernels, open the sinks and start all blocks: idle -> ready.

        A run that Python steps calls this, too; ``ticks`` is how many there will be, if known.

        Raises:
            RunError: a block failed in its start.
        """
        self._compile_kernels()
        self._open_sinks(ticks)
        self.life.start()
        self._note("life", "ready: every block has started")

    def run(self, ticks: int | None = None) -> RunResult:
        """Run the graph through its whole life: start, ticks, stop cycles, close.

        The run lasts ``ticks`` ticks, by default the graph's duration. SIGINT, SIGTERM and a block
        that asks for it end the run after the present tick. The result has what ended the run,
        also if it was an error: see ``RunResult.raise_if_failed``.

        Raises:
            AloftError: the graph has run already.
        """
        if self.life.state is not LifeState.IDLE:
            raise AloftError(f"a graph that is {self.life.state.value} cannot be run again")
        clock, graph = self.bound.clock, self.bound.graph
        limit = ticks
        if ticks is None and graph.ticks is not None:
            limit = max(0, graph.ticks - clock.tick)  # a restored graph runs only the rest
        error: RunError | None = None
        problems: list[str] = []
        start_time = end_time = self._time.now()
        first_tick = clock.tick
        with (
            Interrupts(clock, self.life) as interrupts,
            Watchdog(
                self.ticker, self.life, interrupts, self._spec.hangs_after,
                lambda block, place, stack: self._abandon(block, place, stack, interrupts),
            ) as watchdog,
            _collector_paused(collect=self.ticker.pacer is not None),
        ):  # fmt: skip
            try:
                try:
                    interrupts.armed = True
                    self.start(limit)
                    self._ask_for_warnings()
                    if self._on_ready is not None:
                        self._on_ready()
                    self.life.move(LifeState.RUNNING)
                    self._note("life", "running")
                    with self._real_time.granted():
                        start_time = self._time.now()
                        self._advance(limit, interrupts, watchdog)
                    if watchdog.hung is not None:
                        raise watchdog.hung
                finally:  # within the outer try, so that nothing interrupts what follows
                    interrupts.armed = False
            except RunError as failure:
                error = failure
            except BaseException as failure:  # noqa: BLE001  # the stop cycles come first
                error = RunError(f"the run failed: {describe(failure)}", tick=clock.tick)
                error.__cause__ = failure
            finally:
                end_time = self._time.now()
                self._error = error
                if error is not None:
                    self._note_error(locate(error))
                self._note("life", f"stopping: {clock.stop_reason or 'the end'}")
                self.life.stop(self._pause if self.ticker.pacer is not None else None)
                problems += self.life.problems
                for problem in problems:
                    self._note("fault", problem, "ERROR")
                self._note("life", "stopped")
                problems += self._close_sinks()
        result = self._result(
            clock.tick - first_tick, (end_time - start_time - self._paused) * 1e-9, error, problems,
            interrupts,
        )  # fmt: skip
        return replace(result, warnings=tuple(self._finish_sinks(result)))

    def _advance(self, ticks: int | None, interrupts: Interrupts, watchdog: Watchdog) -> None:
        """Run the ticks, with pauses where somebody asks for them."""
        control = self.ticker.control
        if control is None:
            self.ticker.advance(ticks)
            return
        control.begin(ticks, lambda: interrupts.received is not None or watchdog.hung is not None)
        while True:
            began = self._time.now()
            goes_on = control.may_go_on()
            self._paused += self._time.now() - began
            if not goes_on:
                return
            self.ticker.advance(control.ticks)

    def result(self, error: RunError | None = None) -> RunResult:
        """Return the outcome so far of a run that is stepped; ``error`` is what has ended it."""
        clock = self.bound.clock
        return self._result(clock.tick, 0.0, error, [], Interrupts(clock, self.life))

    def _abandon(self, block: str, place: str, stack: str, interrupts: Interrupts) -> None:
        """End a run whose thread cannot be interrupted: the stop cycles go out from this thread,
        and unless somebody works at this interpreter, the process ends."""
        interactive = hasattr(sys, "ps1")
        if not interactive:  # what follows may hang as well
            threading.Timer(self._spec.hangs_after, os._exit, (int(ExitCode.RUN_FAILED),)).start()
        clock = self.bound.clock
        who = f"block '{block}'" if block else "the runtime"
        text = hang_text(who, self.ticker.instant(clock.tick), self._spec.hangs_after)
        error = RunError(
            f"{self._before_hang(interrupts)}{text}; nothing interrupts it",
            block=block,
            tick=clock.tick,
        )
        error.where, error.traceback = place, stack
        clock.stop_reason = clock.stop_reason or str(error)
        self._note_error(error)
        if self.life.state is LifeState.RUNNING:
            self.life.stop()
        problems = [*self.life.problems, *self._close_sinks()]
        result = self._result(clock.tick, 0.0, error, problems, interrupts)
        result = replace(result, warnings=tuple(self._finish_sinks(result)))
        os.write(2, f"\n{error}\n  it is at {place}\n".encode())
        for sink in self._opened:
            sink.abandoned(result)
        if not interactive:
            os._exit(int(ExitCode.RUN_FAILED))

    def _before_hang(self, interrupts: Interrupts) -> str:
        """Return what had ended the run before a call hung while it stopped; empty if nothing had."""
        if self._error is not None:
            return f"{self._error}; then "
        if self.life.state is not LifeState.STOPPING:
            return ""
        result = self._result(self.bound.clock.tick, 0.0, None, [], interrupts)
        return "" if result.success else f"{result.reason}; then "

    def _compile_kernels(self) -> None:
        """Compile the kernels that the blocks call, before any block is started."""
        if self._plain:
            return
        reason = compile_calls(self.bound.kernel_calls)
        self.bound.parameters.compile = None if reason else compile_calls
        if reason:
            self._warnings.append(
                f"the mathematics runs as plain Python, which is several times slower: {reason}"
            )

    def _open_sinks(self, ticks: int | None) -> None:
        if self._log is not None:
            self._log.expect(ticks)
        for sink in self._sinks:
            self._opened.append(sink)  # before the call, as a failed open may have opened a file
            sink.open(self.bound)
            self.ticker.records.append(sink.record)
            self.ticker.notes.append(sink.note)
        self.ticker.sinks = tuple(self._opened)
        if self._fuse:  # once the freeze guard has said where the block that runs is written
            self.ticker.fuse()
        for sink in self._sinks:
            sink.watch_ticker(self.ticker)
        for block in self.bound.blocks.values():
            if isinstance(block, WorkerBlock):
                block.watch_ticker(self.ticker)

    def _close_sinks(self) -> list[str]:
        problems = []
        for sink in self._opened:
            try:
                sink.close()
            except Exception as error:  # noqa: BLE001  # the next sink must be closed too
                problems.append(f"{type(sink).__name__} failed in close: {describe(error)}")
        return problems

    def _finish_sinks(self, result: RunResult) -> list[str]:
        warnings = []
        for sink in self._opened:
            try:
                warnings += sink.finish(result)
            except Exception as error:  # noqa: BLE001  # the next sink must be finished too
                warnings.append(f"{type(sink).__name__} failed in finish: {describe(error)}")
        return warnings

    def _note(self, kind: str, text: str, level: str = "INFO") -> None:
        self.ticker.tell(Note(self.bound.clock.tick, kind, text, level))

    def _note_error(self, error: RunError) -> None:
        """Note what ended the run: where it was raised, and for machines the whole traceback."""
        place = f" (at {error.where})" if error.where else ""
        note = Note(self.bound.clock.tick, "fault", f"{error}{place}", "ERROR", error.to_json())
        self.ticker.tell(note)

    def _ask_for_warnings(self) -> None:
        self._add_warnings()
        for warning in self._warnings:
            self._note("warning", warning, "WARN")

    def _add_warnings(self) -> None:
        """Add the warnings of the blocks that are new, in the order of the blocks."""
        for path, block in self.bound.blocks.items():
            known = set(self._warnings)
            texts = [f"{path}: {text}" for text in block.warnings()]
            self._warnings += [text for text in texts if text not in known]

    def _pause(self) -> None:
        """Wait for one period between two stop cycles, so that a bus has time to carry each."""
        self._time.sleep(self.bound.clock.base_period)

    def _result(
        self,
        ticks: int,
        wall_time: float,
        error: RunError | None,
        problems: list[str],
        interrupts: Interrupts,
    ) -> RunResult:
        if error is None:
            self._add_warnings()
        by_block: dict[str, dict[str, Metric]] = {}
        giving: dict[str, Block | Sink] = {**self.bound.blocks}
        giving |= {sink.name: sink for sink in self._opened if sink.name}
        for path, block in giving.items():
            try:
                by_block[path] = dict(block.metrics())
            except Exception as failure:  # noqa: BLE001  # the other blocks' metrics still count
                problems.append(f"block '{path}' failed in metrics: {describe(failure)}")
        metrics, unmet, success_reason = merge_metrics(by_block)
        unmet = unmet or self._too_late(ticks)
        judges = [path for path, of_block in by_block.items() if of_block.get("reason")]
        ended = by_block.get(self.bound.clock.stopped_by, {})
        if not ended.get("success", True) and ended.get("reason"):
            unmet = str(ended["reason"])  # the cause, before what follows from it
        unmet, success_reason = (
            self._with_stop(unmet, judges),
            self._with_stop(success_reason, judges),
        )
        code, reason = self._verdict(error, problems, interrupts, unmet, success_reason)
        for program in self.ticker.programs:
            program.fold()
        pacer = self.ticker.pacer
        return RunResult(
            success=code is ExitCode.SUCCESS,
            reason=reason,
            exit_code=code,
            ticks=ticks,
            period=self.bound.clock.base_period,
            wall_time_s=wall_time,
            run_hash=self._hash.hexdigest() if self._hash is not None else "",
            metrics=metrics,
            blocks={path: self._times_of(path) for path in self.bound.graph.order},
            overruns=pacer.lateness.late if pacer is not None else 0,
            skipped_periods=pacer.skipped_periods if pacer is not None else 0,
            lateness=pacer.lateness.result() if pacer is not None else None,
            error=error,
            stop_problems=tuple(problems),
            block_warnings=tuple(self._warnings),
            parameter_changes=tuple(self.bound.parameters.changes),
            log=self._log,
            graph=self.bound.graph,
        )

    def _too_late(self, ticks: int) -> str | None:
        """Return why a run with so many late ticks is no success, where its graph has a limit."""
        pacer, share = self.ticker.pacer, self.ticker.policy.late_share
        if pacer is None or share is None or pacer.lateness.late <= share * ticks:
            return None
        return (
            f"{pacer.lateness.late} of {ticks} ticks began late, at most {100.0 * share:g} % may "
            "(clock.late_share)"
        )

    def _times_of(self, path: str) -> BlockTimes:
        block = self.bound.blocks[path]
        if isinstance(block, WorkerBlock):
            return block.worker_times()
        return block_times(self.ticker.programs, path, self.ticker.overruns_by_block[path])

    def _with_stop(self, verdict: str | None, judges: Sequence[str]) -> str | None:
        """Return a verdict, with the reason of another block that ended the run; a score knows its
        own."""
        clock = self.bound.clock
        if verdict is None or not clock.stop_reason or clock.stopped_by in ("", *judges):
            return verdict
        return f"{verdict}; block '{clock.stopped_by}' ended the run: {clock.stop_reason}"

    def _verdict(
        self,
        error: RunError | None,
        problems: Sequence[str],
        interrupts: Interrupts,
        unmet: str | None,
        success_reason: str | None,
    ) -> tuple[ExitCode, str]:
        """Return the exit code and the reason: the gravest code, and first what came first."""
        stopped = self.bound.clock.stop_reason
        if error is not None and not isinstance(error.__cause__, KeyboardInterrupt):
            return ExitCode.RUN_FAILED, str(error)
        if interrupts.received is not None:
            code = ExitCode(128 + interrupts.received)
            return code, str(error or f"stopped by {interrupts.received.name}")
        if error is not None:
            return ExitCode.INTERRUPTED, str(error)
        if problems:
            # what went wrong while stopping came after what ended the run
            return ExitCode.RUN_FAILED, "; ".join([*([unmet] if unmet else []), problems[0]])
        if unmet is not None:
            return ExitCode.NOT_SUCCESSFUL, unmet
        return ExitCode.SUCCESS, success_reason or stopped or "ran to its end"


@contextmanager
def _collector_paused(*, collect: bool) -> Iterator[None]:
    """Switch the garbage collector off within, and exempt all existing objects from requested
    collections, so that no collection interrupts a tick.

    With ``collect`` garbage is collected before. That takes tens of milliseconds, which count where
    many short runs follow each other as fast as possible.
    """
    if collect:
        gc.collect()
    with objects_frozen(), collector_off():
        yield


def run(graph: CheckedGraph | BoundGraph, ticks: int | None = None, **options: Any) -> RunResult:
    """Run a graph from start to close; the options are those of ``Executor``."""
    return Executor(graph, **options).run(ticks)
