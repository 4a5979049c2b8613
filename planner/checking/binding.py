"""Finds the limits of the robot that a plan reaches, and that so prevent a larger jump."""

from __future__ import annotations

import numpy as np

from ...robots.description import RobotDescription
from ..task.margins import Margins, joint_bounds
from ..task.plan import JumpPlan
from .evidence import Evidence
from .plan_tests import allowed_motor_torque
from .replay import replay

NEAR = 0.985
"""The share of a limit from which it counts as reached."""
NEAR_LIMIT = 0.01
"""rad; the same for a joint's limit."""
LEAST_TIME = 0.02
"""Of the plan's instants, how many must be at a limit for it to be named."""


def what_binds(plan: JumpPlan, robot: RobotDescription) -> tuple[str, ...]:
    """The motors whose torque or speed, and the joints whose limits, the plan reaches, by their
    names without the side, in the robot's order; friction comes last."""
    robot = plan.task.equipped(robot)
    evidence = Evidence(plan, robot, replay(plan, robot))
    effort, motors = evidence.effort, evidence.motors
    middle = evidence.middles
    allowed = np.maximum(allowed_motor_torque(evidence, effort)[middle], 1e-6)
    falling = allowed < NEAR * effort[middle] * motors.peak_torque
    full = np.abs(evidence.motor_torque[middle]) > NEAR * allowed
    fast = np.abs(evidence.motor_speed) > NEAR * effort * motors.no_load_speed
    found = list[str]()
    for k, name in enumerate(robot.transmission.motors):
        if (full & falling)[:, k].any():
            found.append(f"{_short(name)} motor torque at speed")
        elif full[:, k].any():
            found.append(f"{_short(name)} motor torque")
        if fast[:, k].any():
            found.append(f"{_short(name)} motor speed")
    margins = plan.task.margins or Margins()
    bounds = joint_bounds(robot, margins, False)
    angles = evidence.replay.samples.position[:, 7:]
    near = (angles < bounds[:, 0] + NEAR_LIMIT) | (angles > bounds[:, 1] - NEAR_LIMIT)
    for k, joint in enumerate(robot.joints):
        if near[:, k].mean() > LEAST_TIME and joint.name not in robot.held:
            found.append(f"{_short(joint.name)} joint limit")
    force = plan.contact_force
    loaded = force[:, :, 2] > 1.0
    used = np.hypot(force[:, :, 0], force[:, :, 1]) / np.maximum(force[:, :, 2], 1e-9)
    if bool((used > NEAR * plan.task.friction / np.sqrt(2.0))[loaded].any()):
        found.append("friction")
    return tuple(dict.fromkeys(found))


def _short(name: str) -> str:
    """A name without its side: both sides bind alike more often than not."""
    name = name.removesuffix("_motor").removesuffix("_joint")
    side, _, rest = name.partition("_")
    return rest.replace("_", " ") if side in ("left", "right", "l", "r") and rest else name
