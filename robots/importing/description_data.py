"""A full description as plain data, from a URDF or MJCF file and the short YAML that adds to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..parts import Joint, Link
from ..robot_description import RobotDescription
from ..validation import RobotFault
from .build import Built, build
from .looks import link_looks
from .overlay import Overlay
from .rated_profile import rated_profile
from .raw_model import RawModel
from .read_model import read_model


@dataclass(frozen=True)
class Imported:
    """What an import gives: the description's ``data``, the ``faults`` of the YAML, what the file
    lacks or what is approximated in ``notes``, and the ``model`` and tree it was made from."""

    data: dict[str, Any]
    faults: list[RobotFault]
    notes: list[str]
    model: RawModel
    built: Built


def import_robot(path: Path, added: Mapping[str, Any]) -> Imported:
    """The description that a URDF or MJCF file and a YAML's content make together.

    Raises:
        RobotError: the file cannot be read at all.
    """
    model = read_model(path)
    overlay = Overlay(added)
    overlay.check_keys(list(RobotDescription.model_fields))
    notes = list(model.notes)
    joints = [joint.name for body in model.bodies.values() for joint in body.joints]
    welded = [*overlay.welded(joints), *model.mimics]
    base_joint = added.get("base_joint", "")
    built = build(model, welded, base_joint if isinstance(base_joint, str) else "")
    overlay.change("links", built.links, Link)
    overlay.change("joints", built.joints, Joint)
    feet, contacts = overlay.feet(built)
    names = [joint["name"] for joint in built.joints]
    data: dict[str, Any] = {
        "name": added.get("name", model.name),
        "text": added.get("text", ""),
        "base": built.base,
        "base_joint": added.get("base_joint", built.base_joint),
        "links": built.links,
        "joints": built.joints,
        "feet": feet,
        "contacts": contacts,
        "transmission": added.get("transmission") or own_motors(names),
        "profiles": overlay.profiles(rated_profile(built.raw_joints, model.is_urdf, notes)),
        "points": overlay.points(built),
    }
    if "points" not in added and data["base_joint"] == "floating":
        base = next(link for link in built.links if link["name"] == built.base)
        data["points"] = {"torso_com": [built.base, list(base["com"])]}
    bodies = {name: body.look for name, body in model.bodies.items()}
    data["looks"] = link_looks(bodies, built.frames, path.parent)
    known = {name: angle for name, angle in model.pose.items() if name in names}
    data["standing"] = known
    data["sensors"] = {"imu": data["base_joint"] != "fixed", "switches": bool(contacts)}
    for key in ("profile", "sensors", "standing", "held", "looks"):
        if key in added:
            data[key] = added[key]
    _stand_within_limits(data)
    return Imported(data, overlay.faults, notes, model, built)


def _stand_within_limits(data: dict[str, Any]) -> None:
    """Let joints that cannot be at zero, and that nobody says more of, stand at their near limit."""
    standing, held = data["standing"], data.get("held") or {}
    if not isinstance(standing, Mapping) or not isinstance(held, Mapping):
        return
    added = {}
    for joint in data["joints"]:
        limits = joint["limits"]
        known = joint["name"] in standing or joint["name"] in held
        if known or not isinstance(limits, list) or len(limits) != 2:
            continue
        if all(isinstance(value, (int, float)) for value in limits) and limits[0] < limits[1]:
            angle = min(max(0.0, limits[0]), limits[1])
            if angle != 0.0:
                added[joint["name"]] = angle
    data["standing"] = {**standing, **added}


def own_motors(joints: list[str]) -> dict[str, Any]:
    """The transmission of a robot in which every joint has a motor of its own, called as it is."""
    size = range(len(joints))
    return {
        "motors": list(joints),
        "joint_to_motor": [[float(row == column) for column in size] for row in size],
    }
