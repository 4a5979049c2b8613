"""Finds out, before anything is set up, whether a block can work with its robot and its graph."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from difflib import get_close_matches

from pydantic import BaseModel

from ...robots.description import RobotDescription, robot_names
from .block import Block, Context, Need, UnmetRequirement
from .parameters import Parameters
from .per_joint import PerJoint

_NAMED: Mapping[Need, str] = {
    "robot": "a robot",
    "floating base": "a floating base",
    "feet": "feet",
    "imu": "an IMU",
    "switches": "contact switches",
}


def has(robot: RobotDescription, need: Need) -> bool:
    """Return whether the robot has a property that a block needs."""
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


def fix_without_robot() -> str:
    """Return the line to write into a graph that needs a robot and names none."""
    first, *others = robot_names()
    return f"robot: {first}" + (f"  # or {', '.join(others)}" if others else "")


def unmet_needs(
    block_type: type[Block], robot: RobotDescription | None
) -> tuple[UnmetRequirement, ...]:
    """One unmet requirement for everything that the block needs of a robot and this robot does not have."""
    if not block_type.needs:
        return ()
    if robot is None:
        return (
            UnmetRequirement(
                "it needs a robot, and the graph names none",
                expected="a robot under the graph's key 'robot'",
                found="nothing",
                fix=fix_without_robot(),
            ),
        )
    return tuple(
        UnmetRequirement(f"it needs a robot with {_NAMED[need]}; {robot.name} {_lack(robot, need)}")
        for need in block_type.needs
        if not has(robot, need)
    )


def unmet_requirements(
    block_type: type[Block], params: Parameters, context: Context
) -> tuple[UnmetRequirement, ...]:
    """All unmet requirements between a block and the robot and graph it is in.

    First come the entries of ``needs`` that the robot lacks. If it lacks none, there follow values
    per joint that do not fit the robot's joints, and the unmet requirements that ``requires``
    returns. An error raised by the block's code is one too.
    """
    robot = context.robot
    unmet = unmet_needs(block_type, robot)
    if unmet:
        return unmet
    try:
        return (
            *(_per_joint_requirements(params, robot) if robot is not None else ()),
            *block_type.requires(params, context),
        )
    except Exception as error:  # noqa: BLE001  the block's own code must not hide other problems
        return (
            UnmetRequirement(f"asking what it requires failed: {type(error).__name__}: {error}"),
        )


def _per_joint_requirements(
    params: BaseModel, robot: RobotDescription, prefix: str = ""
) -> Iterator[UnmetRequirement]:
    """Patterns of ``PerJoint`` parameters that match no joint, and joints they give no value."""
    names = [joint.name for joint in robot.joints]
    for field in type(params).model_fields:
        value = getattr(params, field)
        if isinstance(value, PerJoint):
            for pattern in value.unmatched_patterns(robot):
                near = get_close_matches(pattern, [*names, *_ends(names)], 3)
                yield UnmetRequirement(
                    f"{prefix}{field}: {robot.name} has no joint {pattern!r}",
                    parameter=f"{prefix}{field}.{pattern}",
                    expected=f"names or patterns of its joints: {', '.join(names)}",
                    found=pattern,
                    nearest=tuple(near),
                    fix=near[0] if near else f"remove {pattern!r}",
                )
            missing = value.joints_without_value(robot)
            if missing:
                yield UnmetRequirement(
                    f"{prefix}{field} gives no value for {', '.join(missing)}",
                    parameter=f"{prefix}{field}",
                    expected="a value for every joint; '*' stands for all, and later entries win",
                    fix=f'"{missing[0]}": ...' if len(missing) == 1 else '"*": ..., first',
                )
        elif isinstance(value, BaseModel):
            yield from _per_joint_requirements(value, robot, f"{prefix}{field}.")


def _ends(names: Iterable[str]) -> tuple[str, ...]:
    """Patterns for the words that names end with: ``left_hip_yaw`` -> ``*_hip_yaw``, ``*_yaw``."""
    ends = (f"*{name[k:]}" for name in names for k, letter in enumerate(name) if letter == "_")
    return tuple(dict.fromkeys(ends))


def _lack(robot: RobotDescription, need: Need) -> str:
    """Describe what the robot has instead, as the end of a sentence for a message."""
    if need == "floating base":
        return f"has a {robot.base_joint} base"
    return "has none"
