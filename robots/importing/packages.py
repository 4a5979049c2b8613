"""Finds the files that a robot's description names, also those under ``package://``.

No environment variable is read, so that the same graph finds the same robot: a package is a
folder of that name above the file or beside one of these, or it is installed with Python.
"""

from __future__ import annotations

import sys
import sysconfig
from pathlib import Path

SCHEME = "package://"


def find_file(name: str, folder: Path) -> Path | None:
    """The file called ``name`` in a description that stands in ``folder``; None if there is none.

    A path is relative to the folder. ``package://NAME/PATH`` is looked for in the folder and every
    folder above it, where such a folder is called ``NAME`` or holds one; then among the shared
    files of installed Python packages.
    """
    name = name.removeprefix("file://")
    if not name.startswith(SCHEME):
        path = folder / name
        return path if path.is_file() else None
    package, _, rest = name.removeprefix(SCHEME).partition("/")
    here = folder.resolve()
    for above in (here, *here.parents):
        for root in (above, above / package):
            if root.name == package and (root / rest).is_file():
                return root / rest
    return next((s / package / rest for s in _shared() if (s / package / rest).is_file()), None)


def package_of(name: str) -> str:
    """The package that a ``package://`` name asks for; empty for a plain path."""
    if not name.startswith(SCHEME):
        return ""
    return name.removeprefix(SCHEME).partition("/")[0]


def _shared() -> list[Path]:
    """Where installed packages keep shared files: ``share`` folders, then the packages themselves."""
    sites = [Path(sysconfig.get_path(kind)) for kind in ("purelib", "platlib")]
    shares = [site / "cmeel.prefix" / "share" for site in sites]
    return list(dict.fromkeys([*shares, Path(sys.prefix) / "share", *sites]))
