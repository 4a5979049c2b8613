"""A change of parameters while a graph runs: the request for it, and its outcome."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .parameters import Parameters


@dataclass(frozen=True)
class ParameterChange:
    """One parameter, ``block.parameter``, that was ``old`` before ``tick`` and is ``new`` from that
    tick on. Values are plain data, as in a graph file."""

    tick: int
    path: str
    old: Any
    new: Any


@dataclass
class Adjustment:
    """New parameters that have been checked, by block, with the path, old and new value of each.

    Once ``answered`` is true, the adjustment was either applied at ``tick`` or refused for the
    reason in ``error``.
    """

    params: Mapping[str, Parameters]
    values: tuple[tuple[str, Any, Any], ...]
    tick: int = -1
    error: str = ""
    answered: bool = False

    def changes(self) -> tuple[ParameterChange, ...]:
        """Return the changes of single parameters that the adjustment has made."""
        return tuple(ParameterChange(self.tick, *value) for value in self.values)
