"""The tables of a recording's file, taken out of its intact messages one at a time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...runtime.language.errors import AloftError
from .messages import ARROW, Content, Message, Scan, body_of, is_static, scan, table_of


class RecordingError(AloftError):
    """Raised for a file that is no recording or that is damaged. The message says what to do."""


class NoRunError(RecordingError):
    """Raised for a file of Rerun's that is no recording of a run, such as the motion of a plan."""


class DamagedError(RecordingError):
    """Raised for a recording with bytes that are not what was written; names the lost ticks."""


def scanned(path: Path) -> Scan:
    """Look through a file and verify its checksums.

    Raises:
        OSError: it cannot be read.
        RecordingError: it is not a Rerun file.
    """
    try:
        return scan(path)
    except ValueError:
        raise RecordingError(
            f"{path} is not a recording: it does not begin like a file of Rerun's"
        ) from None


def expect_intact(found: Scan) -> None:
    """Raise ``DamagedError`` if something in the file is not what was written."""
    if found.damage:
        places = "; ".join(map(str, found.damage[:3]))
        more = f"; and {len(found.damage) - 3} more" if len(found.damage) > 3 else ""
        raise DamagedError(
            f"{found.path} is damaged: {places}{more}. 'aloft log repair {found.path}' keeps all "
            "the rest"
        )


def tables(
    found: Scan, content: Content, entity: str, *, static: bool = False
) -> Iterator[tuple[str, Any]]:
    """Entity and Arrow record batch of all tables of an entity, or of those below ``entity/**``.

    Raises:
        RecordingError: a message holds something else than Rerun writes.
    """
    for _, name, batch in located(found, content):
        inside = entity.endswith("/**") and name.startswith(entity[:-2])
        if (inside or name == entity) and is_static(batch) == static:
            yield name, batch


def located(found: Scan, content: Content) -> Iterator[tuple[Message, str, Any]]:
    """Message, entity and record batch of all messages with that content."""
    with found.path.open("rb") as file:
        for message in found.of(content):
            try:
                name, batch = table_of(body_of(file, message))
            except ValueError as error:
                raise unreadable(found, message, error) from error
            yield message, name, batch


def unreadable(found: Scan, message: Message, error: Exception) -> RecordingError:
    """The error for a message that cannot be taken apart."""
    return RecordingError(
        f"{found.path} cannot be read at byte {message.place} ({error}); the file is damaged there"
    )


def tables_at(found: Scan, message: Message) -> tuple[str, Any]:
    """Entity and record batch of one message. Raises ``RecordingError``."""
    assert message.kind == ARROW
    with found.path.open("rb") as file:
        try:
            return table_of(body_of(file, message))
        except ValueError as error:
            raise unreadable(found, message, error) from error


def all_tables(path: Path, entity: str, *, static: bool = False) -> Iterator[tuple[str, Any]]:
    """Entity and record batch of all tables of an entity of any Rerun file; see ``tables``."""
    found = scanned(path)
    for message in found.messages:
        if message.kind == ARROW:
            name, batch = tables_at(found, message)
            inside = entity.endswith("/**") and name.startswith(entity[:-2])
            if (inside or name == entity) and is_static(batch) == static:
                yield name, batch
