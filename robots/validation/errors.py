"""Errors of a robot's description, the exception that carries all of them, and the description while it is checked."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from ...files import problems
from ...files.problems import listing

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class DescriptionError:
    """One error in the description of a robot.

    Attributes:
        path: where it is in the data, by keys and list indices, such as ``("links", 2, "mass")``.
            It may name a key that is missing; the place is then that of what should hold it.
        message: what is wrong, in one sentence that names the link, joint, foot or motor.
        expected: what may stand there.
        found: what does.
        fix: text to paste instead; empty where nothing can be proposed.
        line, column: the place in the file, counted from 1; zero where it is not known.
        file: the file of that place; empty where it is the error's.
    """

    path: Path
    message: str
    expected: str = ""
    found: str = ""
    fix: str = ""
    line: int = 0
    column: int = 0
    file: str = ""

    def lines(self) -> list[tuple[str, str]]:
        """Return the details under the message, as (label, text)."""
        rows = [("expected", self.expected), ("found", self.found), ("fix", self.fix)]
        return [(label, text) for label, text in rows if text]

    def text(self, file: str) -> str:
        """Return the fault as plain text of several lines, beginning with its place in the file."""
        file = self.file or file
        place = f"{file}:{self.line}:{self.column}" if self.line else file
        head = f"{place}: {self.message}"
        return "\n".join([head, *(f"    {label:<9}  {text}" for label, text in self.lines())])


class RobotError(ValueError):
    """A description that describes no robot; its text lists every error.

    Attributes:
        file: the file it was read from, as text; a name where there was no file.
        faults: every error, in the order of the file.
    """

    def __init__(self, file: str, errors: Iterable[DescriptionError]) -> None:
        self.file = file
        self.errors = tuple(
            sorted(
                errors,
                key=lambda description_error: (
                    description_error.file,
                    description_error.line,
                    description_error.column,
                ),
            )
        )
        count = len(self.errors)
        headline = f"{file}: {count} error{'s' if count != 1 else ''} in the robot's description"
        super().__init__(
            "\n".join(
                [*(description_error.text(file) for description_error in self.errors), headline]
            )
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return RobotError, (self.file, self.errors)


def nearest(name: str, legal: Iterable[str]) -> str:
    """Return the legal name most like ``name``; empty when none is alike."""
    return next(iter(problems.nearest(name, legal, 1)), "")


def number(value: float) -> str:
    """Return a number as it would be written in the file."""
    return f"{value:.6g}"


def vector(values: Iterable[float]) -> str:
    """Return a list of numbers as it would be written in the file."""
    return f"[{', '.join(number(value) for value in values)}]"


ElementType = TypeVar("ElementType", bound=BaseModel)


class Draft:
    """Data of a description, of which some may be unreadable, and the errors found in it.

    The checks look at the parts that can be read, so one wrong type hides nothing elsewhere.
    """

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data = data
        self.whole: BaseModel | None = None
        """The description, where all of it can be read."""
        self.errors: list[DescriptionError] = []

    def add(
        self, path: Path, message: str, expected: str = "", found: str = "", fix: str = ""
    ) -> None:
        """Note an error."""
        self.errors.append(DescriptionError(path, message, expected, found, fix))

    def unknown(self, path: Path, what: str, name: str, kind: str, legal: Sequence[str]) -> None:
        """Report a name that no link, joint or foot has."""
        if not legal:
            return  # That there are none at all is reported.
        right = nearest(name, legal)
        self.add(
            path, f"{what} is {name!r}, and there is no such {kind}", listing(legal), repr(name),
            right,
        )  # fmt: skip

    def elements(self, key: str, kind: type[ElementType]) -> list[tuple[int, ElementType]]:
        """Return the readable elements of the list under ``key``, each with its index."""
        if self.whole is not None:
            return list(enumerate(getattr(self.whole, key)))
        found = self.data.get(key)
        if not isinstance(found, Sequence) or isinstance(found, str):
            return []
        elements = ((k, _read(kind, element)) for k, element in enumerate(found))
        return [(k, element) for k, element in elements if element is not None]

    def part(
        self, kind: type[ElementType], key: str, name: str | None = None
    ) -> ElementType | None:
        """Return what lies under ``key``, or under ``name`` in the mapping there; None where it cannot be read."""
        if self.whole is not None:
            found = getattr(self.whole, key)
            part: ElementType | None = found if name is None else found[name]
            return part
        value = self.data.get(key)
        return _read(kind, value if name is None else dict(self.entries(key))[name])

    def entries(self, key: str) -> Iterator[tuple[str, Any]]:
        """Yield the entries of the mapping under ``key`` whose keys are text."""
        found = self.data.get(key)
        if isinstance(found, Mapping):
            yield from ((name, value) for name, value in found.items() if isinstance(name, str))

    def names(self, key: str) -> list[str]:
        """Return the names in the list under ``key``, also of elements that are unreadable otherwise."""
        found = self.data.get(key)
        if not isinstance(found, Sequence) or isinstance(found, str):
            return []
        named = (element.get("name") for element in found if isinstance(element, Mapping))
        return [name for name in named if isinstance(name, str)]


def _read(kind: type[ElementType], value: Any) -> ElementType | None:
    """Return the value as that part of a description; None where it cannot be read."""
    try:
        return kind.model_validate(value)
    except ValidationError:
        return None
