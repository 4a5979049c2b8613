"""The process that runs one background block: the block alone in a graph of its own.

The jobs lie in memory that both processes share; the worker does them in the order of their numbers. In
virtual time it is woken for each. In real time it looks by itself, every millisecond or less, because a
control thread that wakes another may lose its processor to it.

Through its standard input come first the ``WorkerTask`` and then messages, each of which names the
job before which it holds. When its input ends, it closes the block and answers with the block's
metrics and warnings.
"""

from __future__ import annotations

import json
import os
import pickle
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from select import select
from struct import Struct
from typing import Any

from ...mathematics.compiling.compile_calls import compile_calls
from ...processes.child import report_ready
from ..language.block import Block, Output
from ..language.context import Context
from ..language.errors import AloftError
from ..language.parameter_change import Adjustment
from ..language.parameters import Parameters
from ..language.registry import find_block
from ..language.stages import BlockSpec, CheckedGraph, Wire
from ..running.failures import describe
from ..running.memory import BoundGraph
from .job_memory import JobMemory, copies, copy, record_size

MESSAGE = Struct("@qqq")
"""A kind, the number of a job, and a further number."""
WAKE, RESTORE, CHANGE = range(3)
"""Look for jobs. From that job on, go on from the states in the last slot, and where the further number
is not zero from the outputs there. From that job on, take over parameters, of which so many bytes of
JSON follow."""
BELL = b"."
"""Byte that the worker writes after each job, which wakes up a process that waits for it."""
NICENESS = 5
"""Niceness of the worker in real time; the control thread takes precedence."""


@dataclass(frozen=True)
class WorkerTask:
    """Task of a worker: its block, with all that is needed to make it.

    Attributes:
        use: the block, as a graph file names it.
        params: its parameters as JSON.
        context: the one it has in its graph.
        descriptor: of the shared memory.
        answers: the descriptor of the pipe on which it rings and answers.
        slots, inputs, results: see ``JobMemory``.
        look_every: the seconds after which it looks for jobs; ``None``: it is woken.
    """

    use: str
    params: str
    context: Context
    descriptor: int
    answers: int
    slots: int
    inputs: int
    results: int
    look_every: float | None


def main() -> None:
    """Work until the input ends."""
    requests = os.dup(0)
    with open(os.devnull, "rb") as nothing:  # the block is not to read the messages
        os.dup2(nothing.fileno(), 0)
    with open(requests, "rb", buffering=0, closefd=False) as stream:
        task: WorkerTask = pickle.load(stream)
    if task.look_every is not None:
        with suppress(OSError):
            os.nice(NICENESS)
    worker = Worker(task, requests)
    try:
        report_ready()
        worker.serve()
    finally:
        worker.block.close()
    worker.answer()


class Worker:
    """The block and what surrounds it.

    Raises:
        AloftError: the block is not the one that the graph has.
    """

    def __init__(self, task: WorkerTask, requests: int) -> None:
        self._task, self._requests = task, requests
        self._received = b""
        self._messages: deque[tuple[int, int, int, bytes]] = deque()
        context = task.context
        kind = _find(task.use, context)
        params = kind.Params.model_validate_json(task.params)
        kind = kind.specialize(params, context.folder, context.robot, context.graph_folder)
        self._bound = bound = BoundGraph(_graph(kind, params, context), context.clock)
        reason = compile_calls(bound.kernel_calls)
        bound.parameters.compile = None if reason else compile_calls
        self.block: Any = bound.blocks[context.path]
        self._memory = memory = JobMemory(task.descriptor, task.slots, task.inputs, task.results)
        source = bound.blocks[_source(context)]
        inputs = views(source, kind.inputs, context.wired)
        results = [*views(self.block, kind.outputs), *views(self.block, kind.states)]
        if (record_size(inputs), record_size(results)) != (task.inputs, task.results):
            raise AloftError("its signals have other sizes than in the graph")
        slots = range(task.slots + 1)
        self._inputs = [copies(inputs, memory.inputs(slot, inputs)) for slot in slots]
        rows = [memory.results(slot, results) for slot in slots]
        self._results = [copies(row, results) for row in rows]
        outputs = len(views(self.block, kind.outputs))
        self._initial = [output.copy() for output in results[:outputs]]
        self._restored = copies(results, rows[-1])
        self._first_outputs = copies(results[:outputs], self._initial)
        self._refused: list[str] = []
        self.block.start()
        self.block.save_state()
        copy(self._results[-1])

    def serve(self) -> None:
        """Do the jobs until the input ends, and then those that are still asked for."""
        memory, last, goes_on = self._memory, 0, True
        while True:
            job, slot = memory.next_job(last)
            if goes_on:
                goes_on = self._receive(0.0 if job else self._task.look_every)
            elif not job:
                return
            if job:
                last = job
                if self._obey(job):
                    self._run(slot, job)

    def _receive(self, seconds: float | None) -> bool:
        """Take the messages that come within a time, or until one comes. Returns false at their end."""
        while select([self._requests], [], [], seconds)[0]:
            piece = os.read(self._requests, 1 << 16)
            if not piece:
                return False
            self._received += piece
            seconds = 0.0
            while len(self._received) >= MESSAGE.size:
                kind, job, number = MESSAGE.unpack_from(self._received)
                end = MESSAGE.size + (number if kind == CHANGE else 0)
                if len(self._received) < end:
                    break
                text = self._received[MESSAGE.size : end]
                self._received = self._received[end:]
                if kind != WAKE:
                    self._messages.append((kind, job, number, text))
        return True

    def _obey(self, job: int) -> bool:
        """Do what messages say for a job. Returns false where it is one from before a restore."""
        if any(kind == RESTORE and first > job for kind, first, _, _ in self._messages):
            return False
        while self._messages and self._messages[0][1] <= job:
            kind, _, number, text = self._messages.popleft()
            if kind == RESTORE:
                self._restore(with_outputs=bool(number))
            else:
                self._change(text)
        return True

    def _run(self, slot: int, job: int) -> None:
        memory, clock = self._memory, self._bound.clock
        started = time.perf_counter_ns()
        clock.tick = memory.tick_of(slot)
        copy(self._inputs[slot])
        if not memory.is_asked(slot, job):
            return  # it was withdrawn, and the slot may be written again
        clock.stop_reason = None
        if type(self.block).is_moore():
            self.block.emit()
            self.block.update()
        else:
            self.block.step()
        self.block.save_state()
        copy(self._results[slot])
        memory.finish(slot, job, time.perf_counter_ns() - started, clock.stop_reason or "")
        with suppress(BlockingIOError):  # nobody waits, and the pipe is full
            os.write(self._task.answers, BELL)

    def _restore(self, *, with_outputs: bool) -> None:
        copy(self._restored)
        if not with_outputs:
            copy(self._first_outputs)
        self.block.load_state()

    def _change(self, text: bytes) -> None:
        """Take over parameters; those that the block refuses leave the old ones."""
        path = self._task.context.path
        try:
            params = type(self.block).Params.model_validate_json(text)
            tick = self._bound.clock.tick
            self._bound.parameters.apply(Adjustment({path: params}, ()), tick)
        except AloftError as error:
            self._refused.append(describe(error))

    def answer(self) -> None:
        """Send the block's results and warnings of the run."""
        answer = {
            "metrics": {name: _plain(value) for name, value in self.block.metrics().items()},
            "warnings": [*self.block.warnings(), *self._refused],
        }
        os.set_blocking(self._task.answers, True)
        data = memoryview(json.dumps(answer).encode())
        while data:
            data = data[os.write(self._task.answers, data) :]


def _plain(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


def views(block: Block, ports: Any, names: Any = None) -> list[Any]:
    """Return the arrays of some of a block's ports, in the order of declaration."""
    wanted = ports if names is None else [name for name in ports if name in names]
    return [view for name in wanted for view in getattr(block, name).views().values()]


def _find(use: str, context: Context) -> type[Block]:
    """Find the block's class, as seen from its own file, then from the graph's."""
    try:
        return find_block(use, context.folder)
    except AloftError:
        return find_block(use, context.graph_folder)


def _source(context: Context) -> str:
    return f"{context.path}~inputs"


class _Inputs(Block):
    """Stands for all blocks that the block reads; the worker writes its outputs."""

    def step(self) -> None:
        """Do nothing."""


def _graph(kind: type[Block], params: Parameters, context: Context) -> CheckedGraph:
    """Build a graph of the block and a source with an output for each of its wired inputs."""
    path, source = context.path, _source(context)
    outputs = {name: Output(kind.inputs[name].signal) for name in context.wired}
    body = {"__doc__": _Inputs.__doc__, **outputs}
    wires = {name: Wire(f"{source}.{name}", f"{path}.{name}") for name in context.wired}
    blocks = (
        BlockSpec(source, type("Inputs", (_Inputs,), body), Parameters(), {}, context.dimensions),
        BlockSpec(
            path, kind, params, wires, context.dimensions, context.period_ticks,
            context.offset_ticks, folder=context.folder,
        ),
    )  # fmt: skip
    return CheckedGraph(
        path, 1.0 / context.clock.base_period, blocks, (source, path), robot=context.robot,
        file=str(Path(context.graph_folder) / "graph.yaml"),
    )  # fmt: skip
