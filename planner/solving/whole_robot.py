"""Plans for a robot with held joints: the planner leaves these joints out, and the plan is then written for all joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.welding import WeldedRobot
from ..models.exact_dynamics import ExactDynamics
from ..problem.one_flight import joint_torques
from ..task.plan import JumpPlan


def for_all_joints(plan: JumpPlan, part: WeldedRobot, robot: RobotDescription) -> JumpPlan:
    """A plan of the welded robot as one of the whole robot.

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


def for_moving_joints(plan: JumpPlan, part: WeldedRobot) -> JumpPlan:
    """A plan of the whole robot as one of the welded robot, to start a solver from."""
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
