"""The errors of the runtime, one class for each kind, and the exit codes of the command line."""

from __future__ import annotations

from enum import IntEnum
from importlib.util import find_spec
from typing import Any

from ...files.pip_line import pip_line


class ExitCode(IntEnum):
    """Exit code of the process."""

    SUCCESS = 0
    """The graph ran and its own criteria hold."""
    NOT_SUCCESSFUL = 1
    """The graph ran to its end, but a criterion of its own failed (a fall, a missed target)."""
    BAD_INPUT = 2
    """The graph, an override or the command line is wrong; nothing moved."""
    RUN_FAILED = 3
    """A block failed, a signal was not finite or a deadline policy stopped the run."""
    NOT_RECORDED = 4
    """The run itself went well, but its recording could not be written, or not all of it."""
    INTERRUPTED = 130
    """SIGINT: stopped cleanly, the robot in damping."""
    TERMINATED = 143
    """SIGTERM: stopped cleanly, the robot in damping."""


class AloftError(Exception):
    """The base of every error that aloft raises on purpose."""


class UnitError(AloftError, ValueError):
    """A unit's text cannot be read, or two units have different dimensions."""


class DeclarationError(AloftError, TypeError):
    """A block or a signal is declared wrongly in Python."""


class UnknownBlockError(AloftError, LookupError):
    """There is no block of that name; the message lists the nearest names."""


class BlockError(AloftError):
    """A block cannot go on; the block raises this with a message for the user."""


class MissingExtraError(AloftError):
    """A library is not installed that only an extra of aloft's brings."""


def need_extra(module: str, extra: str, what: str) -> None:
    """Say how to install what ``what`` is done with, before something imports it.

    Raises:
        MissingExtraError: there is no such module; the text has the line for pip.
    """
    try:
        found = find_spec(module) is not None
    except ValueError:  # it was imported in a way that left no specification
        found = True
    if not found:
        raise MissingExtraError(f"{what} needs the library {module}: {pip_line(extra)}")


class RunError(AloftError):
    """A run ended early; the error names the block, the tick and the reason."""

    def __init__(self, message: str, *, block: str = "", tick: int = -1) -> None:
        super().__init__(message)
        self.exit_code = ExitCode.RUN_FAILED
        """``BAD_INPUT`` where a block cannot be right before anything has moved."""
        self.block = block
        self.tick = tick
        self.record_tick = False
        """True if the tick is to be recorded all the same: its values are the reason."""
        self.where = ""
        """``file:line`` of the statement that raised what ended the run, where that is known."""
        self.traceback = ""
        """The whole traceback of what ended the run, as Python prints it."""

    def to_json(self) -> dict[str, Any]:
        """Return the error as plain data."""
        names = ("block", "tick", "where", "traceback")
        return {"message": str(self), **{name: getattr(self, name) for name in names}}
