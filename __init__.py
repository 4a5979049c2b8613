"""aloft: a block-diagram control framework for robots and other feedback loops.

What users need is here; it is imported when it is first asked for, so ``import aloft`` is free.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .logs.recording.writer import write_recording
    from .mathematics.arrays import Array1D, Array2D
    from .mathematics.compiling.expressions import cross
    from .mathematics.kernel import kernel
    from .runtime.building import GraphBuilder
    from .runtime.graph import Graph, load
    from .runtime.language.block import Block, Input, Output, State
    from .runtime.language.context import Clock
    from .runtime.language.errors import AloftError, BlockError, RunError
    from .runtime.language.parameters import Parameters, live_parameter, parameter
    from .runtime.language.signals import Field, Signal
    from .runtime.loading import LoadError
    from .runtime.running.run_result import RunResult
    from .runtime.running.stepping import SteppedRun

__version__ = "0.2.0"

_HOMES = {
    "cross": "mathematics.compiling.expressions",
    "kernel": "mathematics.kernel",
    **dict.fromkeys(("Array1D", "Array2D"), "mathematics.arrays"),
    "Clock": "runtime.language.context",
    "write_recording": "logs.recording.writer",
    **dict.fromkeys(("Block", "Input", "Output", "State"), "runtime.language.block"),
    **dict.fromkeys(("AloftError", "BlockError", "RunError"), "runtime.language.errors"),
    **dict.fromkeys(("Graph", "load"), "runtime.graph"),
    "GraphBuilder": "runtime.building",
    "SteppedRun": "runtime.running.stepping",
    "LoadError": "runtime.loading",
    **dict.fromkeys(("Parameters", "live_parameter", "parameter"), "runtime.language.parameters"),
    "RunResult": "runtime.running.run_result",
    **dict.fromkeys(("Field", "Signal"), "runtime.language.signals"),
}

__all__ = [
    "AloftError",
    "Array1D",
    "Array2D",
    "Block",
    "BlockError",
    "Clock",
    "Field",
    "Graph",
    "GraphBuilder",
    "Input",
    "LoadError",
    "Output",
    "Parameters",
    "RunError",
    "RunResult",
    "Signal",
    "State",
    "SteppedRun",
    "__version__",
    "cross",
    "kernel",
    "live_parameter",
    "load",
    "parameter",
    "write_recording",
]


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{home}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
