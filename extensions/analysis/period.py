"""One common period of a graph's rates, run again and again from one instant with small changes.

It makes the calls of the ticks itself, so that a signal can be changed between the block that writes it
and those that read it. Without a change it gives the same bytes as the runtime.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence

import numpy as np

from ...runtime.language.errors import AloftError
from ...runtime.language.schedule import phases
from ...runtime.running.memory import BoundGraph
from ...runtime.running.snapshot import Snapshot
from ...runtime.running.tick_calls import tick_calls
from .coordinates import Coordinates


class Period:
    """The ticks from a snapshot to the next instant at which every block is in the same phase.

    Args:
        bound: a running graph, in the instant of interest.
        inputs: signals to which a displacement is added.
        outputs: signals that are observed at the end of each tick; one that is also an input is
            observed before the displacement is added.
        held: whether inputs are open: what is read is the value of the undisturbed run, and not what
            the block has written.
        only: the blocks that run; what the others have written stays as it is. By default all run.

    Attributes:
        ticks: the length of the period.
        displacement: of each input in each tick, (ticks, elements).
        observed: of each output in each tick, (ticks, elements).
    """

    def __init__(
        self,
        bound: BoundGraph,
        inputs: Sequence[Coordinates] = (),
        outputs: Sequence[Coordinates] = (),
        *,
        held: bool = False,
        only: Container[str] | None = None,
    ) -> None:
        graph = bound.graph
        self.bound, self.inputs, self.outputs, self.held = bound, inputs, outputs, held
        outputs_of, updates_of = tick_calls(graph, bound.blocks)
        active = phases([(call.period, call.offset) for call in outputs_of])
        self._table = [[outputs_of[k].path for k in phase] for phase in active]
        touched = [each.block for each in (*inputs, *outputs)]
        blocks = {p: b for p, b in bound.blocks.items() if only is None or p in only}
        self._blocks = blocks
        self._calls = [
            [
                (path, getattr(blocks[path], outputs_of[k].method) if path in blocks else _nothing, path in touched)
                for k in phase if (path := outputs_of[k].path) in blocks or path in touched
            ]
            for phase in active
        ]  # fmt: skip
        self._updates = [
            [
                (c.path, getattr(blocks[c.path], c.method))
                for c in updates_of
                if c.path in blocks and c.path in phase
            ]
            for phase in self._table
        ]
        self.ticks = len(self._table)
        self.start: Snapshot = bound.snapshot()
        self.displacement = [np.zeros((self.ticks, len(each.places))) for each in inputs]
        self.observed = [np.zeros((self.ticks, len(each.places))) for each in outputs]
        self._nominal = [np.zeros((self.ticks, len(each.places))) for each in inputs]
        self._recording = True
        try:
            self.run()
        finally:
            self._recording = False

    def samples(self, signal: Coordinates) -> list[int]:
        """Return the ticks of the period, from zero, in which the block of a signal runs."""
        first = self.start.tick
        return [
            k for k in range(self.ticks) if signal.block in self._table[(first + k) % self.ticks]
        ]

    def run(self, change: Callable[[], None] | None = None) -> None:
        """Run the period from its start, after ``change`` has changed the memory.

        Afterwards the memory is that of its end, with every block's state saved.

        Raises:
            AloftError: a block failed.
        """
        bound = self.bound
        bound.memory.restore(self.start)
        bound.clock.tick, bound.clock.stop_reason = self.start.tick, None
        if change is not None:
            change()
        path = ""
        try:
            for path, block in self._blocks.items():  # noqa: B007  # the error names it
                block.load_state()
            for output, observed in zip(self.outputs, self.observed, strict=True):
                observed[:] = output.read(bound.memory.state)
            for k in range(self.ticks):
                phase = bound.clock.tick % self.ticks
                for path, call, touched in self._calls[phase]:
                    call()
                    if touched:
                        self._pass(path, k)
                for path, call in self._updates[phase]:  # noqa: B007  # the error names it
                    call()
                bound.clock.tick += 1
            for path, block in self._blocks.items():  # noqa: B007  # the error names it
                block.save_state()
        except Exception as error:
            raise AloftError(f"block '{path}' failed in a perturbed run: {error}") from error

    def _pass(self, path: str, k: int) -> None:
        """Observe what a block has written, and then displace it."""
        flat = self.bound.memory.bus.sections["float64"]
        for output, observed in zip(self.outputs, self.observed, strict=True):
            if output.block == path:
                observed[k:] = flat[output.places]
        for each, displacement, nominal in zip(
            self.inputs, self.displacement, self._nominal, strict=True
        ):
            if each.block == path:
                if self._recording:
                    nominal[k] = flat[each.places]
                elif self.held:
                    flat[each.places] = nominal[k]
                flat[each.places] += displacement[k]


def _nothing() -> None:
    """Replace the call of a block that does not run."""
