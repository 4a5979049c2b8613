"""Plans the hops from which others are interpolated: ``aloft steer --robot FILE`` keeps those of a user's robot, and
``python -m aloft.extensions.hopping.planner.make_samples ROBOT`` makes those that ship.

Hops are spread evenly over all requests by a Halton sequence. On level ground half of them go ahead and half
back. They are solved from the shortest to the longest, each from the nearest of those before it or from nothing. Those up and
down all go ahead, and are solved in the same way, the first from its neighbour on level ground. Those without a
valid plan are left out. Either takes two minutes of processor time for a quadruped, and five for a biped.

What is asked for are the limits of BRUCE, times how high the robot's centre of mass stands, unless options such as ``--back 0.3``
say other ones. The reach of the plans is the largest share of them within which nine of ten requests have a plan.
``--steps 80`` plans those up and down, too, whose limits are options such as ``--step-ahead 0.5``.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence

import numpy as np

from ....planner.checking.validity import check_plan
from ....planner.solving.solve import solve_jump
from ....planner.task.files import PlanError
from ....planner.task.plan import PlannedJump
from ....planner.task.scaling import HEIGHT, standing_height
from ....robots.description import RobotDescription, find_robot
from ....robots.kinematics import ball_feet
from .hop_plans import shipped_path
from .hop_request import HopReach, HopRequest, StepReach, coarse, task_of
from .plan_samples import SCALES, PlanSamples, read_samples, samples_of, write_samples

REACH = HopReach(ahead=0.32, back=0.10, aside=0.30, turn=0.87, rise=0.09)
"""BRUCE's. Jumps further back with a turn are planned, but in the robust trial they land askew."""
STEP_REACH = StepReach(least=0.12, ahead=0.32, aside=0.10, turn=0.35, up=0.06, down=0.06, rise=0.09)
ENOUGH = 0.9
"""The share of requests within a reach that have a plan."""
COUNT = 96
"""Requests on level ground that are tried."""
MARGIN = 1.08
"""Factor by which they go beyond the reach, so that requests at its edge lie between them."""
BASES = (2, 3, 5, 7)
RISES = (1.0, 0.8, 0.8)
"""Heights of jumps, each as a share of the one before, which has no plan on the spot."""
STILL = HopRequest(0.0, 0.0, 0.0)


def halton(index: int, base: int) -> float:
    """Return the number ``index`` of the van der Corput sequence, in [0, 1)."""
    value, share = 0.0, 1.0
    while index > 0:
        share /= base
        value += share * (index % base)
        index //= base
    return value


def request(index: int, reach: HopReach) -> HopRequest:
    """Return a request of the sequence."""
    distance, direction, turn = (halton(index // 2 + 1, base) for base in BASES[:3])
    radius, angle = MARGIN * math.sqrt(distance), math.pi * (direction - 0.5)
    along = reach.ahead if index % 2 == 0 else -reach.back
    return HopRequest(
        round(along * radius * math.cos(angle), 4),
        round(reach.aside * radius * math.sin(angle), 4),
        round(MARGIN * reach.turn * (2.0 * turn - 1.0), 4),
    )


def step_request(index: int, reach: StepReach) -> HopRequest:
    """Return a request of the sequence of jumps up and down."""
    distance, aside, turn, up = (2.0 * halton(index + 1, base) - 1.0 for base in BASES)
    level, height = 0.5 * (reach.up - reach.down), 0.5 * (reach.up + reach.down)
    middle, half = 0.5 * (reach.ahead + reach.least), 0.5 * (reach.ahead - reach.least)
    return HopRequest(
        round(middle + MARGIN * half * distance, 4), round(MARGIN * reach.aside * aside, 4),
        round(MARGIN * reach.turn * turn, 4), round(level + MARGIN * height * up, 4),
    )  # fmt: skip


def scaled(limits: Sequence[float], robot: RobotDescription) -> list[float]:
    """Scale lengths of BRUCE to another robot."""
    share = standing_height(robot) / HEIGHT
    return [round(share * length, 3) for length in limits]


def reach_for(robot: RobotDescription) -> HopReach:
    """Return the wanted reach of a robot on level ground. Back as far as ahead where its feet are balls: it has no
    heels to land on.
    """
    ahead, back, aside, rise = scaled((*REACH[:3], REACH.rise), robot)
    return HopReach(ahead, ahead if ball_feet(robot) else back, aside, REACH.turn, rise)


def step_reach_for(robot: RobotDescription, rise: float) -> StepReach:
    """Return the wanted reach of a robot up and down."""
    least, ahead, aside, up, down = scaled((*STEP_REACH[:3], *STEP_REACH[4:6]), robot)
    return StepReach(least, ahead, aside, STEP_REACH.turn, up, down, rise)


Tell = Callable[[HopRequest, bool], None]
"""Callback for each request, with True if it has a valid plan."""


def plan_level_hops(
    robot: RobotDescription, wanted: HopReach, tell: Tell, count: int
) -> PlanSamples:
    """Plan hops on level ground, lower than wanted where the motors are too weak.

    Raises:
        PlanError: not even the lowest jump on the spot has a valid plan.
    """
    for share in RISES:
        wanted = wanted._replace(rise=round(share * wanted.rise, 3))
        first = _plan_all(robot, [STILL], wanted.rise, [], [], tell)
        if first[0]:
            break
    else:
        raise PlanError(
            f"{robot.name} has no valid plan of a jump on the spot, {100.0 * wanted.rise:.1f} cm high"
        )
    requests = [request(index, wanted) for index in range(count)]
    others = _plan_all(robot, requests, wanted.rise, *first, tell)
    asked, plans = [*first[0], *others[0]], [*first[1], *others[1]]
    return samples_of(robot.name, plans, asked, reached(wanted, [STILL, *requests], asked))


def reached(
    wanted: HopReach, requests: Sequence[HopRequest], planned: Sequence[HopRequest]
) -> HopReach:
    """Return the largest share of the limits within which enough requests have a plan."""
    for percent in range(100, 0, -5):
        share = 0.01 * percent
        within = [one for one in requests if wanted.share(one) <= MARGIN * share]
        if sum(one in planned for one in within) >= ENOUGH * len(within):
            return wanted if percent == 100 else wanted.shortened(share)
    return wanted.shortened(0.0)


def plan_steps(
    robot: RobotDescription, level: PlanSamples, wanted: StepReach, count: int, tell: Tell
) -> PlanSamples:
    """Plan those up and down, the first from its neighbour on level ground."""
    rows = range(len(level.requests))
    near = [HopRequest(*level.requests[row].tolist()) for row in rows]
    requests = (step_request(index, wanted) for index in range(count))
    asked, plans = _plan_all(
        robot, [one for one in requests if not one.level], wanted.rise, near,
        list(map(level.plan, rows)), tell,
    )  # fmt: skip
    return samples_of(robot.name, plans, asked, wanted)


def _plan_all(
    robot: RobotDescription, requests: Sequence[HopRequest], rise: float, near: Sequence[HopRequest],
    there: Sequence[PlannedJump], tell: Tell,
) -> tuple[list[HopRequest], list[PlannedJump]]:  # fmt: skip
    """Plan all requests, from plans that are there and from each other."""
    asked, plans = [*near], [*there]
    for wanted in sorted(requests, key=lambda one: apart(one, STILL)):
        found = _plan(wanted, robot, rise, _nearest(wanted, asked, plans))
        tell(wanted, found is not None)
        if found is not None:
            asked.append(wanted)
            plans.append(found)
    own = slice(len(near), None)
    return asked[own], plans[own]


def apart(one: HopRequest, other: HopRequest) -> float:
    """Return the distance between two requests, in units of ``SCALES``."""
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
    wanted: HopRequest, robot: RobotDescription, rise: float, near: PlannedJump | None
) -> PlannedJump | None:
    """Return a valid plan on the knots of all samples, with all coordinates."""
    task = coarse(task_of(wanted, robot.name, rise).resolved(robot))
    for start in (near, None) if near is not None else (None,):
        try:
            plan = solve_jump(task, robot, warm_start=start, knots=task.knots, quick=True)
        except PlanError:
            continue
        if check_plan(plan, robot).valid:
            return plan
    return None


def main() -> None:
    """Plan the hops of the robot that the command line names."""
    parser = argparse.ArgumentParser(description="Plans the hops of a robot.")
    parser.add_argument("robot", nargs="?", default="bruce")
    parser.add_argument(
        "--count", type=int, default=COUNT, help="requests on level ground; 0: none"
    )
    parser.add_argument("--steps", type=int, default=0, help="requests up and down, such as 80")
    for limit in HopReach._fields:
        parser.add_argument(f"--{limit}", type=float, help="m or rad, on level ground")
    for limit in StepReach._fields:
        parser.add_argument(f"--step-{limit}", type=float, help="m or rad, up and down")
    given = vars(parser.parse_args())

    def told(fields: Sequence[str], prefix: str = "") -> dict[str, float]:
        return {name: given[prefix + name] for name in fields if given[prefix + name] is not None}

    def tell(wanted: HopRequest, valid: bool) -> None:
        print(wanted, "a plan" if valid else "no plan", flush=True)

    robot = find_robot(given["robot"])
    if given["count"]:
        wanted = reach_for(robot)._replace(**told(HopReach._fields))
        level = plan_level_hops(robot, wanted, tell, given["count"])
        print(write_samples(shipped_path(robot.name), level), level.reach)
    if given["steps"]:
        level = read_samples(shipped_path(robot.name))
        own = step_reach_for(robot, level.reach.rise)._replace(**told(StepReach._fields, "step_"))
        steps = plan_steps(robot, level, own, given["steps"], tell)
        print(write_samples(shipped_path(robot.name, steps=True), steps), steps.reach)


if __name__ == "__main__":
    main()
