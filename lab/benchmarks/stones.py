"""Random stepping stones of 12 x 20 cm and a staircase, of which the robot sees one jump ahead.

A course has ten stones with gaps of 2 to 14 cm, up to 3 cm aside of each other, level or up to 5 cm higher or lower
(``extensions/hopping/graphs/steer_stones.yaml``), in the robust trial, with the position sensor and without. A stone holds both feet.
The staircase has six steps of 4 cm, each 20 cm deep, and one jump a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...studies.summary import wilson_interval
from .courses import JUMPS, LONGEST, failures, fell, run_seed
from .rows import Row

SEEDS = range(31800, 31820)
"""Seeds of the stones and robots; nothing is tuned on them."""
MISSED_GOAL = 0.1
"""The largest good share of courses that do not come to the last stone."""
LEVEL, STEPPED = 0.0, 0.05
"""Largest difference in height between a stone and the one before [m]."""
KINDS = (
    ("stones, 5 cm up or down", STEPPED, True),
    ("level stones", LEVEL, True),
    ("level stones without the sensor", LEVEL, False),
)


def stones(seeds: Sequence[int] = SEEDS) -> list[Row]:
    """Measure for each kind of stones the share of courses that do not come to the last stone, and
    of those that fail a criterion."""
    rows = []
    for name, height, sensor in KINDS:
        found = [run_stones(seed, height, sensor) for seed in seeds]
        n, lost = len(found), [one for one in found if not passed(one)]
        low, high = wilson_interval(len(lost), n)
        worst = [float(one["worst_place_error_m"]) for one in found if one.get("jumps")]
        why = failures(found)
        rows += [
            Row(f"{name}: courses lost", len(lost) / n, "", goal=MISSED_GOAL,
                note=f"{n} courses of {JUMPS} jumps, 95 % interval {low:.2f} to {high:.2f}"),
            Row(f"{name}: courses that are no success",
                sum(not one["success"] for one in found) / n, "", note=why),
            Row(f"{name}: largest error of place, median", float(np.median(worst)), "m"),
        ]  # fmt: skip
    return rows


STAIRS_SEEDS = range(32200, 32220)
"""Seeds of the robots on the staircase; nothing is tuned on them."""
STEPS = 6
STAIRCASE = [
    {"x": round(0.2 * step, 3), "top": round(0.04 * step, 3)} for step in range(1, STEPS + 1)
]
"""Position ahead and height of each step [m]."""
GO2_STAIRS_SEEDS = range(33600, 33620)
"""Seeds of Go2 on its staircase (``extensions/hopping/graphs/robots/go2_stairs.yaml``); nothing is tuned on them."""
GO2_STEPS = 7
STEP = (0.198, 0.4)
"""Length and width of a step [m]; 2 mm less than their distance, as stones do not touch."""


def staircase(seeds: Sequence[int] = STAIRS_SEEDS) -> list[Row]:
    """Measure the share of robots that do not come up a staircase, of those that fail a criterion,
    and the time that it takes."""
    found = [run_staircase(seed) for seed in seeds]
    return _rows_of_stairs("staircase", found, STEPS, "4 cm")


def go2_staircase(seeds: Sequence[int] = GO2_STAIRS_SEEDS) -> list[Row]:
    """Measure the same of Go2 on seven steps of 8 cm that hold all of its feet, each 50 cm deep."""
    found = [
        run_seed(seed, "aloft:hopping/robots/go2_stairs", (), {"duration": LONGEST})
        for seed in seeds
    ]
    return _rows_of_stairs("Go2's staircase", found, GO2_STEPS, "8 cm")


def _rows_of_stairs(
    name: str, found: Sequence[dict[str, Any]], steps: int, height: str
) -> list[Row]:
    n, lost = len(found), [one for one in found if not passed(one, steps)]
    low, high = wilson_interval(len(lost), n)
    up = [float(one["duration"]) for one in found if passed(one, steps)]
    why = failures(found)
    return [
        Row(f"{name}: not up", len(lost) / n, "", goal=MISSED_GOAL,
            note=f"{n} robots, {steps} steps of {height}, 95 % interval {low:.2f} to {high:.2f}"),
        Row(f"{name}: no success", sum(not one["success"] for one in found) / n, "", note=why),
        Row(f"{name}: from the start to standing above, median", float(np.median(up)) if up else np.nan, "s"),
    ]  # fmt: skip


def run_staircase(seed: int) -> dict[str, Any]:
    """Run up the staircase and return the metrics, with the ``seed``."""
    sets = {"commands.stones": STAIRCASE, "commands.size": STEP, "duration": LONGEST}
    return run_seed(seed, "aloft:hopping/steer_stones", (), sets)


def passed(metrics: dict[str, Any], jumps: int = JUMPS) -> bool:
    """Tell whether the robot stood on every stone, and only its toes and heels ever touched them."""
    return bool(
        metrics.get("jumps") == jumps and not fell(metrics) and metrics["forbidden_contacts"] == 0
    )


def run_stones(seed: int, height: float, sensor: bool) -> dict[str, Any]:
    """Run a course of stones and return its metrics, with its ``seed``. Without the sensor all of
    its measurements are lost."""
    sets = {
        "commands.random": {"count": JUMPS, "seed": seed, "height": height}, "duration": LONGEST,
        "capture.dropout": 0.0 if sensor else 1.0,
    }  # fmt: skip
    return run_seed(seed, "aloft:hopping/steer_stones", (), sets)
