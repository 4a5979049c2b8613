"""Checks the settings of the graph as a whole: rate, duration, robot, actuators, dimensions and clock."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path

from ....files.nodes import Entry, ScalarNode, kind, plain
from ....files.problems import Code, Position, Problems, listing, nearest
from ....robots.description import (
    ROBOT_FILES,
    RobotDescription,
    RobotError,
    find_robot,
    robot_names,
)
from ...language.flat_graph import FlatGraph
from ...language.requirements import fix_without_robot
from ...language.stages import ClockSpec, RecordingSpec
from ..reading.graph_file import ClockKeys, RecordingKeys, read_section
from ..reading.written import read_quantity


@dataclass(frozen=True)
class Settings:
    """The settings of the graph; one is ``None`` if it is not given or has a problem."""

    base_rate: float | None = None
    ticks: int | None = None
    robot: RobotDescription | None = None
    robot_known: bool = True
    """False if the graph names a robot that could not be read."""
    dimensions: Mapping[str, int] = field(default_factory=dict)
    clock: ClockSpec = field(default_factory=ClockSpec)
    folder: Path = Path()
    """Folder of the graph's file."""
    recording: RecordingSpec = field(default_factory=RecordingSpec)


def read_settings(graph: FlatGraph, problems: Problems) -> Settings:
    """All settings of a graph; what is wrong is reported to ``problems``."""
    rate = None
    if graph.rate is not None:
        rate = read_quantity(graph.rate.value, "rate", "Hz", problems)
    elif not graph.incomplete:
        problems.add(
            Code.MISSING_KEY,
            "the graph does not say its rate",
            Position(graph.file, 1, 1),
            expected="the base rate, which all blocks' rates divide",
            fix="rate: 500 Hz",
        )
    ticks = None
    if graph.duration is not None:
        duration = read_quantity(graph.duration.value, "duration", "s", problems)
        if duration is not None and rate is not None:
            ticks = max(1, round(duration * rate))
    robot = read_robot(graph, problems)
    return Settings(
        rate,
        ticks,
        robot,
        robot is not None or graph.robot is None,
        _read_dimensions(graph, robot, problems),
        _read_clock(graph, problems),
        graph.folder,
        _read_recording(graph, problems),
    )


def _read_dimensions(
    graph: FlatGraph, robot: RobotDescription | None, problems: Problems
) -> dict[str, int]:
    found = dict(robot.dimensions) if robot else {}
    for entry in graph.dimensions or ():
        value = plain(entry.value)
        if not isinstance(value, int) or isinstance(value, bool) or value < 1:
            problems.add(
                Code.DIMENSION,
                f"dimension {entry.key!r} cannot be {kind(entry.value)}",
                entry.value.where,
                at=f"dimensions.{entry.key}",
                expected="a whole number from 1",
                found=kind(entry.value),
            )
        elif found.get(entry.key, value) != value:
            assert robot is not None
            problems.add(
                Code.DIMENSION,
                f"dimension {entry.key!r} is {value}, but robot {robot.name} has "
                f"{found[entry.key]}",
                entry.value.where,
                at=f"dimensions.{entry.key}",
                other="robot",
                other_where=graph.robot.key_where if graph.robot else None,
                expected=str(found[entry.key]),
                found=str(value),
                fix=f"remove {entry.key!r}",
            )
        else:
            found[entry.key] = value
    return found


def _read_clock(graph: FlatGraph, problems: Problems) -> ClockSpec:
    if graph.clock is None:
        return ClockSpec()
    return ClockSpec(**read_section(graph.clock, "clock", ClockKeys, problems))


def _read_recording(graph: FlatGraph, problems: Problems) -> RecordingSpec:
    if graph.recording is None:
        return RecordingSpec()
    return RecordingSpec(**read_section(graph.recording, "recording", RecordingKeys, problems))


def read_robot(graph: FlatGraph, problems: Problems) -> RobotDescription | None:
    """Read the robot that the graph names, with the named actuator profile in use.

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
            _report_description_errors(error, node.where, problems)
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


def _report_description_errors(error: RobotError, where: Position, problems: Problems) -> None:
    """Report every error of a robot's description at its place in the robot's file."""
    for description_error in error.errors:
        problems.add(
            Code.ROBOT,
            description_error.message,
            Position(
                description_error.file or error.file,
                description_error.line,
                description_error.column,
            ),
            at=".".join(map(str, description_error.path)),
            other="robot",
            other_where=where,
            expected=description_error.expected,
            found=description_error.found,
            fix=description_error.fix,
        )


def _with_actuators(
    robot: RobotDescription | None, entry: Entry, problems: Problems
) -> RobotDescription | None:
    """Return the robot with the actuator profile that the graph names in use."""
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
