"""A run that Python steps: some ticks, a look at the signals, an input, some ticks more.

::

    with aloft.load("graph.yaml").open(seed=3) as run:
        run.step(10)
        run["pd.command"].torque
        run["action"] = [0.1, 0.2]   # a block blocks.External
        run["pd.stiffness"] = 40.0   # a live parameter
        run.reset()
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from difflib import get_close_matches
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ..language.block import Block
from ..language.errors import AloftError, RunError
from ..language.parameter_change import Adjustment
from ..language.signals import Signal
from ..language.stages import CheckedGraph, ClockSpec
from .executor import Executor
from .life_cycle import LifeState
from .run_result import RunResult
from .sink import Sink
from .snapshot import Snapshot

Adjust = Callable[[Mapping[str, Block], Mapping[str, Any]], Adjustment]
"""Checks new values of live parameters of some blocks: ``loading.adjust``."""


class SteppedRun:
    """One run of a graph, stepped on demand and as fast as possible. Use it in a ``with``
    statement.

    Leaving the statement sends the stop cycles and closes all blocks, whatever has happened. With ``adjust``
    live parameters are set by name.

    Raises:
        RunError: a block could not be set up or started.
    """

    def __init__(
        self,
        graph: CheckedGraph,
        *,
        plain: bool = False,
        sinks: Sequence[Sink] = (),
        adjust: Adjust | None = None,
    ) -> None:
        self.graph = graph
        self._adjust = adjust
        self._executor = executor = Executor(
            graph, clock=ClockSpec(), sinks=sinks, log=False, run_hash=False, timing=False,
            plain=plain,
        )  # fmt: skip
        self._bound, self._life, self._ticker = executor.bound, executor.life, executor.ticker
        try:
            executor.start()
        except BaseException:
            self._life.stop()
            raise
        self._life.move(LifeState.RUNNING)
        self._first = self._bound.snapshot()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Send the stop cycles and close all blocks; a second call does nothing.

        Raises:
            RunError: a block failed while it was closed.
        """
        if self._life.state is LifeState.STOPPED:
            return
        self._life.stop()
        if self._life.problems:
            raise RunError("; ".join(self._life.problems))

    @property
    def tick(self) -> int:
        """Number of ticks run since the start or the last reset."""
        return self._bound.clock.tick

    @property
    def time(self) -> float:
        """The same in seconds of the graph's time."""
        return self.tick * self._bound.clock.base_period

    @property
    def stopped(self) -> bool:
        """True once a block has asked for the end, also in the last tick of the graph's duration."""
        return self._bound.clock.stop_reason is not None

    @property
    def reason(self) -> str:
        """Reason why the run has ended; empty while it may go on."""
        if self._bound.clock.stop_reason is not None:
            return self._bound.clock.stop_reason
        if self.graph.ticks is not None and self.tick >= self.graph.ticks:
            return "the duration is over"
        return ""

    def step(self, ticks: int = 1) -> int:
        """Run up to ``ticks`` ticks. Returns how many were run: fewer where the run has ended.

        Raises:
            RunError: a block failed, or a value is not finite.
            AloftError: the run is closed, or ``ticks`` is below 1.
        """
        self._must_be_open()
        if ticks < 1:
            raise AloftError(f"a run is stepped by at least 1 tick, not {ticks}")
        if self.graph.ticks is not None:
            ticks = min(ticks, self.graph.ticks - self.tick)
        return self._ticker.advance(ticks) if ticks > 0 and not self.reason else 0

    def reset(self) -> None:
        """Go back to the start: all signals and states are as they were before the first tick."""
        self.restore(self._first)

    def change(self, adjustment: Adjustment) -> None:
        """Change live parameters, from the next tick on; ``loading.adjust`` makes the adjustment.

        Raises:
            AloftError: a block refuses them, and all keep the old ones, or the run is closed.
        """
        self._must_be_open()
        self._bound.parameters.apply(adjustment, self.tick)
        self._ticker.refresh_chains()

    def result(self, error: RunError | None = None) -> RunResult:
        """Return the outcome of what has run so far, as of a run that ends here; ``error`` has
        ended it.

        The stop cycles come after it.
        """
        return self._executor.result(error)

    def snapshot(self) -> Snapshot:
        """Return the whole state of the graph now."""
        self._must_be_open()
        return self._bound.snapshot()

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot of this graph.

        Raises:
            ValueError: it is of another graph.
        """
        self._must_be_open()
        self._bound.restore(snapshot)

    def block(self, path: str) -> Block:
        """Return the block at that path, for tools that know what it is. Raises ``KeyError``."""
        return self._bound.blocks[path]

    def __getitem__(self, name: str) -> Any:
        """Return a copy of a signal (``"pd.command"``) or of one of its fields
        (``"pd.command.torque"``), or the value of a parameter (``"pd.stiffness"``).

        Raises:
            KeyError: there is none of that name; the text has the nearest.
        """
        bus = self._bound.memory.bus
        if name in bus.layout.slots:
            return bus.field(name, writable=False).copy()
        block, _, port = name.rpartition(".")
        found = self._bound.blocks.get(block)
        if found is not None and port in type(found).outputs:
            signal: Signal = getattr(found, port)
            return type(signal).bind({n: view.copy() for n, view in signal.views().items()})
        if found is not None and port in type(found.params).model_fields:
            return deepcopy(getattr(found.params, port))
        raise KeyError(f"no signal {name!r}{_nearest(name, self._names())}")

    def __setitem__(self, name: str, value: Any) -> None:
        """Set the vector of a block ``blocks.External``, as ``"action"`` or ``"action.y"``, or a live parameter,
        as ``"pd.stiffness"``, from the next tick on. A reset leaves parameters as they are.

        Raises:
            KeyError: there is no such block.
            ValueError: the value has another shape, or is not finite.
            LoadError: there is no such parameter, it is not live, or the value is none that it may have.
            AloftError: the block refuses the value.
        """
        self._must_be_open()
        path = name.removesuffix(".y")
        block = self._bound.blocks.get(path)
        if block is None and self._adjust is not None and self._is_parameter(name):
            plain = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
            self.change(self._adjust(self._bound.blocks, {name: plain}))
            return
        if block is None or type(block).__name__ != "External":
            external = [p for p, b in self._bound.blocks.items() if type(b).__name__ == "External"]
            raise KeyError(
                f"{name!r} is neither a block blocks.External nor a parameter, which alone can be set; "
                f"blocks.External: {', '.join(external) or 'none'}"
            )
        target: NDArray[np.float64] = block.x.value  # type: ignore[attr-defined]  # of blocks.External
        array = np.asarray(value, np.float64)
        if array.shape not in ((), target.shape):
            raise ValueError(f"{path} has shape {target.shape}, not {array.shape}")
        if not np.isfinite(array).all():
            raise ValueError(f"{path} cannot be set to what is not finite: {array.tolist()}")
        target[...] = array

    def _is_parameter(self, name: str) -> bool:
        """Return whether a name can only be meant as that of a parameter of a block."""
        path = name
        while "." in path:
            path = path.rpartition(".")[0]
            if path in self._bound.blocks:
                first = name[len(path) + 1 :].partition(".")[0]
                return first not in type(self._bound.blocks[path]).outputs
        return False

    def __repr__(self) -> str:
        state = self._life.state.value if self._life.state is not LifeState.RUNNING else self.reason
        return f"<SteppedRun of {self.graph.name!r}: tick {self.tick}, {state or 'may go on'}>"

    def _names(self) -> list[str]:
        ports = [
            f"{path}.{port}" for path, b in self._bound.blocks.items() for port in type(b).outputs
        ]
        return [*ports, *self._bound.memory.bus.layout.slots]

    def _must_be_open(self) -> None:
        if self._life.state is not LifeState.RUNNING:
            raise AloftError(f"this run is {self._life.state.value}; open the graph again")


def _nearest(name: str, names: list[str]) -> str:
    found = get_close_matches(name, names, 1, 0.0)
    return f"; the nearest is {found[0]}" if found else ""
