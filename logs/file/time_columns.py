"""The timelines of a recording, as Rerun wants them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .format import Header, nanoseconds


def time_columns(header: Header, ticks: NDArray[np.int64]) -> list[Any]:
    """The timelines ``t`` and ``tick`` at some ticks (n,)."""
    import rerun as rr

    instants = nanoseconds(header.base_rate, ticks).astype("timedelta64[ns]")
    return [rr.TimeColumn("t", duration=instants), rr.TimeColumn("tick", sequence=ticks)]
