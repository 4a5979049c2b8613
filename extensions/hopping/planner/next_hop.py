"""Plan of the next hop, made within a fixed number of steps, or its replacement."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

from ....planner.checking.validity import checked
from ....planner.problem.assembly import Assembly
from ....planner.problem.problem import FullProblem
from ....planner.problem.unpacking import can_start, pack, unpack
from ....planner.task.plan import PlannedJump
from ....robots.description import RobotDescription
from .correction import Corrector
from .hop_problems import HopProblems
from .hop_request import HopRequest, coarse, task_of
from .plan_outcome import PlanOutcome
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
    """Plans hops of one robot; each plan follows from its request alone. Without stored plans up and down (``steps``)
    all of its jumps are on level ground."""

    def __init__(
        self, robot: RobotDescription, samples: PlanSamples, steps: PlanSamples | None
    ) -> None:
        self.robot = robot
        self._level, self._steps = samples, steps
        self._problems = HopProblems(robot)
        self._correctors: dict[object, Corrector] = {}
        # Kinds of hops share a corrector; to find that out takes long, so it is done once for each.
        self._of_kind: WeakKeyDictionary[Assembly, Corrector] = WeakKeyDictionary()

    def prepare(self) -> None:
        """Load compiled functions and make the correctors, so that no later plan has to wait for them."""
        # Feet land in another way after a jump back; a step up has other bounds than one down. Jumps
        # straight ahead have fewer coordinates.
        kinds = [(0.0, 0.0), (-0.05, 0.0)]
        if self._steps is not None:
            kinds += [(0.2, 0.03), (0.2, -0.03)]
        for ahead, up in kinds:
            for aside in (0.0, 0.01):
                self.plan(HopRequest(ahead, aside, 0.0, up))

    def samples(self, wanted: HopRequest) -> PlanSamples:
        """Return the stored plans of jumps of its kind."""
        return self._level if wanted.level or self._steps is None else self._steps

    def plan(self, wanted: HopRequest) -> HopPlan:
        """Return the plan of a request, or of what is nearest to it."""
        within = self.samples(wanted).reach.nearest(wanted)
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
        samples = self.samples(wanted)
        row = samples.nearest(wanted)
        done = HopRequest(*samples.requests[row].tolist())
        stored = samples.plan(row)
        plan = replace(stored, task=coarse(stored.task.resolved(self.robot)))
        return HopPlan(plan, done, outcome, steps, failed, solve_s, check_s)

    def _solve(self, wanted: HopRequest) -> tuple[PlannedJump | None, int, float]:
        """Return a plan that has not been checked, the steps and the processor time [s]."""
        started = time.process_time()
        rise = self.samples(wanted).reach.rise
        task = coarse(task_of(wanted, self.robot.name, rise).resolved(self.robot))
        straight = not wanted.aside and not wanted.turn
        coordinates = "" if straight else "full"  # the smallest that the robot has
        problem = self._problems.problem(task, coordinates)
        plan, steps = None, 0
        for near in self._guesses(wanted):
            if not can_start(problem, near):
                continue
            guess = pack(problem, near)
            found = self._corrector(problem).correct(problem, guess)
            steps += found.steps
            if found.solved:
                solved = {"coordinates": problem.coordinates.name}
                plan = PlannedJump(task=task, statistics=solved, **unpack(problem, found.values))
                break
        return plan, steps, time.process_time() - started

    def _guesses(self, wanted: HopRequest) -> Iterator[PlannedJump]:
        """Yield motions near that of a request: between the stored plans, and where that leads to none the nearest of
        them.
        """
        samples = self.samples(wanted)
        yield samples.interpolated(wanted)
        yield samples.plan(samples.nearest(wanted))

    def _corrector(self, problem: FullProblem) -> Corrector:
        assembly = problem.assembly
        if assembly not in self._of_kind:
            key = assembly.signature
            if key not in self._correctors:
                self._correctors[key] = Corrector(problem)
            self._of_kind[assembly] = self._correctors[key]
        return self._of_kind[assembly]
