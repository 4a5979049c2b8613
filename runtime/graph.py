"""A graph in the hand: load it once, run it as often as you like.

::

    result = aloft.load("graphs/jump.yaml", {"robot.seed": 3}).run()
    result.metrics["apex_above_standing_m"]
    result.signal("estimator.base.position")  # every tick, (ticks, 3)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from .language.errors import AloftError
from .language.stages import CheckedGraph, ClockSpec
from .loading import load as load_checked
from .running.executor import Executor
from .running.run_result import RunResult
from .running.sinks import Sink


@dataclass(frozen=True, repr=False)
class Graph:
    """A checked graph. Every run binds memory and blocks of its own, so runs do not meet."""

    checked: CheckedGraph

    def __repr__(self) -> str:
        graph = self.checked
        robot = f", robot {graph.robot.name}" if graph.robot is not None else ""
        length = "" if graph.ticks is None else f", {graph.ticks / graph.base_rate:.6g} s"
        return (
            f"<Graph {graph.name!r}: {len(graph.blocks)} blocks at {graph.base_rate:.6g} Hz"
            f"{length}{robot}>"
        )

    @property
    def seed_parameters(self) -> tuple[str, ...]:
        """Every parameter called ``seed``, as ``block.seed``, in file order."""
        return tuple(
            f"{spec.path}.seed"
            for spec in self.checked.blocks
            if "seed" in type(spec.params).model_fields
        )

    def run(
        self,
        duration: float | None = None,
        *,
        clock: ClockSpec | None = None,
        sinks: Sequence[Sink] = (),
        log: bool = True,
    ) -> RunResult:
        """Run the graph from start to close.

        Args:
            duration: how long [s of the graph's time]; by default as the graph says.
            clock: how to pace it; by default as the graph says.
            sinks: what else records the run.
            log: whether to keep every signal of every tick.

        Returns:
            The outcome; a run that failed is one too, see ``RunResult.raise_if_failed``.

        Raises:
            AloftError: the duration is no time, or a block could not be set up.
        """
        ticks = None
        if duration is not None:
            ticks = round(duration * self.checked.base_rate)
            if ticks < 1:
                raise AloftError(f"a run of {duration} s is shorter than one tick")
        return Executor(self.checked, clock=clock, sinks=sinks, log=log).run(ticks)


def load(path: str | PathLike[str], overrides: Mapping[str, Any] | Sequence[str] = ()) -> Graph:
    """The graph in a YAML file, checked, with ``overrides`` applied.

    Args:
        path: the file.
        overrides: ``{"robot.seed": 3}``, or the same as texts, ``["robot.seed=3"]``.

    Raises:
        LoadError: the graph may not run; the text is the report of everything wrong with it.
    """
    return Graph(load_checked(Path(path), overrides))
