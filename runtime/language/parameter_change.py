"""A change of parameters while a graph runs: what was asked for, and what became of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .parameters import Parameters


@dataclass(frozen=True)
class ParameterChange:
    """One parameter, ``block.parameter``, that was ``old`` in all ticks before ``tick`` and is
    ``new`` from it on. Values are plain data, as a graph file would have them."""

    tick: int
    path: str
    old: Any
    new: Any


@dataclass
class Adjustment:
    """Checked new parameters by block, and what they change: path, old and new value of each.

    When it has been ``answered``, it was taken over at ``tick``, or refused because of ``error``.
    """

    params: Mapping[str, Parameters]
    values: tuple[tuple[str, Any, Any], ...]
    tick: int = -1
    error: str = ""
    answered: bool = False

    def changes(self) -> tuple[ParameterChange, ...]:
        """What was changed."""
        return tuple(ParameterChange(self.tick, *value) for value in self.values)
