"""Notes: what happens in a run beside its signals, as said by the runtime to whoever keeps the run.

Kinds the runtime writes: ``life`` (a change of the life cycle), ``overrun`` (a late tick),
``fault`` (what ended a run before its time), ``caution`` (what a block wants its readers to know)
and ``parameter`` (a live change). Recorders add ``dropped`` (ticks that were not kept).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol, runtime_checkable

from ..language.parameter_change import ParameterChange


@dataclass(frozen=True)
class Note:
    """Something that happened at ``tick``, before that tick ran.

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


@runtime_checkable
class TakesNotes(Protocol):
    """What a sink has beside ``record`` that wants to be told."""

    def note(self, note: Note) -> None:
        """Keep a note; called on the control thread, so without waiting."""


def parameter_note(change: ParameterChange) -> Note:
    """What is noted of a live change; its ``data`` are the change's own attributes."""
    text = f"{change.path}: {change.old} -> {change.new}"
    return Note(change.tick, "parameter", text, data=asdict(change))
