"""The result of a run: whether it succeeded and why, its metrics, times and signals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..language.block import Metric
from ..language.errors import ExitCode, RunError
from ..language.layout import only_field
from ..language.parameter_change import ParameterChange
from ..language.stages import CheckedGraph
from .lateness import TickLateness
from .sinks import MemoryLog
from .timing import BlockTimes

if TYPE_CHECKING:
    from .plots import SignalPlot


@dataclass(frozen=True, repr=False)
class RunResult:
    """The outcome of one run.

    ``success`` is true only if the run ended as its graph intends (its duration was over, or a
    block asked to stop), nothing failed, not even while stopping, and no block has a metric
    ``success`` that is false. A run that was ended by an error or a signal (SIGINT, SIGTERM) is
    never a success.

    ``metrics`` are the metrics of all blocks except ``success`` and ``reason``; where two blocks
    have a metric of one name, each is called ``block.name``. ``log`` holds every tick, unless it
    was switched off.
    """

    success: bool
    reason: str
    exit_code: ExitCode
    ticks: int
    period: float
    wall_time_s: float
    run_hash: str = ""
    metrics: Mapping[str, Metric] = field(default_factory=dict)
    blocks: Mapping[str, BlockTimes] = field(default_factory=dict)
    overruns: int = 0
    """Ticks that began too late; see ``ClockSpec.late_after``."""
    skipped_periods: int = 0
    lateness: TickLateness | None = None
    """The lateness of ticks; ``None`` for a run that goes as fast as it can."""
    error: RunError | None = None
    stop_problems: tuple[str, ...] = ()
    block_warnings: tuple[str, ...] = ()
    """Warnings of the blocks to readers of the result, such as of a check that was waived."""
    parameter_changes: tuple[ParameterChange, ...] = ()
    warnings: tuple[str, ...] = ()
    """Problems beside the run itself, such as a recording that is not complete."""
    log: MemoryLog | None = None
    graph: CheckedGraph | None = None
    """The graph that ran; ``None`` only in a result made by hand."""

    def __repr__(self) -> str:
        outcome = "success" if self.success else "no success"
        logged = f", {len(self.log.ticks)} ticks logged" if self.log is not None else ""
        return (
            f"<RunResult: {outcome}: {self.reason}; {self.ticks} ticks, {self.duration_s:.6g} s"
            f"{logged}, {len(self.metrics)} metrics, hash {self.run_hash or 'none'}>"
        )

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle: all but the graph, whose blocks are code that another process
        may lack."""
        return {**self.__dict__, "graph": None}

    def _repr_html_(self) -> str:
        """Outcome and metrics as a table, for notebooks."""
        from html import escape

        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(_shown(value))}</td></tr>"
            for name, value in self.metrics.items()
        )
        outcome = "success" if self.success else "no success"
        head = f"{outcome}: {self.reason} ({self.ticks} ticks, {self.duration_s:.6g} s)"
        return f"<p><b>{escape(head)}</b></p><table>{rows}</table>"

    @property
    def duration_s(self) -> float:
        """The simulated or real time that the graph ran for [s]."""
        return self.ticks * self.period

    @property
    def time(self) -> NDArray[np.float64]:
        """The time of every recorded tick [s], (ticks,)."""
        return np.array(self._recorded().ticks, np.float64) * self.period

    def signal(self, name: str) -> NDArray[Any]:
        """All values of ``block.output.field``, (ticks, ...); an output of one field may stand for it.

        Raises:
            KeyError: there is no such field; the message has the nearest name.
            RuntimeError: the run kept no log.
        """
        log = self._recorded()
        assert log.layout is not None
        slots = log.layout.slots
        found = name if name in slots else only_field(name, slots)
        if found is None:
            near = get_close_matches(name, slots, 1, 0.0)
            raise KeyError(f"no signal {name!r}; the nearest is {', '.join(near)}")
        return log.layout.view(log.rows(), found)

    def plot(
        self, *signals: str, start: float | None = None, end: float | None = None
    ) -> SignalPlot:
        """Plot signals over time; a notebook shows it, ``save`` writes it into a file.

        Args:
            signals: ``block.output.field``, all fields of ``block.output``, or elements, such as
                ``robot.joints.position[left_knee]``. Each field gets a panel.
            start: from this time [s].
            end: up to this time [s].

        Raises:
            KeyError: there is no such signal; the message has the nearest name.
            ValueError: no signal or no such element is named, or nothing was recorded in that time.
            RuntimeError: the run kept no log.
        """
        from .plots import plot_signals

        return plot_signals(self, signals, start, end)

    def signals(self) -> tuple[str, ...]:
        """Return the names that ``signal`` knows."""
        log = self._recorded()
        assert log.layout is not None
        return tuple(log.layout.slots)

    def _recorded(self) -> MemoryLog:
        if self.log is None or self.log.layout is None:
            raise RuntimeError("this run kept no log; run it with log=True")
        return self.log

    def raise_if_failed(self) -> None:
        """Raise the ``RunError`` that ended the run, if one did."""
        if self.error is not None:
            raise self.error

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain data for ``json.dumps``; numbers that are not finite become
        null."""
        return {
            "success": self.success,
            "reason": self.reason,
            "exit_code": int(self.exit_code),
            "run_hash": self.run_hash,
            "ticks": self.ticks,
            "duration_s": self.duration_s,
            "wall_time_s": self.wall_time_s,
            "overruns": self.overruns,
            "skipped_periods": self.skipped_periods,
            "lateness": None if self.lateness is None else asdict(self.lateness),
            "metrics": {name: _plain(value) for name, value in self.metrics.items()},
            "blocks": {path: asdict(times) for path, times in self.blocks.items()},
            "error": None if self.error is None else self.error.to_json(),
            "stop_problems": list(self.stop_problems),
            "block_warnings": list(self.block_warnings),
            "warnings": list(self.warnings),
            "parameter_changes": [asdict(change) for change in self.parameter_changes],
        }


def _shown(value: Metric) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def merge_metrics(
    by_block: Mapping[str, Mapping[str, Metric]],
) -> tuple[dict[str, Metric], str | None, str | None]:
    """Merge the metrics of all blocks, and find the verdicts of the blocks that judge the run.

    A block judges the run if it has a metric ``success``. A metric ``veto`` is the reason why a run is no
    success whatever is judged, as that it was damped; where a judge has a reason of its own, that one counts.

    Returns:
        The merged metrics, in which those of judging blocks come first; the ``reason`` of the first
        block whose ``success`` is false, or the first ``veto``, or ``None``; and the ``reason`` of the
        first block whose ``success`` is true, or ``None``.
    """
    by_block = dict(sorted(by_block.items(), key=lambda item: "success" not in item[1]))
    owners: dict[str, list[str]] = {}
    failure: str | None = None
    success_reason: str | None = None
    for path, metrics in by_block.items():
        for name in metrics:
            owners.setdefault(name, []).append(path)
        if failure is None and not metrics.get("success", True):
            failure = str(metrics.get("reason") or f"block '{path}' reports no success")
        elif success_reason is None and metrics.get("success") and metrics.get("reason"):
            success_reason = str(metrics["reason"])
    merged: dict[str, Metric] = {}
    for path, metrics in by_block.items():
        for name, value in metrics.items():
            if name not in ("success", "reason", "veto"):
                merged[name if len(owners[name]) == 1 else f"{path}.{name}"] = value
    if failure is None:
        failure = next((str(m["veto"]) for m in by_block.values() if m.get("veto")), None)
    return merged, failure, success_reason
