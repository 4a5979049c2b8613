"""What a diagram shows of a run: the values on the wires at a tick, and the time each block took."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

MOST = 16
"""Numbers of one field that are shown; of more the first, and how many there are."""


class Values(Protocol):
    """A run whose values can be asked for."""

    ticks: tuple[int, int]
    """The first and the last tick."""
    period: float
    """The duration of a tick [s]."""
    times: Mapping[str, str]
    """What there is to say of the time that a block took, by the block's path."""

    def at(self, tick: int) -> Mapping[str, str]:
        """Every field of every output at a tick, by ``block.port.field``."""


def shown(value: NDArray[Any], unit: str = "") -> str:
    """The numbers of a field as a short text."""
    flat = np.ravel(value)
    texts = [f"{x:.6g}" if flat.dtype.kind == "f" else str(x) for x in flat[:MOST].tolist()]
    text = ", ".join(texts) if flat.size != 1 else texts[0]
    if flat.size > MOST:
        text += f", ... ({flat.size} in all)"
    if flat.size != 1:
        text = f"[{text}]"
    return f"{text} {unit}".rstrip()
