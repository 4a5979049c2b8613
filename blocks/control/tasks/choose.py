"""Finds the task classes for the list of tasks in a graph, with their gains."""

from __future__ import annotations

import difflib
import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ....runtime.language.errors import AloftError, UnknownBlockError
from ....runtime.language.parameters import Parameters
from ....runtime.language.registry import find_class
from .angular_momentum import AngularMomentum
from .contact_points import ContactPoints
from .linear_momentum import LinearMomentum
from .posture import Posture
from .task import Task, TaskChoice
from .torso_orientation import TorsoOrientation

OWN_TASKS: Mapping[str, type[Task[Any]]] = {
    kind.__name__: kind
    for kind in (ContactPoints, LinearMomentum, TorsoOrientation, AngularMomentum, Posture)
}
"""The tasks that a graph may choose by name, in the order of the default list."""

PHASE_KINDS = ("stand", "thrust", "landing")
"""The kinds of phases that have gains of their own."""


class TaskChoiceError(AloftError):
    """An entry of the list of tasks cannot be used; the message is one line."""


@dataclass(frozen=True)
class ChosenTask:
    """A task class, and the entry that chose it."""

    kind: type[Task[Any]]
    entry: TaskChoice

    def gains(self, phase: str, shared: Parameters) -> Parameters:
        """The task's gains in the phases called ``phase``; ``shared`` are the controller's gains.

        Raises:
            TaskChoiceError: the entry sets a gain that the task does not have, or a wrong value.
        """
        try:
            return self.entry.gains_of(self.kind, phase, shared)
        except ValidationError as error:
            first = error.errors()[0]
            gain = ".".join(map(str, first["loc"]))
            known = ", ".join(self.kind.Gains.model_fields) or "none"
            raise TaskChoiceError(
                f"task {self.entry.task}: gain {gain!r}: {first['msg']}; its gains are {known}"
            ) from error


def choose_tasks(
    entries: Sequence[str | TaskChoice], folders: Sequence[Path] = ()
) -> tuple[ChosenTask, ...]:
    """The tasks of a list, in its order.

    Args:
        folders: the folders in which a user's modules are searched for, in this order.

    Raises:
        TaskChoiceError: there is no such task, or it is not a task.
    """
    chosen = []
    for item in entries:
        entry = item if isinstance(item, TaskChoice) else TaskChoice(task=item)
        chosen.append(ChosenTask(_find_task(entry.task, folders), entry))
    return tuple(chosen)


def _find_task(name: str, folders: Sequence[Path]) -> type[Task[Any]]:
    if name in OWN_TASKS:
        return OWN_TASKS[name]
    if ":" not in name:
        nearest = difflib.get_close_matches(name, OWN_TASKS, n=1, cutoff=0.4)
        hint = f"did you mean {nearest[0]}? " if nearest else ""
        raise TaskChoiceError(
            f"there is no task called {name!r}; {hint}There are {', '.join(OWN_TASKS)}, and a task "
            "of your own is named module:Class"
        )
    found, failure = None, ""
    for folder in dict.fromkeys(folders) or (None,):
        try:
            found = find_class(name, folder)
            break
        except UnknownBlockError as error:
            failure = failure or str(error)
        except AloftError as error:
            raise TaskChoiceError(f"task {name}: {error}") from error
    if found is None:
        raise TaskChoiceError(f"task {name}: {failure}")
    if not (isinstance(found, type) and issubclass(found, Task)):
        raise TaskChoiceError(f"task {name}: {name.partition(':')[2]} does not derive from Task")
    if inspect.isabstract(found):
        missing = ", ".join(sorted(found.__abstractmethods__))
        raise TaskChoiceError(f"task {name}: the class does not define {missing}")
    return found
