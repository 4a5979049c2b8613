"""Reads a task from its YAML file, and reports all of its mistakes at once."""

from __future__ import annotations

from pathlib import Path

from ...robots.description import find_robot
from .errors import TaskError
from .placed_file import read_placed
from .task import JumpTask, make_task
from .task_checks import contradictions


def read_task(path: str | Path) -> JumpTask:
    """The task in a YAML file; its name is the file's where it has none.

    Raises:
        TaskError: the file cannot be read, a value is wrong, or what is asked for contradicts
            itself or the robot; one line for each, with ``file:line:column``.
    """
    path = Path(path)
    source = read_placed(path, "rise: 15 cm")
    task = make_task({"name": path.stem, **source.values}, where=str(path), source=source)
    try:
        robot = find_robot(task.robot, path.parent)
    except (LookupError, ValueError) as error:
        raise TaskError(f"{source.place(['robot'])}: robot: {error.args[0]}") from error
    wrong = contradictions(task, robot)
    if wrong:
        raise TaskError(
            "\n".join(f"{source.place(key.split('.'))}: {key}: {text}" for key, text in wrong)
        )
    return task
