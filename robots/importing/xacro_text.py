"""Expands a xacro file into the URDF that it stands for, with the library `xacro` and without ROS.

``$(find PACKAGE)`` is looked for where ``package://PACKAGE`` is, in ``package_files.find_package``. Arguments have
their defaults: a file whose arguments must be given is expanded by hand, ``xacro FILE NAME:=VALUE > robot.urdf``.
"""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

from ...files.pip_line import pip_line
from ..validation import DescriptionError, RobotError
from .package_files import find_package

XACRO = ".xacro"
"""The ending of xacro files; often it follows ``.urdf``."""


class _NoPackage(Exception):
    """Error: there is no package of that name; its argument is the name."""


def expand_xacro(path: Path) -> str:
    """Return the URDF that the file stands for.

    Raises:
        RobotError: the library is not installed, a package is not found, or xacro cannot expand the file.
    """
    from unittest.mock import patch  # imports asyncio, which `aloft check` has no need of

    try:
        import xacro
        import xacro.substitution_args as substitution
    except ImportError:
        raise _error(
            path,
            "xacro files need the library xacro",
            "a URDF, MJCF or YAML file, or the library",
            pip_line("xacro"),
        ) from None

    def find(package: str) -> str:
        found = find_package(package, path.parent)
        if found is None:
            raise _NoPackage(package)
        return str(found)

    said = io.StringIO()
    try:
        # The library asks ROS for packages, which is not there; it has no other way to be told.
        with patch.object(substitution, "_eval_find", find), contextlib.redirect_stderr(said):
            return str(xacro.process_file(str(path)).toprettyxml(indent="  "))
    except Exception as error:  # the library raises whatever the expressions in the file do
        missing = _missing(error)
        if missing:
            raise _error(
                path,
                f"there is no package {missing}, which the file looks for",
                f"a folder {missing} above or beside the file, or a Python package that brings it",
            ) from error
        what = " ".join(str(error).split()) or type(error).__name__
        raise _error(
            path, f"xacro cannot expand this: {what}", "a file that xacro expands"
        ) from error


def _missing(error: BaseException | None) -> str:
    """Return the package that was not found, if this is why it failed."""
    while error is not None:
        if isinstance(error, _NoPackage):
            return str(error)
        error = error.__cause__ or error.__context__ or getattr(error, "exc", None)
    return ""


def _error(path: Path, message: str, expected: str, fix: str = "") -> RobotError:
    return RobotError(str(path), [DescriptionError((), message, expected, "", fix)])
