"""What graphs of earlier versions say otherwise: errors that give the new form, and old graphs read.

Since version 0.2 some blocks have other names, the actuator profile is said once for the graph
(``actuators: relaxed``) instead of at every block that uses it, and the paper's estimator, which was
the other ``law`` of ``blocks.StateEstimator``, is ``blocks.ComplementaryFilter``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..language.registry import MOVED
from .document import read_value
from .nodes import Node, plain, text_of
from .problems import Problems

PROFILE_PARAMETERS: Mapping[str, str] = {
    "hal.MujocoRobot": "profile",
    "blocks.WholeBodyController": "actuators",
    "blocks.Dynamics": "actuators",
    "blocks.SquatJumpReference": "actuators",
}
"""The parameter by which a block named its actuator profile before version 0.2, the most telling
block first."""


LEG_JOINTS = ("*_hip_yaw", "*_hip_pitch", "*_hip_roll", "*_knee", "*_ankle")
"""The joints of a leg that lists of gains were for before version 0.2, in their order."""
JOINT_GAINS = ("flight_stiffness", "flight_damping", "stance_stiffness", "stance_damping")
EARLIER_DEFAULTS: Mapping[str, Mapping[str, Any]] = {
    "blocks.JointPD": {
        "flight_stiffness": [40.0, 60.0, 60.0, 60.0, 15.0],
        "flight_damping": [1.0, 1.5, 1.5, 1.2, 0.3],
    },
    "blocks.SafetyMonitor": {"damping": 0.5},
}
"""What blocks did by default before version 0.2, when there was one robot. Its numbers are now in
the graphs of that robot."""


def fix_of_parameter(use: str, parameter: str, value: Node) -> str:
    """What to write for a parameter that a block had before version 0.2; empty for any other."""
    text = text_of(plain(value))
    if PROFILE_PARAMETERS.get(use) == parameter:
        return f"said once for the graph since 0.2, beside 'robot': actuators: {text}"
    if (use, parameter) == ("blocks.StateEstimator", "law"):
        if text == "complementary":
            return "use: blocks.ComplementaryFilter, a block of its own since 0.2"
        return f"leave it out: since 0.2 {use} is the weighted law only"
    return ""


def in_present_form(text: str, version: str = "") -> str:
    """The flattened graph that an earlier version has kept, as this version would have written it.

    A graph that is of this version already, or that cannot be read, comes back as it is.

    Args:
        version: of aloft, that kept it; empty where nobody knows. What version 0.1 did by default
            is then said in the graph.
    """
    problems = Problems()
    node = read_value(text, "a kept graph", problems)
    data = plain(node) if node is not None else None
    if len(problems) or not isinstance(data, dict) or not isinstance(data.get("blocks"), dict):
        return text
    blocks = [block for block in data["blocks"].values() if isinstance(block, dict)]
    profiles = _take_profiles(blocks)
    laws = [_take_law(block) for block in blocks]
    moved = [block for block in blocks if block.get("use") in MOVED]
    lists = [_name_joints(block, defaults=version.startswith("0.1.")) for block in blocks]
    if not moved and not profiles and not any(laws) and not any(lists):
        return text
    for block in moved:
        block["use"] = MOVED[block["use"]]
    if profiles and "actuators" not in data:
        data = _behind(data, "robot", "actuators", profiles[0])
    return _text(data)


def _take_profiles(blocks: list[Any]) -> list[str]:
    """Remove the profiles that blocks name; those of the most telling block come first."""
    found: list[str] = []
    for use, parameter in PROFILE_PARAMETERS.items():
        for block in blocks:
            given = block.get("with")
            if block.get("use") == use and isinstance(given, dict) and parameter in given:
                found.append(str(given.pop(parameter)))
    return found


def _name_joints(block: dict[str, Any], *, defaults: bool) -> bool:
    """Give gains in a list to the joints they were for, and say the ``defaults`` of version 0.1;
    whether anything changed."""
    use = str(block.get("use"))
    given = block.get("with")
    parameters = dict(given) if isinstance(given, dict) else {}
    if defaults:
        parameters = {**EARLIER_DEFAULTS.get(use, {}), **parameters}
    if use == "blocks.JointPD":
        for name in JOINT_GAINS:
            values = parameters.get(name)
            if isinstance(values, list) and len(values) == len(LEG_JOINTS):
                parameters[name] = dict(zip(LEG_JOINTS, values, strict=True))
    if parameters == (given or {}):
        return False
    block["with"] = parameters
    return True


def _take_law(block: dict[str, Any]) -> bool:
    """Give an estimator with the paper's law its present name; whether it named a law."""
    given = block.get("with")
    if block.get("use") != "blocks.StateEstimator" or not isinstance(given, dict):
        return False
    law = given.pop("law", None)
    if law == "complementary":
        block["use"] = "blocks.ComplementaryFilter"
        weighted = ("gate", "gate_growth", "support", "level_ground", "slow_rate")
        block["with"] = {key: value for key, value in given.items() if key not in weighted}
    return law is not None


def _behind(data: Mapping[str, Any], key: str, new_key: str, value: Any) -> dict[str, Any]:
    """The mapping with a new entry behind the one of that key, or at its start."""
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
