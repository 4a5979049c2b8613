"""Plans the hops from which others are interpolated: ``python -m aloft.planner.online.make_samples``.

Hops are spread evenly over all requests by a Halton sequence. On level ground half of them go ahead and half
back. They are solved from the shortest to the longest, each from the nearest of those before it or from nothing. Those up and
down all go ahead, and are solved in the same way, the first from its neighbour on level ground. Those without a
valid plan are left out. Either takes five minutes of one core.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...robots.description import RobotDescription, find_robot
from ..checking.validity import check_plan
from ..solving.solve import solve_jump
from ..task.files import PlanError
from ..task.plan import PlannedJump
from .hop_plans import samples_path
from .hop_request import REACH, STEP_REACH, HopRequest, coarse, task_of
from .plan_samples import SCALES, PlanSamples, samples_of, write_samples

COUNT = 96
"""Requests that are tried."""
MARGIN = 1.08
"""How much further than the reach they go, so that requests at its edge lie between them."""
STEPPED = 80
"""The same of jumps up and down."""
BASES = (2, 3, 5, 7)
STILL = HopRequest(0.0, 0.0, 0.0)


def halton(index: int, base: int) -> float:
    """The number ``index`` of the van der Corput sequence, in [0, 1)."""
    value, share = 0.0, 1.0
    while index > 0:
        share /= base
        value += share * (index % base)
        index //= base
    return value


def request(index: int) -> HopRequest:
    """A request of the sequence."""
    distance, direction, turn = (halton(index // 2 + 1, base) for base in BASES[:3])
    radius, angle = MARGIN * math.sqrt(distance), math.pi * (direction - 0.5)
    along = REACH["ahead"] if index % 2 == 0 else -REACH["back"]
    return HopRequest(
        round(along * radius * math.cos(angle), 4),
        round(REACH["aside"] * radius * math.sin(angle), 4),
        round(MARGIN * REACH["turn"] * (2.0 * turn - 1.0), 4),
    )


def step_request(index: int) -> HopRequest:
    """A request of the sequence of jumps up and down."""
    distance, aside, turn, up = (2.0 * halton(index + 1, base) - 1.0 for base in BASES)
    r = STEP_REACH
    middle, half = 0.5 * (r["ahead"] + r["least"]), 0.5 * (r["ahead"] - r["least"])
    return HopRequest(
        round(middle + MARGIN * half * distance, 4), round(MARGIN * r["aside"] * aside, 4),
        round(MARGIN * r["turn"] * turn, 4), round(MARGIN * r["up"] * up, 4),
    )  # fmt: skip


def find_samples(robot: RobotDescription, count: int = COUNT) -> PlanSamples:
    """Plan those on level ground."""
    return _find(robot, (STILL, *map(request, range(count))), [], [])


def find_steps(robot: RobotDescription, level: PlanSamples, count: int = STEPPED) -> PlanSamples:
    """Plan those up and down, the first from its neighbour on level ground."""
    rows = range(len(level.requests))
    near = [HopRequest(*level.requests[row].tolist()) for row in rows]
    wanted = tuple(one for one in map(step_request, range(count)) if not one.level)
    return _find(robot, wanted, near, [level.plan(row) for row in rows])


def _find(
    robot: RobotDescription, requests: Sequence[HopRequest], near: Sequence[HopRequest],
    there: Sequence[PlannedJump],
) -> PlanSamples:  # fmt: skip
    """Plan all requests, from plans that are there and from each other."""
    asked, plans = [*near], [*there]
    for wanted in sorted(requests, key=lambda one: apart(one, STILL)):
        found = _plan(wanted, robot, _nearest(wanted, asked, plans))
        if found is not None:
            asked.append(wanted)
            plans.append(found)
    own = slice(len(near), None)
    return samples_of(robot.name, plans[own], asked[own])


def apart(one: HopRequest, other: HopRequest) -> float:
    """The distance between two requests, in units of ``SCALES``."""
    return math.hypot(*((np.array(one) - np.array(other)) / SCALES).tolist())


def _nearest(
    wanted: HopRequest, asked: list[HopRequest], plans: list[PlannedJump]
) -> PlannedJump | None:
    if not plans:
        return None

    # Of its own kind where there is one: see ``PlanSamples.weights``.
    def distance(row: int) -> tuple[bool, float]:
        return (asked[row].ahead < 0.0) != (wanted.ahead < 0.0), apart(wanted, asked[row])

    return plans[min(range(len(asked)), key=distance)]


def _plan(
    wanted: HopRequest, robot: RobotDescription, near: PlannedJump | None
) -> PlannedJump | None:
    """A valid plan on the knots of all samples, with all coordinates."""
    task = coarse(task_of(wanted, robot.name).resolved(robot))
    for start in (near, None) if near is not None else (None,):
        try:
            plan = solve_jump(task, robot, warm_start=start, knots=task.knots, quick=True)
        except PlanError:
            continue
        report = check_plan(plan, robot)
        print(wanted, plan.statistics["iterations"], [t.name for t in report.failed], flush=True)
        if report.valid:
            return plan
    return None


if __name__ == "__main__":
    ROBOT = find_robot("bruce")
    ON_LEVEL = find_samples(ROBOT)
    print(write_samples(samples_path(ROBOT.name), ON_LEVEL))
    print(write_samples(samples_path(ROBOT.name, steps=True), find_steps(ROBOT, ON_LEVEL)))
