"""Makes the plan of the next hop within a fixed number of iterations, or says what is done instead."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from ...blocks.signals import PlanOutcome
from ...robots.description import RobotDescription
from ..checking.validity import checked
from ..problem.guess import ballistic_guess
from ..problem.unpacking import can_start, pack, unpack
from ..solving.solve import make_problem
from ..solving.solver import solve
from ..task.plan import PlannedJump
from .hop_request import HopRequest, coarse, task_of, within_reach
from .plan_samples import PlanSamples

ITERATIONS = 35
"""Of the solver. What has not come to an end by then seldom does."""
BARRIER = 1e-2
"""The barrier's parameter to begin with: with a lower one four of ten plans did not come to an end."""


@dataclass(frozen=True)
class HopPlan:
    """A valid plan for a request.

    Attributes:
        plan: it, with its report.
        done: what it does.
        outcome: how it came about.
        iterations: of the solver.
        failed: the tests of the check that the solver's plan failed.
        solve_s, check_s: processor time.
    """

    plan: PlannedJump
    done: HopRequest
    outcome: PlanOutcome
    iterations: int
    failed: tuple[str, ...]
    solve_s: float
    check_s: float


class HopPlanner:
    """Plans hops of one robot; each plan follows from its request alone."""

    def __init__(self, robot: RobotDescription, samples: PlanSamples) -> None:
        self.robot = robot
        self.samples = samples

    def plan(self, wanted: HopRequest) -> HopPlan:
        """The plan of a request, or of what is nearest to it."""
        within = within_reach(wanted)
        found, iterations, solve_s = self._solve(within)
        if found is None:
            return self._stored(within, PlanOutcome.UNSOLVED, iterations, (), solve_s, 0.0)
        started = time.process_time()
        plan = checked(found, self.robot)
        check_s = time.process_time() - started
        if not plan.valid:
            failed = tuple(test["name"] for test in plan.report["tests"] if not test["passed"])
            return self._stored(within, PlanOutcome.INVALID, iterations, failed, solve_s, check_s)
        outcome = PlanOutcome.PLANNED if within == wanted else PlanOutcome.NEAREST
        return HopPlan(plan, within, outcome, iterations, (), solve_s, check_s)

    def _stored(
        self,
        wanted: HopRequest,
        outcome: PlanOutcome,
        iterations: int,
        failed: tuple[str, ...],
        solve_s: float,
        check_s: float,
    ) -> HopPlan:
        row = self.samples.nearest(wanted)
        done = HopRequest(*self.samples.requests[row].tolist())
        stored = self.samples.plan(row)
        plan = replace(stored, task=coarse(stored.task.resolved(self.robot)))
        return HopPlan(plan, done, outcome, iterations, failed, solve_s, check_s)

    def _solve(self, wanted: HopRequest) -> tuple[PlannedJump | None, int, float]:
        """A plan that has not been checked, the iterations and the processor time [s]."""
        task = coarse(task_of(wanted, self.robot.name).resolved(self.robot))
        problem = make_problem(task, self.robot, coordinates="full")
        near, cpu = self.samples.interpolated(wanted), 0.0
        if not can_start(problem, near):
            return None, 0, cpu
        guess = pack(problem, near, ballistic_guess(problem))
        solution = solve(
            problem, guess, warm=True, barrier=BARRIER, solver="fatrop", limit=ITERATIONS
        )
        if not solution.solved:
            return None, solution.iterations, solution.cpu
        plan = PlannedJump(task=task, **unpack(problem, solution.values))
        return replace(plan, statistics={"coordinates": "full"}), solution.iterations, solution.cpu
