"""Applies changes to a task from a file, and names tasks that have no name."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...robots.description import find_robot
from .errors import TaskError
from .placed_file import read_placed
from .read_task import read_task
from .task import JumpTask, make_task
from .task_checks import contradictions

INSTEAD = ("rise", "take_off_speed")
"""Two ways to say one thing: a change of one of them takes the place of the other."""


def changed_task(path: Path, changes: Mapping[str, Any]) -> JumpTask:
    """The task in a file with some of its parameters changed, also single ones inside ``margins``,
    ``weights`` and ``knots``.

    Raises:
        TaskError: the file cannot be read as a task, or a change is wrong, or they contradict each
            other; lines about a change begin with ``task: key:``.
    """
    read_task(path)  # what is wrong in the file itself is said with its line
    values = dict(read_placed(path, "rise: 15 cm").values)
    for name in INSTEAD:
        if any(changes.get(other) is not None for other in INSTEAD if other != name):
            values.pop(name, None)
    task = make_task({**_merged(values, changes), "name": changes.get("name", "")})
    wrong = contradictions(task, find_robot(task.robot, path.parent))
    if wrong:
        raise TaskError("\n".join(f"task: {key}: {text}" for key, text in wrong))
    return spoken_name(task)


def _merged(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    found = dict(old)
    for key, value in new.items():
        inner = found.get(key)
        if isinstance(inner, Mapping) and isinstance(value, Mapping):
            found[key] = _merged(inner, value)
        else:
            found[key] = value
    return found


def spoken_name(task: JumpTask) -> JumpTask:
    """The task, called by what it asks for if it has no name: ``12 cm high, 20 cm ahead``."""
    return task if task.name else task.model_copy(update={"name": spoken(task)})


def spoken(task: JumpTask) -> str:
    """What a task asks for, in a few words."""
    if task.jumps or task.repeat:
        return f"{len(task.hops())} jumps"
    told = []
    if task.rise is not None:
        told.append(f"{_cm(task.rise)} high")
    if task.take_off_speed is not None:
        told.append(f"{task.take_off_speed:g} m per s up")
    pairs = (
        (task.distance_x, "ahead", "back"),
        (task.distance_y, "to the left", "to the right"),
        (task.landing_height, "up", "down"),
    )
    told += [f"{_cm(abs(value))} {plus if value > 0 else minus}" for value, plus, minus in pairs
             if value]  # fmt: skip
    for angle, what in ((task.twist, "turned"), (task.rotation, "over")):
        if angle:
            told.append(f"{what} {math.degrees(angle):.4g} deg")
    return ", ".join(told) or "jump"


def _cm(length: float) -> str:
    return f"{100.0 * length:.4g} cm"
