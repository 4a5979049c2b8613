"""Finds the tasks and plans that ship with aloft."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def shipped_folder() -> Path:
    """The folder of the graphs that ship with aloft, with their ``tasks`` and ``plans``."""
    return Path(str(files(__package__.partition(".planner")[0]) / "graphs"))


def find_task(name: str, *folders: Path) -> Path:
    """The task's file of that name in the first folder that has it, or among the shipped graphs.

    Raises:
        LookupError: there is none.
    """
    for folder in (*folders, shipped_folder()):
        if (folder / name).is_file():
            return folder / name
    raise LookupError(f"there is no task {name!r} beside the graph or among the shipped ones")


def shipped_tasks() -> list[str]:
    """The shipped tasks by the names that graphs give them, such as ``tasks/in_situ.yaml``."""
    return sorted(f"tasks/{path.name}" for path in (shipped_folder() / "tasks").glob("*.yaml"))
