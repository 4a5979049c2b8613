"""The outcome of a solve: the reason why there is no plan, or the plan's arrays and statistics.

The planner leaves out held joints of the robot; the plan is then written for all joints.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.welding import WeldedRobot
from ..models.exact_dynamics import ExactDynamics
from ..problem.program import SimpleProblem, joint_torques
from ..task.files import PlanError
from ..task.plan import PlannedJump
from ..task.task import JumpTask
from .solver import Solution

ADVICE = {
    "motor torque": "ask for a smaller jump, a longer thrust_time or a stronger profile",
    "motor torque at speed": "ask for a smaller jump, a longer thrust_time or a faster profile",
    "motor speed": "ask for a smaller jump, a longer flight or a faster profile",
    "held joints": "ask for a smaller jump or a longer thrust_time, or let these joints move",
    "friction": "ask for a shorter distance or more friction",
    "ground clearance": "ask for a greater rise or less foot_clearance",
    "leg clearance": "ask for less twist or less leg_clearance",
    "joint limits": "ask for a smaller jump",
    "footholds": "ask for a place within reach: a smaller distance, or a greater rise",
    "apex": "ask for a smaller rise or a longer thrust_time",
    "angular momentum": "allow more lift_off_momentum or touchdown_momentum",
    "flight time": "leave flight_time to the planner",
    "impact": "use impact: false, or ask for a smaller jump",
}


def statistics_of(problem: SimpleProblem, solution: Solution) -> dict[str, Any]:
    """Return the solver's statistics of a problem on a fixed grid, for the plan; the whole time is added later."""
    return {
        "solver": solution.solver,
        "iterations": solution.iterations,
        "solver_cpu_s": solution.cpu,
        "violation": solution.violation,
        "cost": solution.cost,
        "warm": False,
        "knots": problem.knots,
        "variables": problem.assembly.variables,
        "constraints": problem.assembly.constraints,
    }


def failure(task: JumpTask, solution: Solution) -> PlanError:
    """Return the error of a task without a solution, with what to do about it."""
    family = solution.family
    advice = ADVICE.get(family, "ask for a smaller jump, or change the durations")
    reason = (
        f"{family} is missed by {solution.violation:.3g}"
        if solution.violation > 1e-5
        else "the solver found no optimum"
    )
    return PlanError(
        f"no plan for {task.name!r} after {solution.iterations} iterations: {reason}; {advice}",
        family=family, violation=solution.violation,
    )  # fmt: skip


def versions() -> dict[str, str]:
    """Return the versions of the packages on which a plan depends."""
    import casadi as ca

    return {"casadi": str(ca.CasadiMeta.version()), "numpy": np.__version__}


def motion_arrays(
    problem: SimpleProblem, steps: Array, position: Array, velocity: Array, force: Array
) -> dict[str, Any]:
    """Return the motion at the knots, with accelerations by differences and torques by exact dynamics.

    Args:
        steps: the intervals' lengths [s], (knots - 1,).
        position: (knots, n_positions).
        velocity: (knots, n_velocities).
        force: of all contact points [N], (knots, 3 n_contacts).
    """
    times = np.concatenate([[0.0], np.cumsum(steps)])
    acceleration = np.diff(velocity, axis=0) / steps[:, None]
    phases = [*problem.grid.phases, problem.grid.phases[-1]]
    forces = force.reshape(len(times), -1, 3)
    contact = np.zeros(forces.shape[:2], dtype=bool)
    for k, loaded in enumerate([*problem.grid.on_ground, problem.grid.on_ground[-1]]):
        contact[k, list(loaded)] = True
    dynamics = ExactDynamics(problem.model.robot)
    return {
        "time": times,
        "position": position,
        "velocity": velocity,
        "acceleration": np.vstack([acceleration, acceleration[-1:]]),
        "contact_force": forces,
        "contact": contact,
        "phase": np.array([int(phase) for phase in phases], dtype=np.int64),
        "joint_torque": joint_torques(dynamics, times, position, velocity, forces),
    }


def for_all_joints(plan: PlannedJump, part: WeldedRobot, robot: RobotDescription) -> PlannedJump:
    """Return a plan of the welded robot as one of the whole robot.

    Held joints keep their angle. Their torques are what exact dynamics needs to keep them there.
    """
    if not part.held:
        return plan
    position = np.hstack(
        [plan.position[:, :7], part.expand(plan.position[:, 7:], held=part.angles)]
    )
    velocity = np.hstack([plan.velocity[:, :6], part.expand(plan.velocity[:, 6:])])
    bend = np.hstack([plan.acceleration[:, :6], part.expand(plan.acceleration[:, 6:])])
    torque = part.expand(plan.joint_torque)
    needed = joint_torques(
        ExactDynamics(robot), plan.time, position, velocity, plan.contact_force
    )  # fmt: skip
    torque[:, list(part.held)] = needed[:, list(part.held)]
    return replace(
        plan, position=position, velocity=velocity, acceleration=bend, joint_torque=torque
    )


def for_moving_joints(plan: PlannedJump, part: WeldedRobot) -> PlannedJump:
    """Return a plan of the whole robot as one of the welded robot, to start a solver from."""
    if not part.held:
        return plan

    def reduced(rows: Array, base: int) -> Array:
        return np.hstack([rows[:, :base], part.reduce(rows[:, base:])])

    return replace(
        plan,
        position=reduced(plan.position, 7),
        velocity=reduced(plan.velocity, 6),
        acceleration=reduced(plan.acceleration, 6),
        joint_torque=part.reduce(plan.joint_torque),
    )
