"""All benchmarks by name, and the report of those that are run.

Absolute times depend on the machine and on its load. Ratios of cases that take turns in one process
depend on these far less. Every row says what it is compared with, and what the goal is.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from .agreement import agreement
from .background import background
from .changed_targets import changed_targets
from .courses import courses, pushed_courses
from .driver import driver
from .every_robot import every_robot
from .export import export
from .falsification import falsification
from .frontier import frontier
from .general_blocks import general_blocks
from .growth import growth
from .hopping_on import hopping_on
from .jumps.identification import identification
from .jumps.jumps import jumps
from .jumps.known_effects import known_effects
from .jumps.real_robot import real_robot
from .links.link_delays import link_delays
from .links.links import links
from .loading import loading
from .mutated_robots import mutated_robots
from .planner.online_plans import online_plans
from .planner.paper_plans import paper_plans
from .planner.paper_solvers import paper_solvers
from .planner.planner import planner
from .recorder import recorder
from .robot_files import robot_files
from .rows import Row
from .scheduler import scheduler
from .speed import speed
from .startup import startup
from .stones import go2_staircase, staircase, stones
from .tick.solvers import solvers
from .tick.tick import tick

BENCHMARKS: Mapping[str, Callable[..., list[Row]]] = {
    "tick": tick,
    "solvers": solvers,
    "speed": speed,
    "growth": growth,
    "startup": startup,
    "loading": loading,
    "scheduler": scheduler,
    "general_blocks": general_blocks,
    "falsification": falsification,
    "export": export,
    "planner": planner,
    "paper_plans": paper_plans,
    "paper_solvers": paper_solvers,
    "online_plans": online_plans,
    "recorder": recorder,
    "background": background,
    "links": links,
    "driver": driver,
    "link_delays": link_delays,
    "agreement": agreement,
    "jumps": jumps,
    "real_robot": real_robot,
    "known_effects": known_effects,
    "identification": identification,
    "frontier": frontier,
    "courses": courses,
    "pushed_courses": pushed_courses,
    "changed_targets": changed_targets,
    "hopping_on": hopping_on,
    "stones": stones,
    "staircase": staircase,
    "go2_staircase": go2_staircase,
    "every_robot": every_robot,
    "mutated_robots": mutated_robots,
    "robot_files": robot_files,
}
"""All benchmarks by name; each returns its rows."""
LONG = (
    "paper_plans", "paper_solvers",
    "agreement", "speed", "growth", "jumps", "real_robot", "known_effects", "identification", "frontier", "link_delays", "courses",
    "pushed_courses", "changed_targets", "hopping_on", "stones", "staircase", "go2_staircase", "every_robot",
    "mutated_robots", "robot_files",
)  # fmt: skip
"""Names of the benchmarks that take minutes or hours and run only where they are named."""
OPTIONS: Mapping[str, tuple[str, ...]] = {
    "seconds": ("recorder", "background", "export", "paper_solvers"),
    "count": ("agreement", "jumps", "export", "online_plans", "mutated_robots"),
    "seed": ("agreement", "jumps", "mutated_robots"),
    "seeds": (
        "jumps",
        "frontier",
        "link_delays",
        "real_robot",
        "known_effects",
        "identification",
        "courses",
        "pushed_courses",
        "changed_targets",
        "hopping_on",
        "stones",
        "staircase",
        "go2_staircase",
    ),
    "jitter": ("link_delays",),
    "loss": ("link_delays",),
    "tsid": ("tick", "export"),
    "since": ("tick", "speed", "growth"),
    "everything": ("speed",),
    "arms": ("real_robot",),
    "robot": ("courses", "real_robot"),
    "asked": ("real_robot", "known_effects"),
    "harder": ("jumps",),
    "trial": ("jumps",),
    "push": ("jumps",),
}
"""The options of ``aloft bench``, and the benchmarks that take each."""


def run_benchmarks(
    names: Iterable[str] | None = None, options: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Run the named benchmarks, by default all but those in ``LONG``.

    Each gets those of the ``options`` that it takes.

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
        given = {k: v for k, v in (options or {}).items() if name in OPTIONS[k]}
        rows += BENCHMARKS[name](**given)
    return {
        "machine": _machine(),
        "load": {"before": before, "after": _load()},
        "rows": [row.to_json() for row in rows],
    }


def _load() -> list[float] | None:
    """Return the load averages over 1, 5 and 15 minutes, where the system tells."""
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
