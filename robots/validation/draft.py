"""The description while it is examined: the parts that can be read, each with its place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from .faults import Path, RobotFault, listing, nearest

Part = TypeVar("Part", bound=BaseModel)


class Draft:
    """Data of a description, of which some may be unreadable, and the faults found in it.

    The checks look at the parts that can be read, so one wrong type hides nothing elsewhere.
    """

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data = data
        self.faults: list[RobotFault] = []

    def add(
        self, path: Path, message: str, expected: str = "", found: str = "", fix: str = ""
    ) -> None:
        """Note a fault."""
        self.faults.append(RobotFault(path, message, expected, found, fix))

    def unknown(self, path: Path, what: str, name: str, kind: str, legal: Sequence[str]) -> None:
        """Report a name that no link, joint or foot has."""
        if not legal:
            return  # That there are none at all is reported.
        right = nearest(name, legal)
        self.add(
            path, f"{what} is {name!r}, and there is no such {kind}", listing(legal), repr(name),
            right,
        )  # fmt: skip

    def parts(self, key: str, kind: type[Part]) -> list[tuple[int, Part]]:
        """The readable elements of the list under ``key``, each with its index."""
        found = self.data.get(key)
        if not isinstance(found, Sequence) or isinstance(found, str):
            return []
        parts = ((k, read(kind, element)) for k, element in enumerate(found))
        return [(k, part) for k, part in parts if part is not None]

    def entries(self, key: str) -> Iterator[tuple[str, Any]]:
        """The entries of the mapping under ``key`` whose keys are text."""
        found = self.data.get(key)
        if isinstance(found, Mapping):
            yield from ((name, value) for name, value in found.items() if isinstance(name, str))

    def names(self, key: str) -> list[str]:
        """The names in the list under ``key``, also of elements that are unreadable otherwise."""
        found = self.data.get(key)
        if not isinstance(found, Sequence) or isinstance(found, str):
            return []
        named = (element.get("name") for element in found if isinstance(element, Mapping))
        return [name for name in named if isinstance(name, str)]


def read(kind: type[Part], value: Any) -> Part | None:
    """The value as that part of a description; None where it cannot be read."""
    try:
        return kind.model_validate(value)
    except ValidationError:
        return None
