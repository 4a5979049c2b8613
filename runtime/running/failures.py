"""Describes a block's failure in one line: block, method, error, and where it was raised."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager

from ..language.errors import AloftError, RunError
from ..language.stages import BlockSpec


def describe(error: BaseException) -> str:
    """The text of an error, with its type unless it was raised for users to read."""
    if isinstance(error, AloftError):
        return str(error)
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def place_of(error: BaseException) -> str:
    """``file:line`` of the statement that raised an error; empty where that is not known."""
    frames = traceback.extract_tb(error.__traceback__)
    return f"{frames[-1].filename}:{frames[-1].lineno}" if frames else ""


@contextmanager
def blame(spec: BlockSpec, what: str) -> Iterator[None]:
    """Turn whatever a block raises before a run into one ``RunError`` that names the block.

    The message begins with the block's place in the graph file, where it has one. An error that was
    not raised for users to read also says where in the code it was raised.

    Raises:
        RunError: something was raised inside.
    """
    try:
        yield
    except Exception as error:
        place = f"{spec.where}: " if spec.where is not None else ""
        reason = describe(error)
        if not isinstance(error, AloftError):
            reason = f"{' '.join(reason.split())} (at {place_of(error)})"
        raise RunError(
            f"{place}block '{spec.path}' failed in {what}: {reason}", block=spec.path
        ) from error
