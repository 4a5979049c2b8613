"""What to do where a recording cannot be written, by the reason that the system gives."""

from __future__ import annotations

import errno
import os
from pathlib import Path

ELSEWHERE = "--record FILE writes elsewhere, --no-record writes none"


def remedy(number: int, path: Path | None, elsewhere: str = ELSEWHERE) -> str:
    """The fix for an error with the system's ``number`` (as in ``errno``) at ``path``, in words;
    ``elsewhere`` says how to do without that place."""
    if number in (errno.ENOSPC, errno.EDQUOT):
        return f"make room{_room(path)}, or {elsewhere}"
    if number == errno.EFBIG:
        return f"allow larger files{_limit()} (`ulimit -f`), or {elsewhere}"
    if number in (errno.EACCES, errno.EPERM, errno.EROFS):
        return f"allow writing there, or {elsewhere}"
    return elsewhere


def cause_of(error: BaseException) -> int:
    """The system's number of what went wrong, also where a clearer error stands for it; or zero."""
    return getattr(error.__cause__ or error, "errno", None) or 0


def _room(path: Path | None) -> str:
    """How much room is left where ``path`` lies."""
    if path is None:
        return ""
    folder = path.absolute().parent
    try:
        found = os.statvfs(folder)
    except (OSError, AttributeError):  # the second on Windows
        return ""
    return f" on the disk of {folder} ({found.f_bavail * found.f_frsize / 1e6:.1f} MB are free)"


def _limit() -> str:
    try:
        import resource
    except ImportError:  # not on Windows
        return ""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return "" if limit == resource.RLIM_INFINITY else f" than {limit / 1e6:.3g} MB"
