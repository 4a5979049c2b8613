"""Whether a block can work with the robot and the graph it is in: asked before anything is set up."""

from __future__ import annotations

from collections.abc import Mapping

from ...robots.description import RobotDescription
from ...robots.shipped import robot_names
from .block import Block, Context, Misfit, Need
from .parameters import Parameters

_NAMED: Mapping[Need, str] = {
    "robot": "a robot",
    "floating base": "a floating base",
    "feet": "feet",
    "imu": "an IMU",
    "switches": "contact switches",
}


def has(robot: RobotDescription, need: Need) -> bool:
    """Whether the robot has what a block needs."""
    match need:
        case "robot":
            return True
        case "floating base":
            return robot.base_joint == "floating"
        case "feet":
            return len(robot.feet) > 0
        case "imu":
            return robot.sensors.imu
        case "switches":
            return robot.sensors.switches and len(robot.contacts) > 0


def find_misfits(
    block_type: type[Block], params: Parameters, context: Context
) -> tuple[Misfit, ...]:
    """Everything about the robot and the graph that the block cannot work with.

    First what ``needs`` names and the robot lacks; only if it lacks nothing, what ``requires`` and
    ``requires_of_graph`` say. What the block's own code raises is a misfit too.
    """
    robot = context.robot
    if block_type.needs and robot is None:
        return (
            Misfit(
                "it needs a robot, and the graph names none",
                expected="a robot under the graph's key 'robot'",
                found="nothing",
                fix=" or ".join(f"robot: {name}" for name in robot_names()),
            ),
        )
    missing = [need for need in block_type.needs if robot is not None and not has(robot, need)]
    if missing:
        assert robot is not None
        return tuple(
            Misfit(f"it needs a robot with {_NAMED[need]}; {robot.name} {_lack(robot, need)}")
            for need in missing
        )
    try:
        return (
            *block_type.requires(params, robot),
            *block_type.requires_of_graph(params, context),
        )
    except Exception as error:  # noqa: BLE001  the block's own code must not hide other problems
        return (Misfit(f"asking what it requires failed: {type(error).__name__}: {error}"),)


def _lack(robot: RobotDescription, need: Need) -> str:
    """What the robot has instead, as the end of a sentence."""
    if need == "floating base":
        return f"has a {robot.base_joint} base"
    return "has none"
