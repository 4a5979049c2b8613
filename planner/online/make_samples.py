"""Plans the hops from which others are interpolated: ``python -m aloft.planner.online.make_samples``.

Hops are spread evenly over all requests by a Halton sequence, half of them ahead and half of them back. They are
solved from the shortest to the longest, each from the nearest of those before it or from nothing; those
without a valid plan are left out. It takes five minutes of one core.
"""

from __future__ import annotations

import math

import numpy as np

from ...robots.description import RobotDescription, find_robot
from ..checking.validity import check_plan
from ..solving.solve import solve_jump
from ..task.files import PlanError
from ..task.plan import PlannedJump
from .hop_plans import samples_path
from .hop_request import REACH, HopRequest, coarse, task_of
from .plan_samples import PlanSamples, differences, samples_of, write_samples

COUNT = 96
"""Requests that are tried."""
MARGIN = 1.08
"""How much further than the reach they go, so that requests at its edge lie between them."""
BASES = (2, 3, 5)
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
    distance, direction, turn = (halton(index // 2 + 1, base) for base in BASES)
    radius, angle = MARGIN * math.sqrt(distance), math.pi * (direction - 0.5)
    along = REACH["ahead"] if index % 2 == 0 else -REACH["back"]
    return HopRequest(
        round(along * radius * math.cos(angle), 4),
        round(REACH["aside"] * radius * math.sin(angle), 4),
        round(MARGIN * REACH["turn"] * (2.0 * turn - 1.0), 4),
    )


def find_samples(robot: RobotDescription, count: int = COUNT) -> PlanSamples:
    """Plan them all."""
    asked: list[HopRequest] = []
    plans: list[PlannedJump] = []
    for wanted in sorted((STILL, *map(request, range(count))), key=lambda one: apart(one, STILL)):
        found = _plan(wanted, robot, _nearest(wanted, asked, plans))
        if found is not None:
            asked.append(wanted)
            plans.append(found)
    return samples_of(robot.name, plans, asked)


def apart(one: HopRequest, other: HopRequest) -> float:
    """The distance between two requests, in units of ``SCALES``."""
    return math.hypot(*differences(np.array(one), other).tolist())


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
    print(write_samples(samples_path("bruce"), find_samples(find_robot("bruce"))))
