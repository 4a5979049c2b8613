"""Finds the tasks and plans that ship with aloft."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from ..task.task import TaskError


def shipped_graphs() -> Path:
    """The folder of the graphs that ship with aloft, with their ``tasks`` and ``plans``."""
    return Path(str(files(__package__.partition(".planner")[0]) / "graphs"))


def find_task(name: str, *folders: Path) -> Path:
    """The task's file of that name in the first folder that has it, or among the shipped graphs.

    Raises:
        TaskError: there is none; the message names the shipped ones.
    """
    shipped = shipped_graphs()
    for folder in (*folders, shipped):
        if (folder / name).is_file():
            return folder / name
    there = sorted(path.stem for path in (shipped / "tasks").glob("*.yaml"))
    raise TaskError(
        f"there is no task {name!r} beside the graph or among the shipped ones: "
        + ", ".join(f"tasks/{stem}.yaml" for stem in there)
    )
