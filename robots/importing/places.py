"""Where a fault of an imported description stands: in its YAML, or in the URDF or MJCF file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ..validation import RobotFault
from .raw_model import RawModel
from .urdf_text import XmlFile

TAGS = {"links": ("link", "body"), "joints": ("joint", "joint")}
"""The elements of a URDF and of MJCF that describe a part of a description."""


def written_path(fault: RobotFault, data: Mapping[str, Any]) -> tuple[str | int, ...]:
    """The path of a fault as a short YAML has it: links and joints by name, contacts by foot."""
    path = fault.path
    if len(path) > 1 and path[0] == "contacts" and isinstance(path[1], int):
        # Contact points of a short YAML are in its feet.
        feet = [foot["name"] for foot in data["feet"]]
        foot = data["contacts"][path[1]]["foot"]
        return ("feet", feet.index(foot)) if foot in feet else path
    if len(path) > 1 and path[0] in TAGS and isinstance(path[1], int):
        return (path[0], str(data[path[0]][path[1]]["name"]), *path[2:])
    return path


def placed_in_model(fault: RobotFault, data: Mapping[str, Any], model: RawModel) -> RobotFault:
    """The fault with the line of the link or joint in the URDF or MJCF file, if it is one's."""
    path = written_path(fault, data)
    line = column = 0
    if len(path) > 1 and path[0] in TAGS:
        tag = TAGS[str(path[0])][not model.is_urdf]
        line, column = XmlFile(model.path).place(tag, str(path[1]))
    return replace(fault, path=path, file=str(model.path), line=line, column=column)
