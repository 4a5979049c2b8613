"""Plans a task.

Hard jumps are solved by way of easier ones, with stronger motors first and then weaker ones step by step. For a somersault a solver that starts from a rough guess rarely finds a motion within tight motor limits. With
limits that are higher by 40 % or more it does. That motion is then a good initial guess for limits a little lower, and so on
down to the real ones. All other constraints hold at every step.

A plan that failed the validity check because its intervals are too long is solved again on finer ones. The planner's equations on the ground are of second order: errors of limits between knots and of torques at an
interval's ends fall to a fourth where intervals are halved. A plan that failed for a reason that a finer grid
cannot remove (a body in the way of a step, a task that is missed) is not solved again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.welding import welded
from ..models.coordinates import Coordinates
from ..models.robot_model import (
    Stance,
    model_of,
    stances_of,
    symmetric_model_of,
    twin_model_of,
)
from ..models.symbolic_model import SymbolicModel
from ..problem.guess import USUAL_TIMES, ballistic_guess, displaced_guess
from ..problem.layout import ProblemPhase, layout
from ..problem.problem import FullProblem, ProblemBuilder
from ..problem.stage_functions import PIECES, SLOPED, SLOPED_PIECES, make_coordinates
from ..problem.structure import is_mirrored
from ..problem.unpacking import can_start, knot_times, pack, segments, unpack
from ..task.files import JumpTaskError, PlanError, need_planner
from ..task.phase import Phase
from ..task.plan import ARRAYS, PlannedJump
from ..task.recipe import choices
from ..task.sequence import PHASES, Hop
from ..task.task import JumpTask, Knots
from .kept_functions import Progress, SolveOptions, load_pieces
from .outcome import failure, for_all_joints, for_moving_joints, versions
from .paper_plan import solve_paper
from .rigid_body_plan import solve_rigid_body
from .solver import LIMIT, NEAR, Solution, solve
from .solver_process import cpu_time

RELAXATIONS = (1.4, 2.0)
"""Multiples of the real motor limits with which a first motion is sought."""
FIRST_STEP, LAST_STEP = 0.1, 0.02
"""Steps by which the limits come down; halved where the solver does not follow."""
COLD_LIMIT, WARM_LIMIT = 250, 100
"""Iterations."""


def relaxed(problem: FullProblem, relaxation: float) -> FullProblem:
    """Return the problem with motor limits ``relaxation`` times as high."""
    motors = np.array([family.startswith("motor") for family in problem.families])
    scale = np.where(motors, relaxation, 1.0)
    return replace(
        problem, row_lower=problem.row_lower * scale, row_upper=problem.row_upper * scale
    )


def tighten(problem: FullProblem, values: Array, relaxation: float) -> Solution | None:
    """Return a solution of the problem, from one of the problem relaxed so much; ``None`` if none is reached."""
    step, found = FIRST_STEP, None
    iterations, cpu = 0, 0.0
    while relaxation > 1.0 or found is None:
        to = max(1.0, relaxation - step)
        trial = solve(relaxed(problem, to), values, warm=True, solver="fatrop", limit=WARM_LIMIT)
        iterations, cpu = iterations + trial.iterations, cpu + trial.cpu
        if trial.solved:
            values, relaxation, found = trial.values, to, trial
            continue
        step /= 2.0
        if step < LAST_STEP:
            return None
    return replace(found, iterations=iterations, cpu=cpu)


def from_relaxed(problem: FullProblem, guess: Array) -> Solution | None:
    """Return a solution of the problem from a rough guess, by way of relaxed ones."""
    for relaxation in RELAXATIONS:
        first = solve(relaxed(problem, relaxation), guess, solver="fatrop", limit=COLD_LIMIT)
        if first.solved:
            found = tighten(problem, first.values, relaxation)
            if found is not None:
                return replace(found, iterations=found.iterations + first.iterations)
    return None


def with_impacts(plan: PlannedJump) -> PlannedJump:
    """Return a plan whose feet arrive at rest with an impact of no impulse after every flight."""
    flying = np.append(plan.phase[:-1] == 3, False)
    touchdowns = np.flatnonzero(flying[:-1] & ~flying[1:]) + 1
    arrays = {
        name: np.insert(getattr(plan, name), touchdowns, getattr(plan, name)[touchdowns], axis=0)
        for name in ARRAYS
    }
    arrays["contact_force"][touchdowns + np.arange(len(touchdowns))] = 0.0
    return replace(plan, **arrays)


FACTOR = 1.5
"""Factor on the number of intervals when a plan is solved again."""
ROUNDS = 2
"""Greatest number of such repetitions."""
RELAXABLE = frozenset(
    {
        "position_defect", "rotation_defect", "velocity_defect", "angular_velocity_defect",
        "flight_position", "flight_rotation", "rise", "joint_torque", "joint_limits",
        "motor_torque", "motor_speed", "effort", "touchdown_speed", "foot_slip", "foot_on_ground",
        "foot_below_ground", "foot_clearance", "body_on_ground", "base_height",
        "leg_clearance",
    }
)  # fmt: skip
"""Tests whose figures depend on the length of the intervals."""
RELAXABLE_EXCESS = 8.0
"""A figure further than this many times its limit is no error of the grid."""


def relaxable(plan: PlannedJump) -> bool:
    """Check whether a plan with its report failed by what finer intervals may cure."""
    failed = [test for test in plan.report.get("tests", []) if not test["passed"]]
    return bool(failed) and all(
        test["name"] in RELAXABLE and test["value"] <= RELAXABLE_EXCESS * max(test["limit"], 1e-3)
        for test in failed
    )


def finer_knots(plan: PlannedJump) -> Knots:
    """Return numbers of intervals for solving a plan's task again; of several phases of a kind the one with the most
    counts.
    """
    count = dict.fromkeys(("squat", "thrust", "flight", "landing"), 4)
    for phase, start, stop in segments(plan.phase[:-1].tolist()):
        name = Phase(phase).name.lower()
        count[name] = max(count.get(name, 0), stop - start)
    return Knots.model_validate(
        {name: math.ceil(FACTOR * count[name]) for name in Knots.model_fields}
    )


def with_knots(task: JumpTask, knots: Knots) -> JumpTask:
    """Return the task on those numbers of intervals; phases that name their own change in proportion."""
    changed: dict[str, object] = {"knots": knots}
    if task.phases is not None and knots != task.knots:
        more = knots.total / task.knots.total
        changed["phases"] = tuple(
            phase_spec if phase_spec.knots is None
            else phase_spec.model_copy(update={"knots": math.ceil(more * phase_spec.knots)})
            for phase_spec in task.phases
        )  # fmt: skip
    return task.model_copy(update=changed)


def asks_for_finer(task: JumpTask, plan: PlannedJump | None) -> bool:
    """Check whether the plan to start from is a failed plan of the same task."""
    return (
        plan is not None
        and bool(plan.report)
        and not plan.valid
        and plan.task.content() == task.content()
    )


QUICK = 60
"""Iterations of a quick solve."""
QUICK_NEAR = 40
"""Iterations of a quick solve from a plan with all coordinates; those that come to an end take 20 to 30."""
LAST = 60
"""Iterations of IPOPT for one jump with all coordinates, where each takes 60 to 90 ms; all plans that it has
found there took fewer."""
Formulation = Callable[[JumpTask, RobotDescription, SolveOptions], PlannedJump]
"""Maker of a plan of a task with one set of decision variables, cost and constraints; the plan leaves out the robot's
held joints.
"""


def solve_jump(
    task: JumpTask,
    robot: RobotDescription,
    *,
    warm_start: PlannedJump | None = None,
    progress: Progress | None = None,
    solver: str = "",
    knots: Knots | None = None,
    quick: bool = False,
) -> PlannedJump:
    """Return the plan of a task, in the formulation that it names; ``SolveOptions`` explains the rest.

    Joints that the robot's description holds keep still. The result does not depend on the number
    of threads.

    Raises:
        PlanError: no motion was found; ``family`` names the constraints that could not be met.
        JumpTaskError: the task names joints that the robot has not.
    """
    need_planner()
    try:
        robot = task.equipped(robot)
        chosen = [choice.as_json() for choice in choices(task, robot)]
        task = task.resolved(robot)
    except JumpTaskError as error:
        raise PlanError(str(error), family="motor torque") from error
    if task.leans and task.formulation != "full":
        raise PlanError(
            f"formulation {task.formulation} knows level ground only; use formulation: full, or a "
            "task without slopes",
            family="stance",
        )
    model_of(robot)  # raises what is wrong with the robot itself
    part = welded(robot)
    start = warm_start and for_moving_joints(warm_start, part)
    options = SolveOptions(start, progress, solver, knots, quick)
    plan = FORMULATIONS[task.formulation](task, robot, options)
    plan = replace(plan, statistics={**plan.statistics, "chosen": chosen})
    return for_all_joints(plan, part, robot)


def solve_full(task: JumpTask, robot: RobotDescription, options: SolveOptions) -> PlannedJump:
    """Solve the ``full`` formulation: the whole body's dynamics with its motors' limits; see ``problem``."""
    started = cpu_time()
    warm_start, solver = options.warm_start, options.solver
    knots = options.knots
    if knots is None:
        again = warm_start is not None and asks_for_finer(task, warm_start)
        knots = finer_knots(warm_start) if again and warm_start is not None else task.knots
    gridded = with_knots(task, knots)
    problem = make_problem(gridded, robot, progress=options.progress)
    guess = ballistic_guess(problem)
    solution, warm = None, False
    if warm_start is not None and _leaves_plane(problem, warm_start) and options.quick:
        warm_start = None  # the same jump straight ahead is a nearer start
    if warm_start is not None and can_start(problem, warm_start):
        warm = True
        near, most = pack(problem, warm_start, guess), LIMIT
        if options.quick:
            most = QUICK_NEAR if problem.coordinates.name == "full" else QUICK
        solution = solve(
            problem, near, warm=True, barrier=_barrier(problem), solver="fatrop", limit=most
        )
        if options.quick and not solution.solved and problem.coordinates.name == "full":
            # The jump straight ahead is farther than the plan, and takes as long again.
            raise failure(task, solution)
    if solution is None or not solution.solved:
        warm = False
        turns = any(hop.rotation for hop in task.hops()) and not solver
        solution = _turning(problem, robot, guess) if turns else None
    if (solution is None or not solution.solved) and options.quick:
        moved = _displaced(problem, robot)
        start = guess if moved is None else moved
        near_it = moved is not None
        solution = solve(
            problem, start, warm=near_it, barrier=_barrier(problem), solver="fatrop", limit=QUICK
        )
        if not solution.solved:
            raise failure(task, solution)
    if solution is None or not solution.solved:
        solution = solve(
            problem, guess, barrier=_barrier(problem), solver=solver, last=_last(problem),
            other_guess=lambda: _displaced(problem, robot),
        )  # fmt: skip
    if not solution.solved:
        raise failure(task, solution)
    statistics = {
        "solver": solution.solver,
        "iterations": solution.iterations,
        "cpu_s": cpu_time() - started,
        "solver_cpu_s": solution.cpu,
        "violation": solution.violation,
        "cost": solution.cost,
        "warm": warm,
        "knots": problem.knots,
        "coordinates": problem.coordinates.name,
        "variables": problem.assembly.variables,
        "constraints": problem.assembly.constraints,
    }
    return PlannedJump(
        task=task, statistics=statistics, versions=versions(), **unpack(problem, solution.values)
    )


FORMULATIONS: Mapping[str, Formulation] = {
    "full": solve_full,
    "paper": solve_paper,
    "srbm": solve_rigid_body,
}
"""Formulations by the name in a task."""


_coordinates = lru_cache(maxsize=16)(make_coordinates)
"""Coordinates of a model, made once."""


def make_problem(
    task: JumpTask,
    robot: RobotDescription,
    *,
    progress: Progress | None = None,
    coordinates: str = "",
) -> FullProblem:
    """Return the problem of a task in the ``full`` formulation, in the sagittal plane where the task stays in it.

    Elsewhere times on the ground that are free are those of the same jumps straight ahead and
    without impacts: with all coordinates and such times fatrop does not come to an end.

    Raises ``PlanError`` and ``JumpTaskError`` as ``solve_jump`` does.
    """
    builder = _builder(task, robot, progress, coordinates)
    return builder.build()


def problems_like(
    task: JumpTask, robot: RobotDescription, *, coordinates: str
) -> Callable[[JumpTask], FullProblem]:
    """Return a maker of the problems of tasks that differ from one only in where they lead; see
    ``ProblemBuilder.moved``. The tasks must have been resolved.

    Raises ``PlanError`` and ``JumpTaskError`` as ``solve_jump`` does.
    """
    builder, robot = _builder(task, robot, None, coordinates), task.equipped(robot)
    builder.build()
    mirrored = builder.coordinates.name != "full"
    finder = (symmetric_model_of if mirrored else model_of)(robot)[1]
    return lambda other: builder.moved(other, stances_of(other, robot, finder))


def _builder(
    task: JumpTask, robot: RobotDescription, progress: Progress | None, coordinates: str,
    *, twin: bool = False,
) -> ProblemBuilder:  # fmt: skip
    """Return the builder of ``make_problem``; ``twin`` takes the robot's mirrored twin where it is not the same left
    and right.
    """
    robot, task = task.equipped(robot), task.resolved(robot)
    exact, finder = model_of(robot)
    model, stances = exact, stances_of(task, robot, finder)
    problem_phases = layout(task, robot)
    chosen = None
    wanted = (coordinates,) if coordinates else _mirrors(task)
    if any(name != "full" for name in wanted):
        alike, finder = (twin and twin_model_of(robot)) or symmetric_model_of(robot)
        placed = stances_of(task, robot, finder)
        chosen = _choose(alike, wanted, placed, problem_phases)
        if chosen is not None:
            model, stances = alike, placed
    if chosen is None:
        if coordinates not in ("", "full"):
            raise ValueError(f"{robot.name} does not do this jump in {coordinates} coordinates")
        chosen = _coordinates(exact, "full")
    free = any(problem_phase.timed and not problem_phase.flies for problem_phase in problem_phases)
    if free and chosen.name == "full" and not coordinates:
        given = with_ground_times(task, robot, progress=progress)
        return _builder(given, robot, progress, "")
    used = {
        "contact",
        "take_off",
        "air",
        "obstacle",
        *(problem_phase.piece for problem_phase in problem_phases),
    }
    names = tuple(name for name in PIECES if name in used)
    if task.leans:
        names = tuple(SLOPED + name if name in SLOPED_PIECES else name for name in names)
    loaded = load_pieces(model, chosen, names=names, progress=progress)
    pieces = {name.removeprefix(SLOPED): piece for name, piece in loaded.items()}
    return ProblemBuilder(task, model, chosen, pieces, stances, exact)


def _mirrors(task: JumpTask) -> tuple[str, ...]:
    """Return the coordinates to try for a task, the smallest first, before all of the robot's."""
    # An impact leaves motors that keep still without an impulse, which a plane cannot tell.
    straight = all(not hop.distance_y and not hop.twist for hop in task.hops())
    return ("sagittal", "mirrored") if straight else ()


def _choose(
    model: SymbolicModel, names: tuple[str, ...], stances: tuple[Stance, ...],
    problem_phases: tuple[ProblemPhase, ...],
) -> Coordinates | None:  # fmt: skip
    """Return the first of these coordinates that the stances and the contacts allow."""
    every = np.array([stance.coordinates for stance in stances])
    for name in names:
        try:
            found = _coordinates(model, name)
        except ValueError:
            return None
        stands = all(is_mirrored(found, problem_phase.contacts) for problem_phase in problem_phases)
        if stands and found.contains(every):
            return found
    return None


def with_ground_times(
    task: JumpTask, robot: RobotDescription, *,
    progress: Progress | None = None,
) -> JumpTask:  # fmt: skip
    """Return the task with all times on the ground given: those that are free are found for the same jumps straight
    ahead, or are usual ones where these cannot be planned.
    """
    times = [USUAL_TIMES.get(PHASES[phase_spec.phase], 0.0) for phase_spec in task.phase_specs()]
    straight = straight_ahead(task).model_copy(update={"impact": False})
    usual = with_times(straight, times)
    if make_problem(usual, robot, progress=progress).coordinates.name != "full":
        problem = make_problem(straight, robot, progress=progress)
        solution = solve(problem, ballistic_guess(problem), solver="fatrop")
        if solution.solved:
            knots = knot_times(problem, solution.values)
            times = [float(knots[s.stop] - knots[s.first]) for s in problem.problem_phases]
    return with_times(task, times)


def with_times(task: JumpTask, times: list[float]) -> JumpTask:
    """Return the task with those times [s] of its phases where they are free, except for flights."""
    phases = tuple(
        phase_spec if phase_spec.phase == "flight" or phase_spec.time is not None
        else phase_spec.model_copy(update={"time": round(time, 6)})
        for phase_spec, time in zip(task.phase_specs(), times, strict=True)
    )  # fmt: skip
    return task.model_copy(update={"phases": phases})


def straight_ahead(task: JumpTask) -> JumpTask:
    """Return the same jumps without their sideways displacements and twists, on ground that does not lean sideways."""

    def changed(jump: JumpTask | Hop) -> dict[str, object]:
        slopes = {
            name: (slope[0], 0.0)
            for name in ("slope", "landing_slope")
            if (slope := getattr(jump, name, None)) is not None
        }
        return {"distance_y": 0.0, "twist": 0.0, **slopes}

    jumps = task.jumps and tuple(hop.model_copy(update=changed(hop)) for hop in task.jumps)
    return task.model_copy(update={**changed(task), "jumps": jumps})


def in_place(task: JumpTask) -> JumpTask:
    """Return a row of as many jumps in place, if all of them are on level ground; else the row itself."""
    if task.leans or any(hop.landing_height or hop.gap for hop in task.hops()):
        return task
    still = {"distance_x": 0.0, "distance_y": 0.0, "twist": 0.0}
    jumps = task.jumps and tuple(hop.model_copy(update=still) for hop in task.jumps)
    return task.model_copy(update={**still, "jumps": jumps})


def _barrier(problem: FullProblem) -> float:
    """Return the barrier's parameter for starts from another plan. With all coordinates such a plan is further from the
    solution, and a higher barrier takes a fifth fewer iterations.
    """
    return 1e-3 if problem.coordinates.name == "full" else NEAR


def _last(problem: FullProblem) -> int:
    """Return the iterations that the last attempt may take. Longer ones leave no time to look for a task that can be
    planned.
    """
    hops = problem.task.hops()
    alone = len(hops) == 1 and not hops[0].rotation
    return LAST if alone and problem.coordinates.name == "full" else LIMIT


def _leaves_plane(problem: FullProblem, plan: PlannedJump) -> bool:
    """Check whether a problem has all coordinates, and a plan of it would start from one that has not."""
    return problem.coordinates.name == "full" and plan.statistics.get("coordinates") != "full"


def _displaced(problem: FullProblem, robot: RobotDescription) -> Array | None:
    """Return a guess from a simpler jump that can be solved: the same straight ahead, of the robot or of its mirrored
    twin; or, where that needs all coordinates, too, one in place on level ground.
    """
    if problem.coordinates.name != "full":
        return None
    straight, twin = straight_ahead(problem.task), twin_model_of(robot) is not None
    for task, mirrored in ((straight, twin), (in_place(problem.task), False)):
        if task == problem.task and not mirrored:
            continue
        simpler = _builder(task, robot, None, "", twin=mirrored).build()
        if task == problem.task and simpler.coordinates.name == "full":
            continue  # the twin does not stand the same left and right
        solution = solve(simpler, ballistic_guess(simpler), solver="fatrop")
        if solution.solved:
            return displaced_guess(problem, simpler, solution.values)
        if simpler.coordinates.name != "full" and not mirrored:
            break
    return None


def _turning(problem: FullProblem, robot: RobotDescription, guess: Array) -> Solution | None:
    """Return a somersault by way of stronger motors; one with impacts also by way of one without."""
    found = from_relaxed(problem, guess)
    if found is not None or not problem.task.impact:
        return found
    task = problem.task.model_copy(update={"impact": False})
    gentle = make_problem(task, robot)
    for relaxation in RELAXATIONS:
        first = solve(relaxed(gentle, relaxation), ballistic_guess(gentle), solver="fatrop")
        if not first.solved:
            continue
        plan = with_impacts(PlannedJump(task=task, **unpack(gentle, first.values)))
        found = tighten(problem, pack(problem, plan, guess), relaxation)
        if found is not None:
            return found
    return None
