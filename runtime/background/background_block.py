"""Block that works in the background: its stand-in in the graph, which sends it its jobs.

It samples the inputs at every run and gives them to a worker, a process that runs the block itself; the
outputs that follow from them appear N runs later, neither sooner nor later. So it has the outputs of
the block followed by a delay of N runs, to the byte. In virtual time the run waits for a result that is
due. In real time it never waits: a result that is late is counted, and the block's policy sets the
outputs meanwhile.

What has been sampled and is not yet shown is part of the state, as is the block's own state after the
run that is shown. So a snapshot holds all that it takes to compute what is under way again.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ..language.block import Block, Metric, State, UnmetRequirement
from ..language.context import Context
from ..language.delay import ring_signal
from ..language.errors import RunError
from ..language.parameters import Parameters
from ..language.quantities import InputQuantities, OutputQuantities
from ..language.registry import block_name
from ..language.signals import Field, Signal
from ..language.stages import ClockSpec, WhenLate
from ..running.sink import Note
from ..running.ticker import Ticker, WorkerBlock
from ..running.timing import KEPT_TICKS, BlockTimes, times_of
from .job_memory import Copies, copies, copy, record_size
from .worker import views
from .worker_link import WorkerLink

STILL_COMPUTING = "its worker was still computing when the run had ended; it has no metrics"
END_TIME = 1.0
"""Seconds that a worker has to end a run in real time."""


@dataclass(frozen=True)
class Background:
    """Settings of a block that works in the background.

    Attributes:
        latency: after how many runs of the block the outputs appear, from 1.
        late: what the outputs are in real time while a result that is due is not there: ``hold``
            the last values, ``safe`` zeros, or ``stop`` the run.
        initial: the outputs before the first result, by output and field; otherwise zero.
    """

    latency: int
    late: WhenLate = "stop"
    initial: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)


class BackgroundBlock(WorkerBlock):
    """Stands for a block that works in the background; see the module's text.

    Subclasses made by ``background_block_type`` have the ports, states and parameters of the block, and
    its name. What this class keeps begins with an underscore, so it meets no port.

    Raises:
        RunError: a result is late in real time, and the policy is to stop.
        WorkerError: the worker has died, or a run takes longer than ``clock.hangs_after``.
    """

    waits_for_others = True
    _block_type: ClassVar[type[Block]]
    _background: ClassVar[Background]

    @classmethod
    def is_moore(cls) -> bool:
        """Return true: outputs follow from earlier inputs alone."""
        return True

    @classmethod
    def specialize(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Block]:
        """Return the class itself, which was made for a specialized class."""
        return cls

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """Return the block\'s dimensions."""
        return cls._block_type.dimensions(params, robot)

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Return the block\'s dimensions of state."""
        return cls._block_type.state_dimensions(params, robot)

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Return the block's unmet requirements."""
        return cls._block_type.requires(params, context)

    @classmethod
    def exported_values(cls, params: Parameters, context: Context) -> Mapping[str, Any]:
        """Return the block's exported values."""
        return cls._block_type.exported_values(params, context)

    @classmethod
    def infer_units(cls, params: Parameters, inputs: InputQuantities) -> OutputQuantities:
        """Return the block\'s quantities of outputs."""
        return cls._block_type.infer_units(params, inputs)

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return the block\'s example parameters."""
        return cls._block_type.example_parameters()

    @classmethod
    def example_inputs(
        cls, rng: np.random.Generator, dimensions: Mapping[str, int]
    ) -> Mapping[str, Mapping[str, Any]]:
        """Return the block\'s example inputs."""
        return cls._block_type.example_inputs(rng, dimensions)

    def setup(self) -> None:
        """Take the initial outputs; nothing is under way."""
        kind = type(self)
        self._slots = self._background.latency
        period = self.context.period_ticks
        self._latency = self._slots * period
        self._outputs: list[NDArray[Any]] = views(self, kind.outputs)
        self._inputs: list[NDArray[Any]] = views(self, kind.inputs, self.context.wired)
        self._states: list[NDArray[Any]] = views(self, self._block_type.states)
        self._pending: list[NDArray[Any]] = views(
            self, [_pending(name) for name in kind.inputs if name in self.context.wired]
        )
        jobs = getattr(self, JOBS)
        self._sampled, self._marks = jobs.sampled.data, jobs.marks.data
        jobs.sampled[:] = jobs.marks[:] = -1
        self._blank = [np.array(each) for each in self._outputs]
        for port, values in self._background.initial.items():
            for name, value in values.items():
                getattr(self, port).views()[name][...] = value
        self._numbers = [0] * self._slots
        """The number of the job in each slot."""
        self._changes: list[tuple[int, Parameters]] = []
        """The parameters, and from which tick on they hold."""
        self._worker_has: Parameters | None = None
        self._worker: WorkerLink | None = None
        self._restored = False
        self._ticker: Ticker | None = None
        self._in_real_time = False
        self._late = self._late_in_a_row = self._shown = 0
        self._times: NDArray[np.int64] = np.zeros(KEPT_TICKS, np.int64)
        self._total = self._longest = 0
        self._metrics: Mapping[str, Metric] = {}
        self._warnings: Sequence[str] = ()

    def prepare(self) -> None:
        """Note the parameters for the runs from this tick on."""
        self._changes.append((self.tick, self.params))

    def watch_ticker(self, ticker: Ticker) -> None:
        """Take whom to tell of late results."""
        self._ticker = ticker

    def start(self) -> None:
        """Start the worker."""
        self._in_real_time = self.context.clock.kind != "free"
        results = [*self._outputs, *self._states]
        self._worker = worker = WorkerLink(
            block_name(type(self)), self.params, self.context, self._slots,
            record_size(self._inputs), record_size(results), in_real_time=self._in_real_time,
        )  # fmt: skip
        self._worker_has = self.params
        memory, slots = worker.memory, range(self._slots)
        self._sampling: list[Copies] = []
        for slot in slots:
            ring = [
                entries[slot : slot + 1].reshape(entries.shape[1:]) for entries in self._pending
            ]
            targets = [*memory.inputs(slot, self._inputs), *ring]
            self._sampling.append(copies(targets, [*self._inputs, *self._inputs]))
        rows = [memory.results(slot, results) for slot in range(self._slots + 1)]
        self._showing = [copies(results, row) for row in rows[:-1]]
        self._zeroing = copies(self._outputs, self._blank)
        self._handing_over = copies(rows[-1], results)
        if self._restored:
            self.load_state()
        else:
            copy(copies(self._states, rows[-1][len(self._outputs) :]))

    def emit(self) -> None:
        """Show the result that is due."""
        due = self.tick - self._latency
        slot = self._slot_of(due)
        marks = self._marks
        if marks[FIRST] < 0 or due < marks[FIRST]:
            return  # the first runs: no result can be due
        worker = self._worker
        assert worker is not None
        job = self._numbers[slot]
        is_under_way = self._sampled[slot] == due
        if not self._in_real_time and is_under_way:
            worker.wait_for(slot, job, self._hangs_after)
        elif not (is_under_way and worker.memory.is_finished(slot, job)):
            self._be_late(due)
            return
        if self._late_in_a_row:
            self._late_in_a_row = 0
            self._forget(due)
        self._show(slot)

    def update(self) -> None:
        """Sample the inputs and ask for the result; not while an older one holds the slot."""
        slot = self._slot_of(self.tick)
        if self._sampled[slot] >= 0:
            return
        tick = self._sampled[slot] = self.tick
        if self._marks[FIRST] < 0:
            self._marks[FIRST] = tick
        copy(self._sampling[slot])
        if self._worker_has is not self.params:
            self._change(self.params)
        self._ask(slot, tick)

    def _slot_of(self, tick: int) -> int:
        return tick // self.context.period_ticks % self._slots

    def _ask(self, slot: int, tick: int) -> None:
        assert self._worker is not None
        self._numbers[slot] = self._worker.ask(slot, tick)

    def _change(self, params: Parameters) -> None:
        assert self._worker is not None
        self._worker.change(params)
        self._worker_has = params

    def _show(self, slot: int) -> None:
        assert self._worker is not None
        memory = self._worker.memory
        copy(self._showing[slot])
        self._marks[SHOWN] = self._sampled[slot]
        self._sampled[slot] = -1
        took = memory.duration(slot)
        self._times[self._shown % len(self._times)] = took
        self._shown += 1
        self._total += took
        self._longest = max(self._longest, took)
        reason = memory.stop_reason(slot)
        if reason:
            self.request_stop(reason)

    def _forget(self, before: int) -> None:
        """Give the slots free whose results a newer one has overtaken."""
        for slot in range(self._slots):
            if self._sampled[slot] < before:
                self._sampled[slot] = -1

    def _be_late(self, due: int) -> None:
        """Count the late result and apply the policy; an older one may have come meanwhile."""
        worker, background = self._worker, self._background
        assert worker is not None
        self._late += 1
        self._late_in_a_row += 1
        self._tell(due)
        if background.late == "stop":
            raise RunError(
                f"block '{self.context.path}' is late at tick {self.tick}: the result of tick {due} "
                "is not there, and background.late is 'stop'",
                block=self.context.path,
                tick=self.tick,
            )
        oldest = newest = -1
        for slot in range(self._slots):
            sampled = self._sampled[slot]
            if not 0 <= sampled <= due:
                continue
            if worker.memory.is_finished(slot, self._numbers[slot]):
                if newest < 0 or sampled > self._sampled[newest]:
                    newest = slot
            elif oldest < 0 or sampled < self._sampled[oldest]:
                oldest = slot
        if oldest >= 0:
            worker.expect_alive(oldest)
            if self._late_in_a_row * self.context.period > self._hangs_after:
                raise worker.hang(oldest, self._hangs_after)
        if newest >= 0:
            self._forget(self._sampled[newest])
            self._show(newest)
        elif background.late == "safe":
            copy(self._zeroing)

    def _tell(self, due: int) -> None:
        if self._ticker is not None:
            path = self.context.path
            self._ticker.overruns_by_block[path] += 1
            text = f"late: the result that block '{path}' owes for tick {due} is not there"
            data = {"block": path, "sampled": due, "late_results": self._late}
            self._ticker.tell(Note(self.tick, "late", text, "WARN", data))

    @property
    def _hangs_after(self) -> float:
        return (self._ticker.policy if self._ticker is not None else ClockSpec()).hangs_after

    def load_state(self) -> None:
        """Let the worker go on from the restored state, and compute again what was under way."""
        worker = self._worker
        self._late_in_a_row = 0
        if worker is None:
            self._restored = True
            return
        worker.memory.withdraw()
        copy(self._handing_over)
        worker.restore(with_outputs=self._marks[SHOWN] >= 0)
        inputs = worker.memory.inputs
        under_way = sorted(
            (t, slot) for slot in range(self._slots) if (t := self._sampled[slot]) >= 0
        )
        for tick, slot in under_way:
            entries = [
                entries[slot : slot + 1].reshape(entries.shape[1:]) for entries in self._pending
            ]
            copy(copies(inputs(slot, self._inputs), entries))
            params = [params for since, params in self._changes if since <= tick][-1:]
            if params and params[0] is not self._worker_has:
                self._change(params[0])
            self._ask(slot, tick)

    def close(self) -> None:
        """End the worker; in virtual time it first finishes what is under way."""
        worker, self._worker = self._worker, None
        if worker is None:
            return
        if worker.has_failed:
            worker.kill()
            return
        seconds = END_TIME
        if self._in_real_time:
            worker.memory.withdraw()
        else:
            seconds += self._hangs_after * sum(tick >= 0 for tick in self._sampled)
        self._metrics, self._warnings = worker.end(seconds) or ({}, (STILL_COMPUTING,))

    def metrics(self) -> Mapping[str, Metric]:
        """Return the block's metrics, and in real time the number of late results."""
        late = {"late_results": self._late} if self._in_real_time else {}
        return {**self._metrics, **late}

    def warnings(self) -> Sequence[str]:
        """Return the block's warnings, after the end of the run."""
        return self._warnings

    def worker_times(self) -> BlockTimes:
        """Return the times that the worker took; ``overruns`` counts the late results."""
        return times_of(
            self._times[: self._shown], self._shown, self._total, self._longest, self._late
        )


JOBS = "jobs~"
"""Name of the state with the runs under way."""
FIRST, SHOWN = 0, 1


def _pending(name: str) -> str:
    """Return the name of the state with the sampled values of an input."""
    return f"{name}~pending"


def background_block_type(block_type: type[Block], background: Background) -> type[BackgroundBlock]:
    """Return the stand-in for blocks of that type which work in the background."""
    latency = background.latency
    body = {
        "__doc__": block_type.__doc__,
        "__module__": block_type.__module__,
        "__qualname__": block_type.__qualname__,
        "Params": block_type.Params,
        "needs": block_type.needs,
        "delay_runs": latency,
        "_block_type": block_type,
        "_background": background,
    }
    kind: type[BackgroundBlock] = type(block_type.__name__, (BackgroundBlock,), body)
    fields: dict[str, Any] = {
        "__doc__": "The runs of a background block that are under way.",
        "sampled": Field(latency, dtype="int64", text="by slot the tick of a run, or -1"),
        "marks": Field(2, dtype="int64", text="the first tick that was sampled, and the one shown"),
    }
    pending = {
        _pending(name): State(ring_signal(port.signal, latency), text="sampled inputs")
        for name, port in block_type.inputs.items()
    }
    jobs: State[Any] = State(type("Jobs", (Signal,), fields), text="what is under way")
    kind.inputs, kind.outputs = block_type.inputs, block_type.outputs
    kind.states = {**block_type.states, **pending, JOBS: jobs}
    return kind
