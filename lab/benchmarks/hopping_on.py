"""Hopping on without a rest, thirty hops, at speeds that change while it hops.

Each seed draws a robot of the robust trial, and speeds between 0 and 0.4 m/s, each for three to six hops
(``extensions/hopping/graphs/hop_on.yaml``). No sensor tells the place, so its drift adds up; the error of a jump's length is what counts for the speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...studies.summary import wilson_interval
from .courses import failures, fell, run_seed
from .rows import Row

SEEDS = range(34100, 34120)
"""Seeds of the robots and speeds; nothing is tuned on them."""
HOPS = 30
HOP_TIME = 0.512
"""Time from hop to hop [s]."""
MISSED_GOAL = 0.05
FASTEST = 0.4
"""Largest speed of a command [m/s]."""
LASTS = (3, 6)
"""Least and largest number of hops at one speed."""


def speeds(seed: int, fastest: float = FASTEST) -> list[dict[str, float]]:
    """Draw the commands of a seed."""
    rng = np.random.default_rng(seed)
    found, hops = [], 0
    while hops < HOPS:
        at = 0.0 if hops == 0 else round(1.0 + HOP_TIME * hops, 3)
        found.append({"at": at, "ahead": round(rng.uniform(0.0, fastest), 3)})
        hops += int(rng.integers(LASTS[0], LASTS[1] + 1))
    return found


def hopping_on(seeds: Sequence[int] = SEEDS) -> list[Row]:
    """Measure the shares of rows with a fall and of those that fail a criterion, and the error of
    the speed."""
    found = [run_hops(seed, speeds(seed)) for seed in seeds]
    n, fallen = len(found), [one for one in found if fell(one)]
    low, high = wilson_interval(len(fallen), n)
    made = [one for one in found if one.get("jumps")]
    off = [float(one["mean_length_error_m"]) / HOP_TIME for one in made]
    drift = [float(one["last_place_error_m"]) for one in made]
    note = failures(found)
    return [
        Row("rows of hops with a fall", len(fallen) / n, "", goal=MISSED_GOAL,
            note=f"{n} rows of {HOPS}, 95 % interval {low:.2f} to {high:.2f}"),
        Row("rows of hops that are no success", sum(not one["success"] for one in found) / n, "", note=note),
        Row("rows of hops: mean error of the speed of a hop, median", float(np.median(off)), "m/s"),
        Row("rows of hops: the same, largest", max(off), "m/s"),
        Row("rows of hops: error of place at the end, largest", max(drift), "m"),
    ]  # fmt: skip


def run_hops(
    seed: int, told: Sequence[Mapping[str, float]], more: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Run a row of hops at these speeds and return its metrics; ``more`` overrides what the graph
    says."""
    sets = {"speed.twists": list(told), **(more or {})}
    return run_seed(seed, "aloft:hopping/hop_on", (), sets, sensor=False)
