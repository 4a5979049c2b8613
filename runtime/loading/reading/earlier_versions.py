"""Graphs of earlier versions: fixes that give the new form, and translation of recorded graphs.

Since version 0.2 some blocks have other names, the actuator profile is said once for the graph
(``actuators: relaxed``) instead of at every block that uses it, gains of joints are given by name
instead of by position, the paper's estimator, which was the other ``law`` of
``blocks.StateEstimator``, is ``blocks.ComplementaryFilter``, and some defaults follow from the
robot instead of being those of one robot.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ....robots.description import RobotDescription, find_robot, robot_names
from ...language.per_joint import by_name
from ...language.registry import MOVED
from ..problems import Problems
from .document import read_value
from .nodes import Node, plain, text_of

PROFILE_PARAMETERS: Mapping[str, str] = {
    "hal.MujocoRobot": "profile",
    "blocks.WholeBodyController": "actuators",
    "blocks.Dynamics": "actuators",
    "blocks.SquatJumpReference": "actuators",
}
"""The parameter by which a block named its actuator profile before version 0.2, the most telling
block first."""

GAINS_BY_POSITION: Mapping[str, tuple[str, ...]] = {
    "blocks.JointPD": ("flight_stiffness", "flight_damping", "stance_stiffness", "stance_damping"),
}
"""Parameters that were lists with one value for every joint of a leg."""

EARLIER_DEFAULTS: Mapping[str, Mapping[str, Any]] = {
    "blocks.JointPD": {
        "flight_stiffness": [40.0, 60.0, 60.0, 60.0, 15.0],
        "flight_damping": [1.0, 1.5, 1.5, 1.2, 0.3],
    },
    "blocks.SafetyMonitor": {"speed_limit": 60.0, "torque_limit": 200.0, "damping": 0.5},
    "blocks.WholeBodyController": {"force_max": 400.0},
    "blocks.JumpScore": {"load_share": 0.2, "fall_height": 0.12},
    "hal.MujocoRobot": {"drive_damping": 0.5},
}
"""Defaults of version 0.1 that have changed since."""


def fix_of_parameter(use: str, parameter: str, value: Node) -> str:
    """The fix for a parameter that a block had before version 0.2; empty for any other."""
    text = text_of(plain(value))
    if PROFILE_PARAMETERS.get(use) == parameter:
        return f"said once for the graph since 0.2, beside 'robot': actuators: {text}"
    if (use, parameter) == ("blocks.StateEstimator", "law"):
        if text == "complementary":
            return "use: blocks.ComplementaryFilter, a block of its own since 0.2"
        return f"leave it out: since 0.2 {use} is the weighted law only"
    return ""


def in_present_form(text: str, version: str = "", robot: RobotDescription | None = None) -> str:
    """Translate a flattened graph that an earlier version has recorded into this version's form.

    Only a graph recorded by version 0.1, or one with names that were removed since, is changed.

    Args:
        text: the graph; one that cannot be read is returned unchanged.
        version: the version of aloft that recorded it, where that is known.
        robot: the graph's robot, which gives the joint names for gains that were listed by
            position; by default the shipped robot that the graph names.
    """
    problems = Problems()
    node = read_value(text, "a kept graph", problems)
    data = plain(node) if node is not None else None
    if len(problems) or not isinstance(data, dict) or not isinstance(data.get("blocks"), dict):
        return text
    blocks = [block for block in data["blocks"].values() if isinstance(block, dict)]
    if not version.startswith("0.1.") and not any(map(_is_early, blocks)):
        return text
    for block in blocks:
        block["use"] = MOVED.get(str(block.get("use")), block.get("use"))
        if not isinstance(block.get("with"), dict):
            block["with"] = {}
    robot = robot or _robot_of(data)
    profiles = list(_take_profiles(blocks))
    for block in blocks:
        _split_estimators(block)
        given = block["with"]
        for name, value in EARLIER_DEFAULTS.get(block["use"], {}).items():
            given.setdefault(name, value)
        for name in GAINS_BY_POSITION.get(block["use"], ()):
            if robot is not None and isinstance(given.get(name), list):
                given[name] = by_name(given[name], robot) or given[name]
    if profiles:
        data = _behind(data, "robot", "actuators", profiles[0])
    return _text(data)


def _robot_of(data: Mapping[str, Any]) -> RobotDescription | None:
    """The robot that a graph names, if it is one of the shipped robots."""
    name = data.get("robot")
    return find_robot(name) if name in robot_names() else None


def _is_early(block: Mapping[str, Any]) -> bool:
    """Whether a block has a name or a parameter that version 0.2 removed."""
    use, given = str(block.get("use")), block.get("with")
    early = {"blocks.StateEstimator": "law", **PROFILE_PARAMETERS}
    if not isinstance(given, dict):
        return use in MOVED
    by_position = any(isinstance(given.get(k), list) for k in GAINS_BY_POSITION.get(use, ()))
    return use in MOVED or early.get(use) in given or by_position


def _take_profiles(blocks: list[Any]) -> Iterator[str]:
    """Remove the profiles that blocks name and yield them, the most telling block's first."""
    for use, parameter in PROFILE_PARAMETERS.items():
        for block in blocks:
            if block["use"] == use and parameter in block["with"]:
                yield str(block["with"].pop(parameter))


def _split_estimators(block: Any) -> None:
    """Name the estimator: two were one block before, with a parameter ``law`` to choose one."""
    if block["use"] != "blocks.StateEstimator":
        return
    if block["with"].pop("law", "weighted") == "complementary":
        block["use"] = "blocks.ComplementaryFilter"
        weighted = ("gate", "gate_growth", "support", "level_ground", "slow_rate")
        block["with"] = {k: value for k, value in block["with"].items() if k not in weighted}


def _behind(data: Mapping[str, Any], key: str, new_key: str, value: Any) -> dict[str, Any]:
    """The mapping with a new entry after the entry ``key``, or at the start if that is missing."""
    result: dict[str, Any] = {} if key in data else {new_key: value}
    for each, old in data.items():
        result[each] = old
        if each == key:
            result[new_key] = value
    return result


def _text(data: Mapping[str, Any]) -> str:
    """The graph as YAML, one line for each block."""
    lines = [f"{key}: {text_of(value)}" for key, value in data.items() if key != "blocks"]
    lines.append("blocks:")
    lines += [f"  {path}: {text_of(block)}" for path, block in data["blocks"].items()]
    return "\n".join(lines) + "\n"
