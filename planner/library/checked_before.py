"""Remembers, between processes, that a plan has passed the validity check.

A check takes longer than all else that loading a kept plan does. That a plan has passed is noted under a
hash of everything that decides it: all numbers of the plan, its task, the robot, the code of the check
and of the models that it uses, and the versions of the libraries that compute. So a plan that was
changed, by hand too, is checked anew. Only that a plan has passed is noted, in a folder of the user's
cache; a note that cannot be read or written costs time and nothing else.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

from ...mathematics.kept_arrays import code_digest
from ..task.whole_file import write_whole

FOLDERS = ("planner/checking", "planner/models", "planner/task", "robots", "mathematics")
"""The code that decides what the check finds."""


def noted_folder() -> Path:
    """Where it is noted that a plan has passed."""
    home = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(home) / "aloft" / "checked"


def unless_passed(content: bytes, check: Callable[[], None]) -> None:
    """Check a plan, unless one of that content has passed the very same check before.

    Args:
        content: a digest of the plan and of the robot.
        check: raises an error if the plan does not pass; then nothing is noted.
    """
    note = noted_folder() / hashlib.blake2b(content + _code(), digest_size=16).hexdigest()
    if note.is_file():
        return
    check()
    try:
        write_whole(note, b"")
    except OSError:
        return


def _code() -> bytes:
    """A digest of the code of the check and of the versions of what computes."""
    return code_digest(*FOLDERS)
