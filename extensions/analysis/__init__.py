"""Questions to a graph: operating points, linear models and margins, another course of a run, and why a run failed."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .branching import branch
    from .explanation import Explanation, explain
    from .frequency_response import FrequencyResponse, frequency_responses
    from .linearisation import Linearisation, linearise
    from .locus import RootLocus, root_locus
    from .loop_margins import Margins, margins
    from .trimming import Trim, trim

_HOMES = {
    "branch": "branching",
    "Explanation": "explanation",
    "explain": "explanation",
    "FrequencyResponse": "frequency_response",
    "frequency_responses": "frequency_response",
    "Linearisation": "linearisation",
    "linearise": "linearisation",
    "Margins": "loop_margins",
    "margins": "loop_margins",
    "RootLocus": "locus",
    "root_locus": "locus",
    "Trim": "trimming",
    "trim": "trimming",
}

__all__ = [
    "Explanation", "FrequencyResponse", "Linearisation", "Margins", "RootLocus", "Trim", "branch", "explain",
    "frequency_responses", "linearise", "margins", "root_locus", "trim",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
