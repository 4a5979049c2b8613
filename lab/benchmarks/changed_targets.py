"""Jumps whose target changes when they are under way: place, turn, height, in flight, and more than once.

Each seed draws a robot of the robust trial, with the position sensor, a first target and another, and when that is told: 0.12 to 0.44 s
before lift-off, or in flight. What lands within 3 cm and 5 degrees of the goal that the robot says is good; that goal
is nearer than the target where the target is out of reach.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ...studies.summary import wilson_interval
from .courses import SENSOR, failures, run_seed
from .rows import Row

SEEDS = range(34000, 34020)
"""Seeds of the robots and targets; nothing is tuned on them."""
PLACE_GOAL, TURN_GOAL = 0.03, 5.0
"""Largest error of place [m] and heading [deg] of a success."""
MISSED_GOAL = 0.05
LIFT_OFF = 1.39
"""Lift-off of the first jump of ``extensions/hopping/graphs/steer.yaml`` [s]."""
BEFORE = (0.12, 0.44)
"""Times of a change before lift-off [s]."""
FLYING = (0.02, 0.14)
"""Times of a change after lift-off [s]."""
DEPTH = 0.1
"""Depth of the floor below the lower of the two levels [m]."""

Command = dict[str, Any]


def _target(rng: np.random.Generator) -> Command:
    return {
        "ahead": round(rng.uniform(-0.05, 0.2), 4), "aside": round(rng.uniform(-0.1, 0.1), 4),
        "turn": round(math.radians(rng.uniform(-15.0, 15.0)), 4),
    }  # fmt: skip


def _beside(rng: np.random.Generator, target: Command, most: float, turn: float) -> Command:
    """Draw another target at most so far from one [m, deg], in a drawn direction."""
    way, angle = rng.uniform(0.0, most), rng.uniform(0.0, 2.0 * math.pi)
    turned = math.radians(rng.uniform(-turn, turn))
    return {
        "ahead": round(target["ahead"] + way * math.cos(angle), 4),
        "aside": round(target["aside"] + way * math.sin(angle), 4),
        "turn": round(target["turn"] + turned, 4),
    }


def _changes(target: Command, at: float) -> Command:
    return {**target, "replaces": True, "at": round(at, 3)}


def position_changes(rng: np.random.Generator) -> list[Command]:
    """Draw moves of the place by up to 10 cm before lift-off."""
    first = _target(rng)
    return [first, _changes(_beside(rng, first, 0.1, 0.0), LIFT_OFF - rng.uniform(*BEFORE))]


def turn_changes(rng: np.random.Generator) -> list[Command]:
    """Draw changes of the heading by up to 30 degrees before lift-off."""
    first = _target(rng)
    return [first, _changes(_beside(rng, first, 0.0, 30.0), LIFT_OFF - rng.uniform(*BEFORE))]


def height_changes(rng: np.random.Generator) -> list[Command]:
    """Draw a ground that turns out to be up to 3 cm higher or lower, before lift-off."""
    first = {"ahead": round(rng.uniform(0.16, 0.26), 4)}
    up = round(rng.uniform(-0.03, 0.03), 4)
    return [first, _changes({**first, "up": up}, LIFT_OFF - rng.uniform(*BEFORE))]


def flight_changes(rng: np.random.Generator) -> list[Command]:
    """Draw changes in flight: of the place by up to 6 cm, and of the heading by up to 20 degrees."""
    first = _target(rng)
    return [first, _changes(_beside(rng, first, 0.06, 20.0), LIFT_OFF + rng.uniform(*FLYING))]


def several_changes(rng: np.random.Generator) -> list[Command]:
    """Draw two changes of place and heading before lift-off, by up to 6 cm and 15 degrees each, and
    one by up to 3 cm and 8 degrees in flight."""
    first = _target(rng)
    second, third = _beside(rng, first, 0.06, 15.0), _beside(rng, first, 0.06, 15.0)
    return [
        first,
        _changes(second, LIFT_OFF - rng.uniform(0.26, 0.44)),
        _changes(third, LIFT_OFF - rng.uniform(0.12, 0.24)),
        _changes(_beside(rng, third, 0.03, 8.0), LIFT_OFF + rng.uniform(*FLYING)),
    ]


KINDS: Mapping[str, Callable[[np.random.Generator], list[Command]]] = {
    "place": position_changes, "turn": turn_changes, "height": height_changes,
    "in flight": flight_changes, "several": several_changes,
}  # fmt: skip


def changed_targets(seeds: Sequence[int] = SEEDS, kinds: Sequence[str] = tuple(KINDS)) -> list[Row]:
    """Measure for each kind of change the share of jumps that miss, and the errors."""
    rows = []
    for kind in kinds:
        found = [run_changed(kind, seed) for seed in seeds]
        n, missed = len(found), [one for one in found if not landed(one)]
        low, high = wilson_interval(len(missed), n)
        errors = [float(one["worst_place_error_m"]) for one in found if one.get("jumps")]
        turns = [float(one["worst_turn_error_deg"]) for one in found if one.get("jumps")]
        told = sum(int(one["targets_changed"]) for one in found)
        nearest = sum(int(one["targets_not_reached"]) for one in found)
        note = failures(found)
        rows += [
            Row(f"target changes, {kind}: jumps that miss", len(missed) / n, "", goal=MISSED_GOAL,
                note=f"{n} jumps, 95 % interval {low:.2f} to {high:.2f}; {told} changes, of {nearest} the nearest"),
            Row(f"target changes, {kind}: jumps that are no success",
                sum(not one["success"] for one in found) / n, "", note=note),
            Row(f"target changes, {kind}: error of place, median", float(np.median(errors)), "m"),
            Row(f"target changes, {kind}: error of place, largest", max(errors), "m"),
            Row(f"target changes, {kind}: error of heading, largest", max(turns), "deg"),
        ]  # fmt: skip
    return rows


def landed(metrics: Mapping[str, Any]) -> bool:
    """Tell whether a jump stands and is within the goals of its place and heading."""
    return (
        metrics.get("jumps") == 1
        and not str(metrics["reason"]).startswith("fell")
        and metrics["worst_place_error_m"] <= PLACE_GOAL
        and metrics["worst_turn_error_deg"] <= TURN_GOAL
    )


def run_changed(kind: str, seed: int, more: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Run a jump whose target changes and return its metrics; ``more`` overrides what the graph
    says."""
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    commands = KINDS[kind](rng)
    sets: dict[str, Any] = {"commands.commands": commands, "score.jumps": 1, "duration": 6.0}
    if kind == "height":
        sets["robot.ground.scene"] = two_levels(commands[-1]["ahead"], commands[-1]["up"])
    return run_seed(seed, "aloft:hopping/steer", (SENSOR,), {**sets, **(more or {})})


def two_levels(ahead: float, up: float) -> dict[str, Any]:
    """Return a scene in which the ground is higher from the middle of the way on."""
    edge, floor = 0.5 * ahead, min(0.0, up) - DEPTH
    boxes = [
        {"x": (-0.5, round(edge - 0.001, 4)), "y": (-0.5, 0.5), "top": 0.0, "bottom": floor},
        {"x": (round(edge, 4), 1.0), "y": (-0.5, 0.5), "top": up, "bottom": floor},
    ]
    return {"floor": floor, "boxes": boxes}
