"""The timelines of a recording, as Rerun wants them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .format import Header, nanoseconds


def time_columns(header: Header, ticks: NDArray[np.int64]) -> list[Any]:
    """The timelines ``t`` and ``tick`` at some ticks (n,)."""
    import rerun as rr

    instants = nanoseconds(header.base_rate, ticks).astype("timedelta64[ns]")
    return [rr.TimeColumn("t", duration=instants), rr.TimeColumn("tick", sequence=ticks)]


def timed(header: Header, ticks: NDArray[np.int64], texts: Sequence[str]) -> list[str]:
    """Texts with the time before each, as the viewer's own column of times is too narrow for them."""
    times = (ticks / header.base_rate).tolist()
    return [f"{time:.3f} s  {text}" for time, text in zip(times, texts, strict=True)]
