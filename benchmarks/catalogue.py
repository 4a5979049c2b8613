"""All benchmarks by name, and the report of those that are run.

Absolute times depend on the machine and on its load. Ratios of cases that take turns in one process
depend on these far less. Every row says what it is compared with, and what the goal is.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from .agreement import agreement
from .driver import driver
from .frontier.frontier import frontier
from .general_blocks import general_blocks
from .jumps.jumps import jumps
from .links.link_delays import link_delays
from .links.links import links
from .loading import loading
from .planner.planner import planner
from .recorder import recorder
from .rows import Row
from .scheduler import scheduler
from .startup import startup
from .tick.tick import tick

BENCHMARKS: Mapping[str, Callable[..., list[Row]]] = {
    "tick": tick,
    "startup": startup,
    "loading": loading,
    "scheduler": scheduler,
    "general_blocks": general_blocks,
    "planner": planner,
    "recorder": recorder,
    "links": links,
    "driver": driver,
    "link_delays": link_delays,
    "agreement": agreement,
    "jumps": jumps,
    "frontier": frontier,
}
"""All benchmarks by name; each returns its rows."""
LONG = ("agreement", "jumps", "frontier", "link_delays")
"""Those that take minutes or hours and run only where they are named."""
COUNTED = ("agreement", "jumps")
"""Those that can be told how many cases to draw (``count``), and with which ``seed``."""
SEEDED = ("frontier", "link_delays")
"""Those that can be told the ``seeds`` of the trial to run with."""
TIMED = ("recorder",)
"""Those that can be told how many ``seconds`` to run in real time."""
PEERED = ("tick",)
"""Those that can be told where TSID is (``tsid``), and ``since`` which commit to compare."""
LINKED = ("link_delays",)
"""Those that can be told the ``jitter`` [s] of messages and the share of them that is lost (``loss``)."""


def run_benchmarks(
    names: Iterable[str] | None = None, seconds: float | None = None,
    count: int | None = None, seed: int | None = None, seeds: Sequence[int] | None = None,
    jitter: float | None = None, loss: float | None = None, tsid: str | None = None,
    since: str | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Run the named benchmarks, by default all but those in ``LONG``; ``seconds`` is for those in
    ``TIMED``, ``count`` and ``seed`` for those in ``COUNTED``, ``seeds`` for those in ``SEEDED``,
    ``jitter`` [s] and ``loss`` for those in ``LINKED``, ``tsid`` and ``since`` for those in ``PEERED``.

    Returns:
        ``machine``, ``load`` (averages before and after) and ``rows``, as plain data for JSON.

    Raises:
        KeyError: there is no such benchmark; the message names those that exist.
    """
    chosen = tuple(n for n in BENCHMARKS if n not in LONG) if names is None else tuple(names)
    for name in chosen:
        if name not in BENCHMARKS:
            raise KeyError(f"no benchmark {name!r}; there is {', '.join(BENCHMARKS)}")
    before = _load()
    rows = []
    for name in chosen:
        told = {"seconds": (seconds, TIMED), "count": (count, COUNTED), "seed": (seed, COUNTED),
                "seeds": (seeds, SEEDED), "jitter": (jitter, LINKED), "loss": (loss, LINKED),
                "tsid": (tsid, PEERED), "since": (since, PEERED)}  # fmt: skip
        given = {k: v for k, (v, known) in told.items() if v is not None and name in known}
        rows += BENCHMARKS[name](**given)
    return {
        "machine": _machine(),
        "load": {"before": before, "after": _load()},
        "rows": [row.to_json() for row in rows],
    }


def _load() -> list[float] | None:
    """The load averages over 1, 5 and 15 minutes, where the system tells."""
    return [round(x, 2) for x in os.getloadavg()] if hasattr(os, "getloadavg") else None


def _machine() -> dict[str, Any]:
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            names = [line.partition(":")[2].strip() for line in file if "model name" in line]
    except OSError:
        names = []
    return names[0] if names else platform.processor() or platform.machine()
