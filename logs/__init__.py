"""Recordings of runs, written, read back and shown."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .file.reader import RecordedRun, RecordingError, read

__all__ = ["RecordedRun", "RecordingError", "read"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(".file.reader", __name__), name)
