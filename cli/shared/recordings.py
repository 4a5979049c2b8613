"""Reads a recording that a verb was given, or says why it cannot."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ...runtime.language.errors import AloftError

if TYPE_CHECKING:
    from ...logs.file.reader import RecordedRun


def read(file: Path, *, damaged: bool = False) -> RecordedRun:
    """The recording. Raises ``AloftError`` if it cannot be read."""
    from ...logs.file import reader
    from ...logs.recording.place import part_of

    try:
        return reader.read(file, damaged=damaged)
    except FileNotFoundError:
        part = part_of(file)
        also = f"; {part} is there: it is being written, or was cut off" if part.exists() else ""
        raise AloftError(f"{file} cannot be read: there is no such file{also}") from None
    except OSError as error:
        raise AloftError(f"{file} cannot be read: {error.strerror or error}") from None
