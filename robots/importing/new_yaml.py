"""A first short YAML for a URDF or MJCF file."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from ..robot_description import RobotDescription
from ..validation import RobotError, find_faults
from .description_data import Imported, import_robot
from .fit_to_ground import fit_to_ground
from .guess_feet import guess_feet
from .write_yaml import yaml_text


def new_yaml(file: Path, target: Path) -> tuple[str, list[str]]:
    """The text of the YAML to be written to ``target``, and what the file lacks.

    Raises:
        RobotError: the file describes no robot.
    """
    bare = import_robot(file, {})
    feet = guess_feet(bare.model, bare.built) if bare.built.base_joint == "floating" else []
    content: dict[str, Any] = {"name": target.stem, "feet": feet}
    imported = import_robot(file, content)
    faults = find_faults(imported.data)
    if faults:
        raise RobotError(str(file), _placed(imported, faults))
    robot = RobotDescription.model_validate(imported.data)
    robot, more = fit_to_ground(robot, False, imported.model.pose)
    notes = [*imported.notes, *more]
    name = os.path.relpath(file, target.parent)
    return yaml_text(Path(name).as_posix(), robot, feet, notes), notes


def _placed(imported: Imported, faults: Any) -> list[Any]:
    from .places import placed_in_model

    return [placed_in_model(fault, imported.data, imported.model) for fault in faults]
