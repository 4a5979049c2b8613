"""Finds the files and packages that a robot's description names.

No environment variable is read, so that the same graph finds the same robot: the package of ``package://`` is a
folder of that name above the file or beside one of these, or it is installed with Python.
"""

from __future__ import annotations

import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path

SCHEME = "package://"


def find_file(name: str, folder: Path) -> Path | None:
    """Return the file called ``name`` in a description that stands in ``folder``; None if there is none.

    A path is relative to the folder. ``package://NAME/PATH`` is looked for in the folder and every
    folder above it, where such a folder is called ``NAME`` or holds one; then among the shared
    files of installed Python packages.
    """
    name = name.removeprefix("file://")
    if not name.startswith(SCHEME):
        path = folder / name
        return path if path.is_file() else None
    package, _, rest = name.removeprefix(SCHEME).partition("/")
    return next((p for root in _roots(package, folder) if (p := root / rest).is_file()), None)


def located(name: str, folder: Path) -> str:
    """Return a file's name in a description, by which it is found from any folder.

    A package that Python has installed keeps its name, which serves other machines too.
    """
    if name.startswith(SCHEME) and find_file(name, Path(folder.root or "/")) is not None:
        return name
    path = find_file(name, folder)
    if path is None:
        return name if name.startswith(SCHEME) else str((folder / name).absolute())
    return str(path.resolve())


def find_package(package: str, folder: Path) -> Path | None:
    """Return the folder of a package that a description in ``folder`` names; None if there is none."""
    return next((root for root in _roots(package, folder) if root.is_dir()), None)


def _roots(package: str, folder: Path) -> Iterator[Path]:
    """Yield the folders in which a package may be, the nearest first."""
    here = folder.resolve()
    for above in (here, *here.parents):
        yield from (root for root in (above, above / package) if root.name == package)
    yield from (shared / package for shared in _shared())


def package_of(name: str) -> str:
    """Return the package that a ``package://`` name asks for; empty for a plain path."""
    if not name.startswith(SCHEME):
        return ""
    return name.removeprefix(SCHEME).partition("/")[0]


def _shared() -> list[Path]:
    """Return the folders in which installed packages keep shared files: ``share`` folders, then the packages
    themselves.
    """
    sites = [Path(sysconfig.get_path(kind)) for kind in ("purelib", "platlib")]
    shares = [site / "cmeel.prefix" / "share" for site in sites]
    return list(dict.fromkeys([*shares, Path(sys.prefix) / "share", *sites]))
