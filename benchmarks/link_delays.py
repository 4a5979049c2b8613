"""Jumps of BRUCE with the controller on another machine, free-running, with links that take their time.

In virtual time (``runtime/testing/virtual_spread``): both parts tick at 500 Hz at phases drawn from the
seed, and every message takes the same time. The controller is told what it has to expect: the
robot's own delay, the links' both ways, and half a period of waiting at each end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..runtime.loading import load
from ..runtime.loading.shipped import FOLDER
from ..runtime.testing.virtual_spread import VirtualRun, run_virtual
from .rows import Row

GRAPH = FOLDER / "machines" / "jump_two.yaml"
DELAYS = (0.2e-3, 1e-3, 2e-3, 3e-3)
GOAL = 5.0
"""The largest good share of jumps that fail [%]."""
ROBOT_DELAY, PERIOD = 0.002, 0.002
SETTINGS = (
    "links.mode=free", "links.max_age=50 ms", "links.late=hold", "clock.kind=paced",
    "delay.follow=told",
)  # fmt: skip


def told(delay: float) -> float:
    """The delay [s] that the controller is told, for links that take ``delay`` each way [s]."""
    return ROBOT_DELAY + 2.0 * delay + PERIOD


def jump(delay: float, seed: int) -> VirtualRun:
    """One jump with links that take ``delay`` each way [s]."""
    settings = [*SETTINGS, f"robot.seed={seed}", f"delay.told={told(delay)!r}"]
    graph = load(GRAPH, settings)
    phase = float(np.random.default_rng(seed).random())
    return run_virtual(graph, travel(delay), {"ground": phase})


def travel(delay: float) -> Callable[[str, int], int | None]:
    """Every message takes ``delay`` [s]."""
    return lambda key, now: round(delay * 1e9)


def link_delays(
    delays: Sequence[float] = DELAYS, seeds: Sequence[int] = tuple(range(1000, 1005))
) -> list[Row]:
    """For each delay the share of jumps that fail."""
    rows = []
    for delay in delays:
        failed: list[str] = []
        for seed in seeds:
            run = jump(delay, seed)
            if not run.success:
                failed.append(f"{seed}: {run.reason}")
        note = f"{len(seeds) - len(failed)} of {len(seeds)} succeed, told {told(delay) * 1e3:g} ms"
        rows.append(
            Row(f"jumps that fail, links of {delay * 1e3:g} ms each way",
                100.0 * len(failed) / len(seeds), "%", goal=GOAL,
                note="; ".join([note, *failed[:3]]))
        )  # fmt: skip
    return rows
