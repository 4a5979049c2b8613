"""Keeps plans by their tasks. A task's plan is taken from the library, or solved from the nearest plan and kept."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...files.cache import cache_root, trusted_file
from ...robots.description import RobotDescription
from ..task.files import PlanError
from ..task.plan import (
    InvalidPlanError,
    PlanFileError,
    PlannedJump,
    motor_load,
    read_plan,
    task_of_header,
    write_plan,
)
from ..task.task import JumpTask, JumpTaskError


def shipped_folder() -> Path:
    """Return the folder of the graphs that ship with aloft, with their ``tasks`` and ``plans``."""
    return Path(__file__).parents[2] / "graphs"


def find_task(name: str, *folders: Path) -> Path:
    """Return the task's file of that name in the first folder that has it, or among the shipped graphs.

    Raises:
        LookupError: there is none.
    """
    for folder in (*folders, shipped_folder()):
        if (folder / name).is_file():
            return folder / name
    raise LookupError(f"there is no task {name!r} beside the graph or among the shipped ones")


def shipped_tasks() -> list[str]:
    """Return the shipped tasks by the names that graphs give them, such as ``tasks/in_situ.yaml``."""
    return sorted(f"tasks/{path.name}" for path in (shipped_folder() / "tasks").glob("*.yaml"))


SHIPPED = shipped_folder() / "plans"
"""The plans that come with aloft; ``make plans`` makes them anew."""

INVALID = "invalid"
"""The folder, within a library's, of plans that failed the validity check."""

SCALES = {
    "rise": 0.05, "take_off_speed": 0.3, "distance_x": 0.1, "distance_y": 0.1, "twist": 0.5,
    "landing_height": 0.05, "step_edge": 0.2, "rotation": 1.0, "squat_time": 0.2,
    "thrust_time": 0.1, "flight_time": 0.1, "landing_time": 0.2, "contact_time": 0.2, "effort": 0.1, "friction": 0.2,
    "foot_clearance": 0.02, "leg_clearance": 0.02,
}  # fmt: skip
"""Change of each parameter [its unit] that counts as a distance of 1 between two tasks."""

ALIKE = 2.0
"""Greatest distance between two tasks at which the plan of one is evidence for the other."""

Solver = Callable[[JumpTask, RobotDescription, PlannedJump | None], PlannedJump]
"""Maker of a plan of a task, from another plan where one is given."""


def user_folder() -> Path:
    """Return the folder of a user's own plans; for a user without a home, one that is not there."""
    return (cache_root() or Path(os.devnull)) / "plans"


def task_distance(first: JumpTask, second: JumpTask) -> float | None:
    """Return the distance between two tasks, in units of ``SCALES``; ``None`` where one cannot start from the other,
    because something else than those parameters differs.
    """
    alike = set(JumpTask.model_fields) - {"name", "recipe", *SCALES}
    if any(getattr(first, name) != getattr(second, name) for name in alike):
        return None
    return _scaled_distance(first.__dict__, second.__dict__)


def _scaled_distance(first: Mapping[str, Any], second: Mapping[str, Any]) -> float | None:
    """Return the distance between two tasks in the parameters of ``SCALES``, by their names."""
    total = 0.0
    for name, scale in SCALES.items():
        one, other = first.get(name), second.get(name)
        if (one is None) != (other is None):
            return None
        if one is not None and other is not None:
            total += ((one - other) / scale) ** 2
    return float(np.sqrt(total))


def _other_parameters(task: Mapping[str, Any]) -> dict[str, Any]:
    """Return what must be the same in a task, as plain data, for a start from its plan; absent values are left out."""
    given = {name: x for name, x in task.items() if name not in {"name", "recipe", *SCALES}}
    left: dict[str, Any] = _without_none(given)
    return left


def _without_none(data: Any) -> Any:
    if isinstance(data, list):
        return [_without_none(x) for x in data]
    if not isinstance(data, dict):
        return data
    return {name: _without_none(x) for name, x in data.items() if x is not None}


def kept_name(task: JumpTask, robot: RobotDescription) -> str:
    """Return the name of a task's file: its name, for people, and its hash."""
    return f"{readable_name(task.name) or 'jump'}-{task.hash(robot)}.npz"


def readable_name(name: str) -> str:
    """Return a name as a part of a file's name."""
    return re.sub(r"[^A-Za-z0-9_.+]+", "_", name).strip("_")


def names_of(robot: RobotDescription) -> dict[str, list[str]]:
    """Return the names of the columns in a plan's file."""
    return {
        "joints": [joint.name for joint in robot.joints],
        "feet": [foot.name for foot in robot.feet],
        "contacts": [contact.name for contact in robot.contacts],
        "motors": list(robot.transmission.motors),
    }


class PlanLibrary:
    """The plans of one robot: those in ``folder``, which new ones are added to, and behind them
    those in other folders, by default the shipped ones.

    Without a ``folder`` the shipped plans come first, and the user's own folder takes what is new:
    what lies in a cache never changes what a shipped task does. A plan is looked up by its task's hash, so a plan never stands for a task it was not made for.
    Files are written as a whole or not at all; any number of processes may use one folder.
    """

    def __init__(
        self,
        robot: RobotDescription,
        folder: Path | None = None,
        others: tuple[Path, ...] = (SHIPPED,),
    ) -> None:
        self.robot = robot
        self.folder = user_folder() if folder is None else folder
        self._folders = (*others, self.folder) if folder is None else (self.folder, *others)

    @property
    def folders(self) -> tuple[Path, ...]:
        """Folders that are searched for plans, in that order."""
        return self._folders

    def path_of(self, task: JumpTask) -> Path | None:
        """Return the file of the plan of exactly this task, or ``None``."""
        return next(self._files(task.hash(self.robot)), None)

    def _files(self, task_hash: str = "*") -> Iterator[Path]:
        """Yield the files that may be read, by folders and names: in the user's own they must be this user's only."""
        for folder in self._folders:
            own = folder.is_relative_to(user_folder())
            for path in sorted(folder.glob(f"*-{task_hash}.npz")):
                if not own or trusted_file(path):
                    yield path

    def attempt(self, task: JumpTask, solve: Solver | None = None) -> PlannedJump:
        """Return a plan of a task, valid or not, with its report, which is made anew.

        As ``plan``, but one that fails the validity check is kept too, in a folder of its own
        where ``plan`` and everybody else never look: it must be asked for in this way.

        Raises:
            JumpTaskError, PlanFileError, PlanError: as ``plan``.
        """
        from ..checking.validity import checked  # a graph is checked and run without it

        invalid = PlanLibrary(self.robot, self.folder / INVALID, ())
        found = self.find(task) or invalid.find(task)
        if found is not None:
            return checked(found, self.robot)
        try:
            return self.plan(task, solve)[0]
        except InvalidPlanError as error:
            invalid.add(error.plan)
            return error.plan

    def hashes(self) -> frozenset[str]:
        """Return the hashes of all tasks that have a file, in one look at the folders."""
        return frozenset(path.stem.rpartition("-")[2] for path in self._files())

    def find(self, task: JumpTask) -> PlannedJump | None:
        """Return the plan of exactly this task, or ``None``.

        Of the user's own folder, a damaged file and one that holds another task's plan count as none.

        Raises:
            PlanFileError: a file elsewhere is such; the message names it.
        """
        path = self.path_of(task)
        if path is None:
            return None
        try:
            plan = read_plan(path)
            if plan.task.hash(self.robot) != task.hash(self.robot):
                raise PlanFileError(f"{path} holds the plan of another task")
            return plan
        except PlanFileError as error:
            if path.parent == user_folder():
                return None
            raise PlanFileError(
                f"{error}; put the file back, or remove it to have the task planned anew"
            ) from error

    def load_of(self, task: JumpTask) -> dict[str, float] | None:
        """Return the motor load of a task's kept plan, as ``motor_load`` has it; ``None`` where there is no such plan
        or its file is damaged. Nothing else of the file is read.
        """
        path = self.path_of(task)
        if path is None:
            return None
        try:
            with np.load(path, allow_pickle=False) as file:
                return motor_load(file["time"], file["joint_torque"], self.robot)
        except Exception:  # noqa: BLE001  # a damaged archive raises nearly anything; `find` says so
            return None

    def nearest(self, task: JumpTask) -> tuple[PlannedJump, float] | None:
        """Return the valid plan of the nearest task that can be started from, and how far it is."""
        # The files hold whole tasks, so plain data is compared: to make a task of each takes longer
        # than to plan one.
        wanted = task.resolved(self.robot).model_dump(mode="json")
        others = _other_parameters(wanted)
        found = []
        for path, header in self.headers():
            kept = header.get("task") if isinstance(header, dict) else None
            if not isinstance(kept, dict) or _other_parameters(kept) != others:
                continue
            try:
                distance = _scaled_distance(wanted, kept)
            except TypeError:  # a damaged header
                continue
            if distance is not None:
                found.append((distance, str(path)))
        found.sort()
        plan = self._first_valid(name for _, name in found)
        if plan is None:
            return None
        return plan, next(d for d, name in found if plan.task.hash(self.robot) in name)

    def _first_valid(self, names: Iterable[str]) -> PlannedJump | None:
        """Return the first of these files that holds a valid plan of the task that it is named after."""
        for name in names:
            try:
                plan = read_plan(name)
            except PlanFileError:
                continue
            if plan.valid and plan.task.hash(self.robot) in name:
                return plan
        return None

    def farthest(self, task: JumpTask, parameter: str, modest: float) -> PlannedJump | None:
        """Return the valid plan that goes farthest among those of tasks like this one but for ``parameter``, which lies
        between ``modest`` and the task's value; other parameters may be ``ALIKE`` apart.
        """
        asked = getattr(task, parameter)
        found = []
        for path, header in self.headers():
            kept = header.get("task") if isinstance(header, dict) else None
            if not isinstance(kept, dict):
                continue
            value = kept.get(parameter)
            if not isinstance(value, float) or not 0.0 < (value - modest) / (asked - modest) < 1.0:
                continue
            there = task.model_copy(update={parameter: value}).resolved(self.robot)
            wanted = there.model_dump(mode="json")
            if _other_parameters(wanted) != _other_parameters(kept):
                continue
            distance = _scaled_distance(wanted, kept)
            if distance is not None and distance <= ALIKE:
                found.append((-abs(value - modest), distance, str(path)))
        return self._first_valid(name for _, _, name in sorted(found))

    def tasks(self) -> Iterator[tuple[Path, JumpTask]]:
        """Yield every kept plan's file and task, in the order of their names; broken files are left out.

        Only the header of each file is read.
        """
        for path, header in self.headers():
            try:
                yield path, task_of_header(header)
            except (KeyError, TypeError, JumpTaskError):
                continue

    def headers(self) -> Iterator[tuple[Path, dict[str, Any]]]:
        """Yield every file with its header; broken files are left out."""
        for path in self._files():
            header = _header(path)
            if header is not None:
                yield path, header

    def prune(self, tasks: Iterable[JumpTask]) -> list[Path]:
        """Remove from this library's own folder every plan of a task that is none of these. Plans
        for robots that none of these tasks names stay."""
        wanted, robots = set[str](), set[str | None]([None])
        for task in tasks:
            wanted.add(task.hash(self.robot))
            robots.add(task.robot)
        others = [
            path
            for path in sorted(self.folder.glob("*-*.npz"))
            if path.stem.rpartition("-")[2] not in wanted and _robot_of(path) in robots
        ]
        for path in others:
            path.unlink(missing_ok=True)
        return others

    def add(self, plan: PlannedJump) -> Path:
        """Keep a plan, which replaces any of the same task in this folder."""
        path = self.folder / kept_name(plan.task, self.robot)
        write_plan(path, plan, names_of(self.robot))
        for other in self.folder.glob(f"*-{plan.task.hash(self.robot)}.npz"):
            if other != path:
                other.unlink(missing_ok=True)
        return path

    def plan(
        self, task: JumpTask, solve: Solver | None = None, *, anew: bool = False
    ) -> tuple[PlannedJump, bool]:
        """Return a valid plan of a task, and whether it was kept already.

        The exact plan where it is kept; else solved, from the nearest plan if there is one and
        from nothing if that fails, checked, and kept. ``anew`` looks for no kept plan. One in the
        user's own folder that fails the check is planned anew: an older version may have kept it.

        Raises:
            JumpTaskError: what is asked for contradicts itself or the robot.
            PlanFileError: the kept plan's file is damaged.
            PlanError: the task cannot be planned.
            InvalidPlanError: it can, but the plan fails the validity check; it is not kept.
        """
        from .validation_cache import require_valid_cached

        kept = None if anew else self.find(task)
        if kept is not None:
            try:
                require_valid_cached(kept, self.robot)
            except InvalidPlanError:
                path = self.path_of(task)
                if path is None or path.parent != user_folder():
                    raise
            else:
                return kept, True
        near = None if anew else self.nearest(task)
        plan = solve_and_check(task, self.robot, near[0] if near else None, solve)
        try:
            self.add(plan)
        except OSError:
            if self.folder != user_folder():
                raise
            # a home that is missing or read-only: planned again the next time
        return plan, False


_headers: dict[Path, tuple[tuple[int, int, int], dict[str, Any] | None]] = {}
"""The headers that this process has read, with the state of their files then."""


def _header(path: Path) -> dict[str, Any] | None:
    """Return the header of a plan's file, not to be changed; ``None`` if it is broken. It is read again only where the
    file was replaced.
    """
    try:
        found = path.stat()
    except OSError:
        return None
    state = (found.st_mtime_ns, found.st_size, found.st_ino)
    if path not in _headers or _headers[path][0] != state:
        try:
            with np.load(path, allow_pickle=False) as file:
                _headers[path] = (state, json.loads(str(file["header"])))
        except Exception:  # noqa: BLE001  # a damaged archive raises nearly anything
            _headers[path] = (state, None)
    return _headers[path][1]


def _robot_of(path: Path) -> str | None:
    """Return the robot that a plan's file is for; ``None`` where the file cannot be read."""
    try:
        return read_plan(path).task.robot
    except PlanFileError:
        return None


def solve_and_check(
    task: JumpTask,
    robot: RobotDescription,
    warm_start: PlannedJump | None = None,
    solve: Solver | None = None,
    *,
    refine: bool = True,
) -> PlannedJump:
    """Return a valid plan of a task with its report; a warm start that leads nowhere is tried without.

    With ``refine`` a plan that fails the check because its intervals are too long is solved again on
    finer ones.

    Raises:
        JumpTaskError, PlanError, InvalidPlanError: as ``PlanLibrary.plan``.
    """
    from ..checking.validity import checked, require_valid
    from ..solving.solve import ROUNDS, relaxable
    from ..task.read_task import require_consistent

    require_consistent(task, robot)
    make = solve or solve_task
    if warm_start is not None:
        try:
            plan = checked(make(task, robot, warm_start), robot)
        except PlanError:
            pass
        else:
            if plan.valid:
                return plan
    plan = checked(make(task, robot, None), robot)
    for _ in range(ROUNDS if refine else 0):
        if plan.valid or not relaxable(plan):
            break
        try:
            plan = checked(make(task, robot, plan), robot)
        except PlanError:
            break
    if not plan.valid:
        require_valid(plan, robot)
    return plan


def solve_task(
    task: JumpTask, robot: RobotDescription, warm_start: PlannedJump | None
) -> PlannedJump:
    """Return the planner."""
    from ..solving.solve import solve_jump

    return solve_jump(task, robot, warm_start=warm_start)


__all__ = ["PlanLibrary", "solve_and_check", "task_distance"]
