"""Makes the plan of the next hop within a fixed number of steps, or says what is done instead."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

from ...blocks.signals import PlanOutcome
from ...robots.description import RobotDescription
from ..checking.validity import checked
from ..problem.guess import ballistic_guess
from ..problem.problem import FullProblem
from ..problem.unpacking import can_start, pack, unpack
from ..solving.solve import make_problem
from ..task.plan import PlannedJump
from .correction import Corrector
from .hop_request import HopRequest, coarse, task_of, within_reach
from .plan_samples import PlanSamples


@dataclass(frozen=True)
class HopPlan:
    """A valid plan for a request.

    Attributes:
        plan: it, with its report.
        done: what it does.
        outcome: how it came about.
        steps: of Newton's method.
        failed: the tests of the check that the corrected plan failed.
        solve_s, check_s: processor time.
    """

    plan: PlannedJump
    done: HopRequest
    outcome: PlanOutcome
    steps: int
    failed: tuple[str, ...]
    solve_s: float
    check_s: float


class HopPlanner:
    """Plans hops of one robot; each plan follows from its request alone."""

    def __init__(self, robot: RobotDescription, samples: PlanSamples) -> None:
        self.robot = robot
        self.samples = samples
        self._correctors: dict[object, Corrector] = {}

    def prepare(self) -> None:
        """Load compiled functions and make the correctors, so that no later plan has to wait for them."""
        for ahead in (0.0, -0.05):  # feet land in another way after a jump back
            self.plan(HopRequest(ahead, 0.0, 0.0))

    def plan(self, wanted: HopRequest) -> HopPlan:
        """The plan of a request, or of what is nearest to it."""
        within = within_reach(wanted)
        found, steps, solve_s = self._solve(within)
        if found is None:
            return self._stored(within, PlanOutcome.UNSOLVED, steps, (), solve_s, 0.0)
        started = time.process_time()
        plan = checked(found, self.robot)
        check_s = time.process_time() - started
        if not plan.valid:
            failed = tuple(test["name"] for test in plan.report["tests"] if not test["passed"])
            return self._stored(within, PlanOutcome.INVALID, steps, failed, solve_s, check_s)
        outcome = PlanOutcome.PLANNED if within == wanted else PlanOutcome.NEAREST
        return HopPlan(plan, within, outcome, steps, (), solve_s, check_s)

    def _stored(
        self,
        wanted: HopRequest,
        outcome: PlanOutcome,
        steps: int,
        failed: tuple[str, ...],
        solve_s: float,
        check_s: float,
    ) -> HopPlan:
        row = self.samples.nearest(wanted)
        done = HopRequest(*self.samples.requests[row].tolist())
        stored = self.samples.plan(row)
        plan = replace(stored, task=coarse(stored.task.resolved(self.robot)))
        return HopPlan(plan, done, outcome, steps, failed, solve_s, check_s)

    def _solve(self, wanted: HopRequest) -> tuple[PlannedJump | None, int, float]:
        """A plan that has not been checked, the steps and the processor time [s]."""
        started = time.process_time()
        task = coarse(task_of(wanted, self.robot.name).resolved(self.robot))
        problem = make_problem(task, self.robot, coordinates="full")
        near = self.samples.interpolated(wanted)
        if not can_start(problem, near):
            return None, 0, time.process_time() - started
        guess = pack(problem, near, ballistic_guess(problem))
        found = self._corrector(problem).correct(problem, guess)
        plan = None
        if found.solved:
            plan = PlannedJump(task=task, **unpack(problem, found.values))
            plan = replace(plan, statistics={"coordinates": "full"})
        return plan, found.steps, time.process_time() - started

    def _corrector(self, problem: FullProblem) -> Corrector:
        key = problem.assembly.signature
        if key not in self._correctors:
            self._correctors[key] = Corrector(problem)
        return self._correctors[key]
