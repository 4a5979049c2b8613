"""The interface of recorders and watchers of a run: called once a tick and with each event, it may take one copy of the bus."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # so that the command line starts without NumPy
    from ..language.block import Metric
    from ..language.parameter_change import ParameterChange
    from .memory import BoundGraph


@dataclass(frozen=True)
class Note:
    """An event of a run at ``tick``, before that tick ran, which the runtime gives to all recorders.

    The runtime writes the kinds ``life`` (a change of the life cycle), ``overrun`` (a late tick),
    ``late`` (a result of a background block that was due and not there), ``fault`` (the error that
    ended a run early), ``warning`` (a block's warning to those who read the result) and ``parameter``
    (a live change). Recorders add ``dropped`` (ticks that were not kept).

    Attributes:
        kind: a word to search for.
        text: one line for people.
        level: ``INFO``, ``WARN`` or ``ERROR``.
        data: the same for machines, as plain data.
    """

    tick: int
    kind: str
    text: str
    level: str = "INFO"
    data: Mapping[str, Any] = field(default_factory=dict)


def parameter_note(change: ParameterChange) -> Note:
    """Make the note of a live change; its ``data`` are the attributes of the change."""
    text = f"{change.path}: {change.old} -> {change.new}"
    return Note(change.tick, "parameter", text, data=asdict(change))


class Sink:
    """Keeps or watches what happens in a run; subclasses override the methods that they need.

    ``record`` takes the bus of every tick. Row k is the bus after all outputs of tick k were
    written.
    """

    name: str = ""
    """The name of ``metrics`` in the result, where those of a block have its path."""
    waits_for_others: bool = False
    """True while ``record`` waits, with a limit of its own, which the watchdog respects."""

    def open(self, bound: BoundGraph) -> None:
        """Prepare, once, before the first tick."""

    def watch_ticker(self, ticker: Any) -> None:  # Ticker's file needs this one
        """Take the ``Ticker``, which measures the times of blocks, before the first tick."""

    def record(self, tick: int) -> None:
        """Copy the bus of this tick. The control thread calls this, so it must do no more."""

    def note(self, note: Note) -> None:
        """Keep a note. The control thread calls this, so it must not wait."""

    def rewind(self, tick: int) -> None:
        """Forget, or set apart, ``tick`` and all after it: they come again, and may be others.

        The graph's memory is already that before ``tick``; see ``run_control``.
        """

    def resume(self, tick: int) -> None:
        """Go on with ``tick`` after the run has stood still."""

    def close(self) -> None:
        """Finish, once, also after a failure."""

    def metrics(self) -> Mapping[str, Metric]:
        """Return measures of the run, with ``success`` and ``reason`` where it judges; see ``name``."""
        return {}

    def finish(self, result: Any) -> list[str]:  # RunResult's file needs this one
        """Take the ``RunResult``, after everything else is closed. Returns warnings for the user."""
        return []

    def abandoned(self, result: Any) -> None:
        """Take the ``RunResult`` of a run that hangs; when all sinks have it, the process ends."""
