"""Finds the description of a robot by name or file, reads it and checks it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from .description import RobotDescription
from .placed_yaml import PlacedYaml
from .validation import RobotError, RobotFault, find_faults

SHIPPED = Path(__file__).parent


def shipped_robots() -> list[str]:
    """The names of the robots that ship with aloft."""
    return sorted(path.stem for path in SHIPPED.glob("*/*.yaml") if path.stem == path.parent.name)


def find(name: str, folder: Path | None = None) -> RobotDescription:
    """See ``description.find_robot``."""
    if name.endswith((".yaml", ".yml")):
        path = (folder or Path()) / name
        if not path.is_file():
            raise LookupError(f"no robot description at {path}")
        return read_robot(path)
    path = SHIPPED / name / f"{name}.yaml"
    if not path.is_file():
        raise LookupError(f"no robot called {name!r}; there is {', '.join(shipped_robots())}")
    return _read_shipped(path)


@lru_cache(maxsize=16)
def _read_shipped(path: Path) -> RobotDescription:
    return read_robot(path)


def read_robot(path: Path) -> RobotDescription:
    """See ``description.read_description``."""
    text = PlacedYaml.read(path)
    data = text.data
    _complete(data)
    faults = [*text.faults, *find_faults(data)]
    if faults:
        raise RobotError(str(path), [text.placed(fault) for fault in faults])
    return RobotDescription.model_validate(data)


def _complete(data: object) -> None:
    """Fill in what a short description may leave out: one motor a joint, called as the joint."""
    if not isinstance(data, dict) or "transmission" in data:
        return
    joints = data.get("joints")
    if not isinstance(joints, list):
        return
    names = [j.get("name") if isinstance(j, dict) else None for j in joints]
    data["transmission"] = {
        "motors": [name for name in names if isinstance(name, str)],
        "joint_to_motor": [[float(i == k) for k in range(len(names))] for i in range(len(names))],
    }


__all__ = ["RobotError", "RobotFault", "find", "read_robot", "shipped_robots"]
