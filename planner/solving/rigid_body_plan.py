"""Plans a task in the ``srbm`` formulation."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...blocks.signals import Phase
from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.kinematics import matrices_of_quaternions
from ..models.quaternions import pose_of
from ..models.rigid_body import RigidBody, lump
from ..models.robot_model import model_of
from ..models.stance import stances_of
from ..problem import rigid_body_stages as stages
from ..problem.program import Program
from ..problem.rigid_body_problem import STATES, RigidBodyProblemBuilder
from ..problem.unpacking import twist
from ..task.plan import JumpPlan
from ..task.task import JumpTask
from .bounded import cpu_time
from .compilation import FunctionSet, Progress, load_functions
from .motion_arrays import motion_arrays
from .options import SolveOptions
from .outcome import failure, statistics_of, versions
from .rigid_body_motion import FeetPath, whole_body
from .solver import solve


def rigid_body_problem(
    task: JumpTask,
    robot: RobotDescription,
    *,
    compiled: bool = True,
    progress: Progress | None = None,
) -> tuple[Program, RigidBody]:
    """The single rigid body's problem of a task, and the body.

    Raises:
        PlanError: the task asks for what the formulation has not.
    """
    model, finder = model_of(task.equipped(robot))
    functions = FunctionSet(
        stages.NAME, stages.PIECES, stages.SOURCES, lambda name: stages.make_piece(model, name)
    )
    pieces = load_functions(functions, model, compiled=compiled, progress=progress)
    stances = stances_of(task, robot, finder)
    body = lump(model, stances[0])
    builder = RigidBodyProblemBuilder(task, model, pieces, body, stances[0], stances[-1])
    return builder.build(), body


def solve_rigid_body(task: JumpTask, robot: RobotDescription, options: SolveOptions) -> JumpPlan:
    """The plan of a task for a single rigid body; see ``solve_jump``. A ``warm_start`` is not used.

    Raises:
        PlanError: no motion was found, or the robot's legs cannot follow it.
    """
    started = cpu_time()
    if options.knots is not None:
        task = task.model_copy(update={"knots": options.knots})
    problem, body = rigid_body_problem(
        task, robot, compiled=options.compiled, progress=options.progress
    )
    solution = solve(problem, problem.guess, solver=options.solver)
    if not solution.solved:
        raise failure(task, solution)
    statistics = statistics_of(problem, solution)
    arrays = unpack(problem, body, solution.values, robot)
    statistics["cpu_s"] = cpu_time() - started
    return JumpPlan(task=task, statistics=statistics, versions=versions(), **arrays)


def unpack(
    problem: Program, body: RigidBody, values: Array, robot: RobotDescription
) -> dict[str, Any]:
    """The arrays of a plan. The angular momentum is the rigid body's, R I w; the robot's own, which
    its legs change, follows from positions and velocities. Torques are by exact inverse dynamics."""
    grid, count = problem.grid, problem.knots
    states = np.array([problem.state(values, k)[:STATES] for k in range(count)])
    steps = grid.steps.copy()
    for k in grid.flight:
        steps[k] *= problem.state(values, k)[STATES]
    times = np.concatenate([[0.0], np.cumsum(steps)])
    ends = [grid.flight.start, grid.flight.stop]
    path = FeetPath(
        (problem.start, problem.end), states[ends, :3], states[ends, 6:9],
        (float(times[ends[0]]), float(times[ends[1]])),
    )  # fmt: skip
    q, v = whole_body(
        problem.model, path, times, states[:, :6], states[:, 6:], problem.start.coordinates
    )
    force = np.zeros((count, 3 * len(robot.contacts)))
    for k, phase in enumerate(grid.phases):
        if phase is not Phase.FLIGHT:
            force[k] = problem.control(values, k)[6 : 6 + force.shape[1]]
    force[-1] = force[-2]
    position = np.array([pose_of(row) for row in q])
    velocity = np.array([twist(*row)[0] for row in zip(q, v, np.zeros_like(v), strict=True)])
    turn = matrices_of_quaternions(position[:, 3:7])
    momentum = np.array([
        r @ body.inertia @ w for r, w in zip(turn, velocity[:, 3:6], strict=True)
    ])  # fmt: skip
    return {
        **motion_arrays(problem, steps, position, velocity, force),
        "com": states[:, :3].copy(),
        "com_velocity": states[:, 6:9].copy(),
        "angular_momentum": momentum,
        "lift_off_time": path.times[0],
        "touchdown_time": path.times[1],
    }
