"""The blocks that ship with aloft, each in a file of its own.

They are also found here, and imported when they are first asked for: ``from aloft.blocks import LandingHeuristic``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..runtime.language.block import Block


def __getattr__(name: str) -> type[Block]:
    """Return the block of that name, ``blocks.NAME`` in a graph. Raises ``AttributeError``."""
    from ..runtime.language.registry import attribute_of

    return attribute_of(__name__, name)
