"""Names that stand inside files of others: recordings, plans, FMUs, robots, exports.

Whoever made such a file chose them. A name is used as a path only through ``inside``, which keeps it in
a folder of ours. A path in the user's own graph is no such name: it counts from the graph's folder.
"""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath

from ..runtime.language.errors import AloftError


class UnsafeNameError(AloftError, ValueError):
    """Raised for a name that would lead out of its folder; the message shows the name."""


def inside(folder: Path, name: str) -> Path:
    """Return the path that ``name`` has in ``folder``.

    Args:
        folder: where the file belongs, made for it or the file's own.
        name: as it stands in a file of somebody else's, with ``/`` between its parts.

    Raises:
        UnsafeNameError: it is empty, absolute, climbs (``..``), has a backslash, a drive or a
            control character, or is below a link that leads elsewhere.
    """
    if not is_relative_name(name):
        raise UnsafeNameError(
            f"the name {name!r} leads out of its folder: expected a relative name without '..', "
            "backslashes and control characters"
        )
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise UnsafeNameError(f"the name {name!r} leads out of its folder through a link")
    return path


def is_relative_name(name: str) -> bool:
    """Return whether a name stays in whatever folder it is put into, but for links there."""
    parts = PurePosixPath(name).parts
    return bool(
        parts
        and not name.startswith("/")
        and ".." not in parts
        and "\\" not in name
        and not PureWindowsPath(name).drive
        and all(c.isprintable() for c in name)
    )


def is_file_name(name: str) -> bool:
    """Return whether a name can be that of one file, in whatever folder."""
    return is_relative_name(name) and "/" not in name
