"""Checks that the graph's robot is one that every block can work with."""

from __future__ import annotations

from ...robots.description import RobotDescription
from ..language.block import Misfit, Need
from .problems import Code, Problems
from .wire_check import Draft


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


def check_fit(draft: Draft, robot: RobotDescription | None, problems: Problems) -> None:
    """Report every misfit of the robot and one block."""
    assert draft.block_type is not None and draft.params is not None
    flat, needs = draft.flat, draft.block_type.needs
    if needs and robot is None:
        problems.add(
            Code.ROBOT,
            f"{flat.path} ({flat.use}) needs a robot, and the graph names none",
            flat.where,
            at=flat.path,
            fix="robot: bruce",
        )
        return
    missing = [need for need in needs if robot is not None and not has(robot, need)]
    for need in missing:
        assert robot is not None
        problems.add(
            Code.ROBOT,
            f"{flat.path} ({flat.use}) needs a robot with {_named(need)}; {robot.name} has none",
            flat.where,
            at=flat.path,
        )
    if missing:
        return
    for misfit in draft.block_type.requires(draft.params, robot):
        _report(draft, misfit, problems)


def _named(need: Need) -> str:
    words = {"floating base": "a floating base", "imu": "an IMU", "switches": "contact switches"}
    return words.get(need, need)


def _report(draft: Draft, misfit: Misfit, problems: Problems) -> None:
    flat = draft.flat
    where = flat.where
    for entry in flat.parameters:
        if entry.key == misfit.parameter:
            where = entry.value.where
    problems.add(
        Code.ROBOT,
        f"{flat.path} ({flat.use}): {misfit.message}",
        where,
        at=f"{flat.path}.{misfit.parameter}" if misfit.parameter else flat.path,
        expected=misfit.expected,
        found=misfit.found,
        fix=misfit.fix,
    )
