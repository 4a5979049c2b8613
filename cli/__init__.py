"""The command line, ``aloft VERB``. Every verb has a file here, and ``app`` puts them together; what they
need lies in ``shared``. Heavy imports are inside functions only.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
import threading
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import typer

__all__ = ["main", "make_app", "run_arguments"]

COLLECTED_AFTER = (400_000, 5, 5)
"""Numbers of objects after which Python looks for garbage among new ones, and of such passes among
older ones. By its own limits, which begin with 700, it would look a hundred times through classes
and functions that a start makes and that all stay. A check of a jump makes 100 000."""


def main() -> None:
    """Run the command line and end the process with one of ``ExitCode``."""
    try:
        run_arguments()
    except SystemExit as end:
        _end_at_once(end.code)
        raise


def _end_at_once(code: object) -> None:
    """End the process without taking apart what it has loaded, a twentieth of the time of a run, where nothing needs that:
    another thread, a profiler, or output that cannot be written.
    """
    watched = sys.gettrace() is not None or sys.getprofile() is not None
    if watched or threading.active_count() > 1 or not isinstance(code, int | None):
        return
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
        sys.stderr.flush()
    except (AttributeError, OSError, ValueError):
        return
    os._exit(code or 0)


def run_arguments() -> None:
    """Run the command line.

    Raises:
        SystemExit: it is done, with one of ``ExitCode``.
    """
    pages: tuple[list[str], ...] = (
        [],
        ["--help"],
        ["--version"],
    )  # these import neither Typer nor a verb
    if sys.argv[1:] in pages and "_ALOFT_COMPLETE" not in os.environ:
        _print_page()
        sys.exit(0)
    gc.set_threshold(*COLLECTED_AFTER)
    from ..processes.quick_imports import make_when_called, without_plugins

    without_plugins()
    make_when_called()
    from .app import main as run_command_line

    run_command_line()


def _print_page() -> None:
    """Print the version, or the list of all verbs."""
    if sys.argv[1:] == ["--version"]:
        from .. import __version__

        text = f"aloft {__version__}\n"
    else:
        from .verbs import help_page

        text = help_page()
    try:
        sys.stdout.write(text)
        sys.stdout.flush()
    except BrokenPipeError:  # `aloft --help | head`
        sys.stderr.close()


def make_app(verbs: Iterable[str] | None = None) -> typer.Typer:
    """Make the command line with those verbs, or with all; the files of others are not imported."""
    from .app import make_app

    return make_app(verbs)
