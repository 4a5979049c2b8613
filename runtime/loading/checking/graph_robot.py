"""Reads the robot of a graph and selects the actuator profile that the graph names."""

from __future__ import annotations

from difflib import get_close_matches

from ....robots.description import RobotDescription, RobotError, find_robot, robot_names
from ...language.fit import fix_without_robot
from ...language.stages import Position
from ..flattening.flat import ROBOT_FILES, FlatGraph
from ..problems import Code, Problems, listing, nearest
from ..reading.nodes import Entry, ScalarNode, kind


def read_robot(graph: FlatGraph, problems: Problems) -> RobotDescription | None:
    """The robot that the graph names, with the named actuator profile in use.

    Returns ``None`` where the graph names no robot, and where the robot itself has a problem. Every
    fault of the robot's description is reported.
    """
    robot = None
    if graph.robot is not None:
        robot = _find(graph.robot, graph, problems)
        if robot is None:
            return None
    if graph.actuators is not None:
        return _with_actuators(robot, graph.actuators, problems)
    return robot


def _find(entry: Entry, graph: FlatGraph, problems: Problems) -> RobotDescription | None:
    node = entry.value
    name = node.value if isinstance(node, ScalarNode) else None
    if not isinstance(name, str):
        message = f"robot cannot be {kind(node)}"
    else:
        try:
            return find_robot(name, graph.robot_folder)
        except LookupError as error:
            message = str(error)
        except RobotError as error:
            _report_faults(error, node.where, problems)
            return None
        except Exception as error:  # noqa: BLE001  such as a name that no file can have
            reason = " ".join(str(error).split())
            message = f"robot {name} cannot be read: {type(error).__name__}: {reason}"
    is_file = isinstance(name, str) and name.endswith(ROBOT_FILES)
    similar = get_close_matches(str(name), robot_names(), 3) if not is_file else []
    problems.add(
        Code.ROBOT,
        message,
        node.where,
        at="robot",
        expected=f"one of {listing(robot_names())}; or a YAML, URDF or MJCF file, relative to the "
        "graph",
        found=kind(node),
        nearest=tuple(similar),
        fix=f"robot: {similar[0]}" if similar else "",
    )
    return None


def _report_faults(error: RobotError, where: Position, problems: Problems) -> None:
    """Report every fault of a robot's description at its place in the robot's file."""
    for fault in error.faults:
        problems.add(
            Code.ROBOT,
            fault.message,
            Position(fault.file or error.file, fault.line, fault.column),
            at=".".join(map(str, fault.path)),
            other="robot",
            other_where=where,
            expected=fault.expected,
            found=fault.found,
            fix=fault.fix,
        )


def _with_actuators(
    robot: RobotDescription | None, entry: Entry, problems: Problems
) -> RobotDescription | None:
    """The robot with the actuator profile that the graph names in use."""
    node = entry.value
    name = node.value if isinstance(node, ScalarNode) else None
    if robot is None:
        problems.add(
            Code.ROBOT,
            "the graph chooses an actuator profile, and names no robot that has it",
            entry.key_where,
            at="actuators",
            fix=f"remove 'actuators', or name the robot: {fix_without_robot()}",
        )
        return None
    if isinstance(name, str) and name in robot.profiles:
        return robot.with_profile(name)
    similar = nearest(name, robot.profiles) if isinstance(name, str) else ()
    problems.add(
        Code.ROBOT,
        f"{robot.name} has no actuator profile {name!r}"
        if isinstance(name, str)
        else f"actuators cannot be {kind(node)}",
        node.where,
        at="actuators",
        expected=f"an actuator profile of {robot.name}: {listing(robot.profiles)}",
        found=kind(node),
        nearest=similar,
        fix=f"actuators: {(*similar, *robot.profiles)[0]}" if robot.profiles else "",
    )
    return robot
