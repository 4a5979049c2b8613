"""Notes: events of a run that are not signals, which the runtime gives to all recorders.

The runtime writes these kinds: ``life`` (a change of the life cycle), ``overrun`` (a late tick),
``fault`` (the error that ended a run early), ``caution`` (a block's warning to those who read the
result) and ``parameter`` (a live change). Recorders add ``dropped`` (ticks that were not kept).
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
    """The method that a sink has, beside ``record``, if it wants to receive notes."""

    def note(self, note: Note) -> None:
        """Keep a note. The control thread calls this, so it must not wait."""


def parameter_note(change: ParameterChange) -> Note:
    """The note of a live change; its ``data`` are the attributes of the change."""
    text = f"{change.path}: {change.old} -> {change.new}"
    return Note(change.tick, "parameter", text, data=asdict(change))
