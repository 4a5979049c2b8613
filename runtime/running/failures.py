"""Describes a block's failure in one line: block, method, error, and where it was raised."""

from __future__ import annotations

import sysconfig
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ..language.errors import AloftError, ExitCode, RunError

if TYPE_CHECKING:
    from ..language.stages import BlockSpec


class Hang(BaseException):
    """Raised by the watchdog inside a call that does not return; no ``except Exception`` stops it."""

    def __str__(self) -> str:
        return "it did not return in time"


def describe(error: BaseException) -> str:
    """Format an error, with its type unless it was raised for users to read."""
    if isinstance(error, AloftError | Hang):
        return str(error)
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def location_of(error: BaseException) -> str:
    """``file:line`` of the user's statement that raised an error; empty where that is not known.

    An error raised inside a library, such as NumPy, is placed where the block called it.
    """
    return location_of_frames(traceback.extract_tb(error.__traceback__))


def location_of_frames(frames: traceback.StackSummary) -> str:
    """``file:line`` of the innermost statement that is the user's; empty if there is no frame."""
    own = [frame for frame in frames if not _is_installed(frame.filename)]
    best = (own or frames)[-1:]
    return f"{best[0].filename}:{best[0].lineno}" if best else ""


def _is_installed(file: str) -> bool:
    """Return whether a file belongs to Python, to an installed package or to the runtime itself."""
    return file.startswith(INSTALLED) or "site-packages" in Path(file).parts


def locate(error: RunError) -> RunError:
    """Note in an error where its cause was raised, and the whole traceback; give it back."""
    cause = error.__cause__
    if cause is not None and not error.traceback:
        error.where = location_of(cause)
        error.traceback = "".join(traceback.format_exception(cause))
    return error


INSTALLED = (
    "<",
    sysconfig.get_path("stdlib"),
    sysconfig.get_path("platstdlib"),
    str(Path(__file__).parents[1]),
)


@contextmanager
def blame(spec: BlockSpec, what: str) -> Iterator[None]:
    """Turn whatever a block raises before a run into one ``RunError`` that names the block.

    The message begins with the block's place in the graph file, where it has one. An error that was
    not raised for users to read also has the place in the code where it was raised.

    Raises:
        RunError: something was raised inside.
    """
    try:
        yield
    except Exception as error:
        place = f"{spec.where}: " if spec.where is not None else ""
        reason = describe(error)
        if not isinstance(error, AloftError):
            reason = f"{' '.join(reason.split())} (at {location_of(error)})"
        failure = RunError(
            f"{place}block '{spec.path}' failed in {what}: {reason}", block=spec.path
        )
        failure.__cause__ = error
        if not isinstance(
            error, AloftError | OSError
        ):  # a mistake in the block, not of its surroundings
            failure.exit_code = ExitCode.BAD_INPUT
        raise locate(failure) from error
