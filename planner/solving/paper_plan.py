"""Plans a task in the ``paper`` formulation."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.rotations import matrices_of_quaternions
from ...robots.description import RobotDescription
from ..models.robot_model import model_of, stances_of
from ..problem import paper_problem as stages
from ..problem.paper_problem import PaperProblemBuilder
from ..problem.program import SimpleProblem
from ..task.phase import Phase
from ..task.plan import PlannedJump
from ..task.task import JumpTask
from .kept_functions import FunctionSet, Progress, SolveOptions, load_functions
from .outcome import failure, motion_arrays, statistics_of, versions
from .solver import solve
from .solver_process import cpu_time

STEPS = (0.0, 1.0 / 3.0, 2.0 / 3.0)
"""Shares of the way, the turn and the height of a jump at which it is planned before it is planned itself."""
LIMIT = 500
"""Iterations; without weights on accelerations the problem needs many."""
WARM_BARRIER = 1e-3
"""The barrier's parameter to begin with near a plan of another task."""


def paper_problem(
    task: JumpTask,
    robot: RobotDescription,
    *,
    progress: Progress | None = None,
) -> SimpleProblem:
    """Return the paper's problem of a task.

    Raises:
        PlanError: the task asks for what the paper's formulation has not.
    """
    model, finder = model_of(task.equipped(robot))
    functions = FunctionSet(
        stages.NAME, stages.PIECES, stages.SOURCES, lambda name: stages.make_piece(model, name)
    )
    pieces = load_functions(functions, model, progress=progress)
    stances = stances_of(task, robot, finder)
    return PaperProblemBuilder(task, model, pieces, stances[0], stances[-1]).build()


def solve_paper(task: JumpTask, robot: RobotDescription, options: SolveOptions) -> PlannedJump:
    """Return the plan of a task as the paper would make it; see ``solve_jump``.

    IPOPT is tried first: the equations have index three, as the
    centre of mass is tied to the joints by position, and fatrop more often ends early. From a ``warm_start``, a plan in
    any formulation, IPOPT begins near it. A jump that leads elsewhere begins with the jump in place, from which it is
    reached in steps: from nothing the solver ends in optima whose legs swing through half a turn. Where it finds nothing
    from there, it begins anew.
    """
    started = cpu_time()
    if options.knots is not None:
        task = task.model_copy(update={"knots": options.knots})
    problem = paper_problem(task, robot, progress=options.progress)
    tries = [options.solver] if options.solver else ["ipopt", "fatrop"]
    starts = [(name, problem.guess, False) for name in tries]
    if options.warm_start is not None and options.warm_start.touchdown_time > 0.0:
        starts.insert(0, (tries[0], variables_near(problem, options.warm_start), True))
    else:
        nearer = in_steps(task, robot, problem, tries[0], options)
        if nearer is not None:
            starts.insert(0, (tries[0], nearer, True))
    for name, guess, warm in starts:
        solution = solve(problem, guess, warm=warm, barrier=WARM_BARRIER, solver=name, limit=LIMIT)
        if solution.solved:
            break
    else:
        raise failure(task, solution)
    statistics = statistics_of(problem, solution) | {
        "warm": warm and options.warm_start is not None
    }
    arrays = unpack(problem, solution.values, robot)
    statistics["cpu_s"] = cpu_time() - started
    return PlannedJump(task=task, statistics=statistics, versions=versions(), **arrays)


def in_steps(
    task: JumpTask,
    robot: RobotDescription,
    problem: SimpleProblem,
    solver: str,
    options: SolveOptions,
) -> Array | None:
    """Return variables near a jump's solution, from those of the jump in place and of jumps on the way to it; ``None`` for
    jumps in place, for somersaults, and where one on the way has no solution."""
    asked = {
        name: getattr(task, name)
        for name in ("distance_x", "distance_y", "twist", "landing_height")
    }
    if task.rotation or not any(asked.values()):
        return None
    values: Array | None = None
    for share in STEPS:
        way = task.model_copy(update={name: share * value for name, value in asked.items()})
        near = paper_problem(way, robot, progress=options.progress)
        guess = near.guess if values is None else np.clip(values, near.lower, near.upper)
        found = solve(
            near, guess, warm=values is not None, barrier=WARM_BARRIER, solver=solver, limit=LIMIT
        )
        if not found.solved:
            return None
        values = found.values
    assert values is not None
    return np.clip(values, problem.lower, problem.upper)


def variables_near(problem: SimpleProblem, plan: PlannedJump) -> Array:
    """Return variables of the paper's problem near a plan of a task like it: read at the same share of the time before
    lift-off, of the flight, or of the landing. Accelerations and forces are those of the interval before a knot."""
    grid, found = problem.grid, problem.guess.copy()
    mine = np.array(
        [0.0, grid.times[grid.flight.start], grid.times[grid.flight.stop], grid.times[-1]]
    )
    theirs = np.array([0.0, plan.lift_off_time, plan.touchdown_time, plan.time[-1]])
    times = np.interp(grid.times, mine, theirs)
    stretch = np.diff(theirs) / np.diff(mine)
    turn = matrices_of_quaternions(plan.position[:, 3:7])
    world = np.einsum("kij,kj->ki", turn, plan.velocity[:, :3])  # the plan's is in the body's axes
    velocity = np.column_stack([world, plan.velocity[:, 3:]])

    def at(values: Array, time: float) -> Array:
        return np.array([np.interp(time, plan.time, column) for column in values.T])

    force = plan.contact_force.reshape(len(plan.time), -1)
    for k, time in enumerate(times):
        start = int(problem.assembly.state_start[k])
        position = at(plan.position, time)
        position[3:7] /= np.linalg.norm(position[3:7])
        piece = min(int(np.searchsorted(mine[1:], grid.times[k], side="right")), 2)
        rate = stretch[piece]
        speed = rate * at(plan.com_velocity, time)
        state = np.concatenate(
            [position, at(plan.com, time), speed, at(plan.angular_momentum, time)]
        )
        found[start : start + len(state)] = state
        if k == problem.knots - 1:
            break
        control, later = int(problem.assembly.control_start[k]), times[k + 1]
        length = float(grid.times[k + 1] - grid.times[k])
        gain = (rate * at(plan.com_velocity, later) - speed) / length
        values = [rate * at(velocity, later), gain]
        if grid.phases[k] is not Phase.FLIGHT:
            values.append(at(force, 0.5 * (time + later)))
        controls = np.concatenate(values)
        found[control : control + len(controls)] = controls
    return np.clip(found, problem.lower, problem.upper)


def unpack(problem: SimpleProblem, values: Array, robot: RobotDescription) -> dict[str, Any]:
    """Return the arrays of a plan. Centre of mass and momentum are the paper's variables r, rdot and h; the torques
    follow from exact inverse dynamics and nothing limits them.
    """
    model, grid = problem.model, problem.grid
    n, nv, count = model.size + 1, model.size, problem.knots
    states = np.array([problem.state(values, k) for k in range(count)])
    position = states[:, :n].copy()
    position[:, 3:7] /= np.linalg.norm(position[:, 3:7], axis=1, keepdims=True)
    turn = matrices_of_quaternions(position[:, 3:7])
    velocity = np.zeros((count, nv))
    force = np.zeros((count, 3 * len(robot.contacts)))
    grounded = np.array([phase is not Phase.FLIGHT for phase in grid.phases])
    for k in range(count - 1):
        control = problem.control(values, k)
        # v, rddot and F of knot k + 1; force and acceleration belong to the interval before it.
        velocity[k + 1] = control[:nv]
        velocity[k + 1, :3] = turn[k + 1].T @ control[:3]
        if grounded[k]:
            force[k] = control[nv + 3 :]
    force[-1] = force[-2]
    return {
        **motion_arrays(problem, grid.steps, position, velocity, force),
        "com": states[:, n : n + 3].copy(),
        "com_velocity": states[:, n + 3 : n + 6].copy(),
        "angular_momentum": states[:, n + 6 :].copy(),
        "lift_off_time": float(grid.times[grid.flight.start]),
        "touchdown_time": float(grid.times[grid.flight.stop]),
    }
