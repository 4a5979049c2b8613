"""Cache of results that depend only on a plan and a robot.

A study runs the same jump many times in every worker; its plan is checked and turned into a table
in the first of these runs only, and both are kept for later processes. What counts is the content of
plan and robot, not where they are kept, so a file that changes between two runs is checked anew.

A check takes longer than all else that loading a kept plan does. That a plan has passed is noted under a
hash of everything that decides it: all numbers of the plan, its task, the robot, the code of the check
and of the models that it uses, and the versions of the libraries that compute. So a plan that was
changed, by hand too, is checked anew. Only that a plan has passed is noted, in a folder of the user's
cache; a note that cannot be read or written costs time and nothing else.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

from ...files.cache import Cache
from ...mathematics.kept_arrays import Arrays, code_digest, kept_arrays
from ...robots.robot_description import RobotDescription
from ..task.plan import ARRAYS, PlannedJump
from .jump_table import JumpTable

FOLDERS = ("planner/checking", "planner/models", "planner/task", "robots", "mathematics")
"""The code that decides what the check finds."""


NOTES = Cache("checked")
"""Notes that a plan has passed: files with no content but their digest."""


def check_unless_noted(content: bytes, check: Callable[[], None]) -> None:
    """Check a plan, unless one of that content has passed the very same check before.

    Args:
        content: a digest of the plan and of the robot.
        check: raises an error if the plan does not pass; then nothing is noted.
    """
    note = hashlib.blake2b(content + _code(), digest_size=16).hexdigest()
    if NOTES.load(note) is None:
        check()
        NOTES.save(note, b"")


def _code() -> bytes:
    """Return a digest of the code of the check and of the versions of what computes."""
    return code_digest(*FOLDERS)


KEPT = 32
"""Number of results that are kept, of the plans used last."""

TABLE_FOLDERS = (*FOLDERS, "planner/library")
"""The code that decides on a table."""

_Result = TypeVar("_Result")


class ResultCache(Generic[_Result]):
    """The last results of a computation, by what they follow from."""

    def __init__(self) -> None:
        self._results: OrderedDict[Hashable, _Result] = OrderedDict()

    def get(self, key: Hashable, compute: Callable[[], _Result]) -> _Result:
        """Return the result for ``key``, computed if it is not kept. Nothing is kept of an error."""
        if key not in self._results:
            self._results[key] = compute()
        self._results.move_to_end(key)
        while len(self._results) > KEPT:
            self._results.popitem(last=False)
        return self._results[key]


_valid = ResultCache[None]()
_tables = ResultCache[JumpTable]()


def content(plan: PlannedJump, robot: RobotDescription) -> bytes:
    """Return a digest of all numbers of a plan, of its task, and of the robot."""
    digest = hashlib.blake2b(digest_size=16)
    for name in ARRAYS:
        array = getattr(plan, name)
        digest.update(f"{name} {array.dtype} {array.shape}".encode())
        digest.update(array.tobytes())
    for text in (repr(plan.flights), plan.task.model_dump_json(), robot.model_dump_json()):
        digest.update(text.encode())
    return digest.digest()


def require_valid_cached(plan: PlannedJump, robot: RobotDescription) -> None:
    """Check a plan as ``require_valid`` does, but only the first time for the same plan, robot and check, in any
    process.

    Raises:
        InvalidPlanError: the plan is not valid.
    """
    key = content(plan, robot)

    def check() -> None:
        from ..checking.validity import require_valid  # which a plan that has passed does without

        require_valid(plan, robot)

    _valid.get(key, lambda: check_unless_noted(key, check))


def cached_reference_table(
    plan: PlannedJump, robot: RobotDescription, stand_time: float
) -> JumpTable:
    """Return the table of ``reference_table``, which is made once. It is not to be written to."""
    key = content(plan, robot), stand_time

    def compute() -> Arrays:
        from .reference_table import reference_table

        return reference_table(plan, robot, stand_time).as_arrays()

    def make() -> JumpTable:
        decided_by = key[0] + repr(stand_time).encode() + code_digest(*TABLE_FOLDERS)
        return JumpTable.from_arrays(kept_arrays(decided_by, compute))

    return _tables.get(key, make)
