"""The reach of any robot in some minutes: the frontier in seven directions, beside BRUCE's.

The directions are BRUCE's at the robot's size (``directions.single_directions``). Upwards comes first,
because the other jumps rise by no more than half of what can be planned there. Each direction gets so much
processor time (``PLANNED_CPU``, ``RUNS_CPU``, ``THEORY_CPU``) and few runs, so what is told is a first look: the benchmark
``frontier`` shows with more seeds and rung by rung what holds.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ....robots.description import find_robot
from ....robots.robot_description import RobotDescription
from .directions import Direction, JumpSizes, leg_length, single_directions, sizes_of
from .frontier import frontier
from .search import RATE, Effort, JumpGraph

SEEDS = tuple(range(9000, 9004))
MINUTES = 10.0
"""Minutes of two cores for all directions; the shares below are for these."""
PLANNED_CPU, RUNS_CPU, THEORY_CPU = 45.0, 75.0, 30.0
"""Processor time after which no further solve, or run, is begun along one direction [s]. The rest of the ten minutes
is for those that are under way then, and for what is compiled first."""
QUARTER_TURN = 90.0
"""Turn that counts as one length of a leg [deg]."""
BRUCE = Path(__file__).with_name("bruce.json")
"""Written by ``lab/pages/refresh.py frontier``, with the table in docs/frontier.md."""


def reach(
    robot: RobotDescription,
    graph: JumpGraph,
    folder: Path,
    *,
    seeds: Sequence[int] = SEEDS,
    workers: int = 0,
    minutes: float = MINUTES,
    progress: Callable[[str], None] = lambda _: None,
) -> dict[str, Any]:
    """Measure the robot's reach in every direction, as plain data.

    Returns:
        ``robot``, ``mass_kg``, ``leg_length_m``, ``seeds``, ``rate``, ``minutes``, the processor time ``cpu_s`` that was
        spent, ``ended``: the searches that the time ended, and ``directions``: what
        ``frontier.result_of`` says of each, and ``in_legs``: its ends in lengths of the legs, or in turns of
        90 degrees. Where no rise can be planned, upwards is the only direction.
    """
    share = minutes / MINUTES
    effort = Effort(len(seeds), share * PLANNED_CPU, share * THEORY_CPU, True, share * RUNS_CPU)
    bruce = find_robot("bruce")
    name = "" if robot.name == bruce.name else robot.name
    legs = leg_length(robot)

    def along(directions: Sequence[Direction], effort: Effort) -> list[dict[str, Any]]:
        return frontier(
            graph, directions, seeds, folder, effort, workers=workers, progress=progress
        )

    up = single_directions(JumpSizes(legs / leg_length(bruce)), name)[:1]
    # What is planned upwards is kept and begins the search along all directions, which share the processors.
    (first,) = along(up, replace(effort, runs_cpu=0.0, theory_cpu=0.0))
    highest = first["planned"] / up[0].shown
    more = single_directions(sizes_of(robot, bruce, highest), name)[1:] if highest else ()
    found = along((*up, *more), effort)
    for each in found:
        each["in_legs"] = in_legs(each, legs)
    return {
        "robot": robot.name,
        "mass_kg": robot.total_mass,
        "leg_length_m": legs,
        "seeds": list(seeds),
        "rate": RATE,
        "minutes": minutes,
        "cpu_s": round(sum(sum(each["cpu_s"].values()) for each in found), 1),
        "ended": [
            f"{each['name']}, {key}"
            for each in found
            for key in ("reached", "planned", "theory")
            if not each[f"{key}_ended"]
        ],
        "directions": found,
    }


def in_legs(each: Mapping[str, Any], legs: float) -> dict[str, float]:
    """Convert a direction's ends to lengths of the ``legs`` [m], or to turns of 90 degrees."""
    unit = QUARTER_TURN if each["unit"] == "deg" else 100.0 * legs
    return {key: round(each[key] / unit, 4) for key in ("reached", "planned", "theory")}


def beside(found: Mapping[str, Any], robot: RobotDescription) -> dict[str, Any]:
    """Return the results of the benchmark ``frontier`` for a robot's single directions, as
    ``bruce_reach`` gives them."""
    singles = {way.name for way in single_directions()}
    legs = leg_length(robot)
    rows = [
        {"name": each["name"], "in_legs": in_legs(each, legs)}
        for each in found["directions"]
        if each["name"] in singles
    ]
    return {"robot": robot.name, "directions": rows}


def bruce_reach() -> dict[str, Any]:
    """Read BRUCE's reach: the results of the benchmark ``frontier`` with 20 seeds, for jumps of the
    same sizes."""
    found: dict[str, Any] = json.loads(BRUCE.read_text(encoding="utf-8"))
    return found
