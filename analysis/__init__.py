"""Questions to a graph: its linear model and margins, another course of a run, and why a run failed."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .branching import branch
    from .explanation import Explanation, explain
    from .linearisation import Linearisation, linearise
    from .loop_margins import Margins, margins

_HOMES = {
    "branch": "branching",
    "Explanation": "explanation",
    "explain": "explanation",
    "Linearisation": "linearisation",
    "linearise": "linearisation",
    "Margins": "loop_margins",
    "margins": "loop_margins",
}

__all__ = ["Explanation", "Linearisation", "Margins", "branch", "explain", "linearise", "margins"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
