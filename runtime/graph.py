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

from ..files.nodes import text_of
from .language.errors import AloftError
from .language.signal_error import FOLDER
from .language.stages import CheckedGraph, ClockSpec
from .loading import checked_again, checked_file, checked_text
from .loading.checking.parameters import adjust
from .running.executor import Executor
from .running.real_time import NO_REAL_TIME, RealTimeOptions
from .running.run_result import RunResult
from .running.sink import Sink
from .running.stepping import SteppedRun


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
        """Every parameter called ``seed``, as ``block.seed`` or ``faults.fault.seed``, in file order."""
        return tuple(
            f"{spec.path.replace(FOLDER, 'faults.', 1)}.seed"
            for spec in self.checked.blocks
            if "seed" in type(spec.params).model_fields
        )

    def run(
        self,
        duration: float | None = None,
        *,
        seed: int | None = None,
        clock: ClockSpec | None = None,
        sinks: Sequence[Sink] = (),
        log: bool = True,
        run_hash: bool = True,
        plain: bool = False,
        fuse: bool = True,
        real_time: RealTimeOptions = NO_REAL_TIME,
    ) -> RunResult:
        """Run the graph from start to close.

        Args:
            duration: how long [s of the graph's time]; by default that of the graph.
            seed: the value of every parameter called ``seed``; by default that of the graph.
            clock: how to pace it; by default that of the graph.
            sinks: what else records the run.
            log: whether to keep every signal of every tick.
            run_hash: whether to hash every tick; a long log of a robot runs twice as fast without.
            plain: whether to run all kernels as plain Python: slower, with the same bytes.
            fuse: whether blocks of kernels that follow each other are one compiled call.
            real_time: what the control thread requests from the operating system while it ticks.

        Returns:
            The outcome; a run that failed is one too, see ``RunResult.raise_if_failed``.

        Raises:
            AloftError: the duration is no time, a block could not be set up, or the operating
                system refuses what ``real_time`` asks.
        """
        ticks = None
        if duration is not None:
            ticks = round(duration * self.checked.base_rate)
            if ticks < 1:
                raise AloftError(f"a run of {duration} s is shorter than one tick")
        graph = self.checked if seed is None else self.with_seed(seed).checked
        if graph.links.paths:
            from .links.path_ages import path_sinks

            sinks = [*path_sinks(graph, clock.kind if clock is not None else ""), *sinks]
        return Executor(
            graph,
            clock=clock,
            sinks=sinks,
            log=log,
            run_hash=run_hash,
            plain=plain,
            fuse=fuse,
            real_time=real_time,
        ).run(ticks)

    def open(self, *, seed: int | None = None, plain: bool = False) -> SteppedRun:
        """Return a run that is stepped from Python, for a ``with`` statement; see ``SteppedRun``.

        Args:
            seed: the value of every parameter called ``seed``; by default that of the graph.
            plain: whether to run all kernels as plain Python.

        Raises:
            RunError: a block could not be set up or started.
        """
        checked = self.with_seed(seed).checked if seed is not None else self.checked
        return SteppedRun(checked, plain=plain, adjust=adjust)

    def with_seed(self, seed: int) -> Graph:
        """Return the same graph with this value for every parameter called ``seed``."""
        return self.changed(dict.fromkeys(self.seed_parameters, seed))

    def changed(self, overrides: Mapping[str, Any] | Sequence[str]) -> Graph:
        """Return the same graph with other parameters; what follows from them is found anew.

        Raises:
            LoadError: the changed graph may not run.
            AloftError: the graph was put together in Python, so there is nothing to check again.
        """
        if self.checked.flat is None:
            raise AloftError(
                f"the graph {self.checked.name!r} cannot be changed: it was put together in Python, "
                "not loaded; put it together with the other parameters"
            )
        return Graph(checked_again(self.checked.flat, overrides))

    def _repr_html_(self) -> str:
        """Draw the block diagram, for notebooks; without the extension ``studio`` return the text
        of the graph."""
        from .language.extensions import is_provided, provided

        if is_provided("diagram_svg"):
            return str(provided("diagram_svg")(self.checked))
        from html import escape

        return f"<pre>{escape(self.checked.text)}</pre>"

    def about(self) -> Mapping[str, Any]:
        """Return the additional result fields of a run: none."""
        return {}


def load(
    graph: str | PathLike[str] | Mapping[str, Any],
    overrides: Mapping[str, Any] | Sequence[str] = (),
    *,
    path: str | PathLike[str] = "graph.yaml",
) -> Graph:
    """Load and check a graph, with ``overrides`` applied.

    Args:
        graph: a YAML file, a shipped one such as ``aloft:jump``, the text of such a file (with more
            than one line), or the same as a mapping.
        overrides: ``{"robot.seed": 3}``, or the same as texts, ``["robot.seed=3"]``.
        path: for a text or a mapping the file that it stands for: reports name it, and what the
            graph names is searched for beside it.

    Raises:
        LoadError: the graph may not run; the text is the report of everything wrong with it.
    """
    if isinstance(graph, Mapping):
        text = "".join(f"{key}: {text_of(value)}\n" for key, value in graph.items())
        return Graph(checked_text(text, Path(path), overrides))
    if isinstance(graph, str) and "\n" in graph:
        return Graph(checked_text(graph, Path(path), overrides))
    return Graph(checked_file(Path(graph), overrides))
