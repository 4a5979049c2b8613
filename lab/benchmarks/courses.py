"""Random courses of jumps: each command becomes known when the jump before has landed.

A course has ten jumps of 5 to 30 cm, ahead, back or aside, with turns of up to 45 degrees. They are planned in the
background by ``extensions/hopping/graphs/steer.yaml``, those of other robots by ``extensions/hopping/graphs/robots/steer.yaml``, in the robust trial, with a position sensor. Virtual time waits for the planner.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...planner.library.library import shipped_folder
from ...runtime.loading.reading.files import graph_path
from ...studies.expansion import load_cell
from ...studies.summary import wilson_interval
from .rows import Row

SEEDS = range(31700, 31720)
"""Seeds of the courses and robots; nothing is tuned on them."""
PUSHED_SEEDS = range(31900, 31920)
"""Seeds of the courses with a push; nothing is tuned on them."""
PUSH = 0.4
"""N s on the torso's centre of mass, 0.03 s after a lift-off"""
SENSOR = "controllers/motion_capture.yaml"
JUMPS = 10
DIRECTIONS = (0.0, math.pi, 0.5 * math.pi, -0.5 * math.pi)
"""Ahead, back, to the left and to the right."""
MISSED_GOAL = 0.05
"""The largest good share of courses with a fall."""
OTHERS_MISSED_GOAL = 0.1
"""The same for other robots."""
PLACE_GOAL = 0.03
"""Goal of the median of the courses' largest errors of place [m]."""
LONGEST = 40.0
"""Longest duration of a course in the graph's time [s]."""


def course(seed: int, jumps: int = JUMPS) -> list[dict[str, float]]:
    """Draw the commands of a seed; they are the same on every machine."""
    rng = np.random.default_rng(seed)
    commands = []
    for _ in range(jumps):
        direction = DIRECTIONS[int(rng.integers(len(DIRECTIONS)))]
        distance, turn = rng.uniform(0.05, 0.30), rng.uniform(-0.25 * math.pi, 0.25 * math.pi)
        commands.append(
            {
                "ahead": round(distance * math.cos(direction), 4),
                "aside": round(distance * math.sin(direction), 4),
                "turn": round(turn, 4),
            }
        )
    return commands


def courses(seeds: Sequence[int] = SEEDS, robot: str = "bruce") -> list[Row]:
    """Measure the shares of courses with a fall and off their places, errors of place, times of
    planning.

    Args:
        seeds: of courses and trials.
        robot: its name or file; one that ships no plans of hops needs those that ``aloft steer --robot`` keeps.
    """
    if robot == "bruce":
        return _rows([run_course(seed) for seed in seeds], MISSED_GOAL)
    found = [
        run_course(seed, {"robot": robot}, graph="aloft:hopping/robots/steer") for seed in seeds
    ]
    return _rows(found, OTHERS_MISSED_GOAL)


def _rows(found: Sequence[Mapping[str, Any]], missed_goal: float) -> list[Row]:
    n, fallen = len(found), [one for one in found if fell(one)]
    whole = [one for one in found if one.get("jumps") == JUMPS]
    low, high = wilson_interval(len(fallen), n)
    worst = [float(one["worst_place_error_m"]) for one in found if one.get("jumps")]
    off = sum(not one["success"] for one in found)
    longest = [float(one["planning_longest_s"]) for one in found]
    median = [float(one["planning_median_s"]) for one in found]
    plans = {
        name: sum(int(one[f"plans_{name}"]) for one in found)
        for name in ("planned", "nearest", "unsolved", "invalid")
    }
    note = failures(found)
    return [
        Row("courses with a fall", len(fallen) / n, "", goal=missed_goal,
            note=f"{n} courses of {JUMPS} jumps, 95 % interval {low:.2f} to {high:.2f}"),
        Row("courses that are no success", off / n, "", note=note),
        Row("courses that came to their end", len(whole), ""),
        Row("largest error of place in a course, median", float(np.median(worst)), "m", goal=PLACE_GOAL),
        Row("largest error of place", max(worst), "m"),
        Row("planning, solver and check, median", float(np.median(median)), "s", goal=0.06,
            note=", ".join(f"{count} {name}" for name, count in plans.items())),
        Row("planning, solver and check, longest", max(longest), "s", goal=0.12),
    ]  # fmt: skip


def pushed_courses(seeds: Sequence[int] = PUSHED_SEEDS) -> list[Row]:
    """Measure such courses with a push of 0.4 N s, in a drawn direction in a drawn flight."""
    found = [run_pushed(seed) for seed in seeds]
    n, fallen = len(found), [one for one in found if fell(one)]
    low, high = wilson_interval(len(fallen), n)
    note = failures(found)
    return [
        Row("pushed courses with a fall", len(fallen) / n, "", goal=0.1,
            note=f"{n} courses, 95 % interval {low:.2f} to {high:.2f}; {PUSH:g} N s in a flight of each"),
        Row("pushed courses that are no success", sum(not o["success"] for o in found) / n, "", note=note),
    ]  # fmt: skip


def run_pushed(seed: int) -> dict[str, Any]:
    """Run a course with a push and return its metrics."""
    rng = np.random.default_rng([seed, 1])
    flight, angle = int(rng.integers(1, JUMPS + 1)), float(rng.uniform(0.0, 2.0 * math.pi))
    push = {"push.force": PUSH / 0.01, "push.flight": flight, "push.angle": round(angle, 4)}
    return run_course(seed, push, (SENSOR, "trials/pushed.yaml"))


def failures(found: Sequence[Mapping[str, Any]]) -> str:
    """List the seeds that are no success, with the reasons."""
    return "; ".join(f"seed {one['seed']}: {one['reason']}" for one in found if not one["success"])


def fell(metrics: Mapping[str, Any]) -> bool:
    """Tell whether a course ended with a fall."""
    return str(metrics["reason"]).startswith("fell")


def run_course(
    seed: int, more: Mapping[str, Any] | None = None, behind: Sequence[str] = (SENSOR,),
    graph: str = "aloft:hopping/steer",
) -> dict[str, Any]:  # fmt: skip
    """Run a course and return its metrics, with its ``seed``; ``more`` overrides what the graph
    says, and the files ``behind`` are included behind it."""
    return run_seed(
        seed, graph, behind, {"commands.commands": course(seed), "duration": LONGEST, **(more or {})},
    )  # fmt: skip


def run_seed(
    seed: int, graph: str, behind: Sequence[str], sets: Mapping[str, Any], *, sensor: bool = True
) -> dict[str, Any]:
    """Run a graph that steers in the robust trial and return its metrics, with its ``seed``;
    ``sensor``: it has one of the place."""
    graphs = shipped_folder()
    seeds = {"robot.seed": seed, "capture.seed": seed} if sensor else {"robot.seed": seed}
    found = load_cell(
        graph_path(graph), [graphs / "trials/robust.yaml"],
        {**seeds, **sets}, graphs / "bench.yaml",
        [graphs / name for name in behind],
    ).run(log=False)  # fmt: skip
    own = {"seed": seed, "success": found.success, "reason": found.reason}
    return {**own, "duration": found.duration_s, **found.metrics}
