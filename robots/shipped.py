"""The robots that ship with aloft."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path


@lru_cache(maxsize=1)
def robot_names() -> tuple[str, ...]:
    """The names a graph may give after ``robot:``, sorted."""
    found = Path(__file__).parent.glob("*/*.yaml")
    return tuple(sorted(path.stem for path in found if path.stem == path.parent.name))
