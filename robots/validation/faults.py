"""What is wrong with the description of a robot, and the error that carries all of it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any

Path = tuple[str | int, ...]


@dataclass(frozen=True)
class RobotFault:
    """One fault in the description of a robot.

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
        """The details under the message, as (label, text)."""
        rows = [("expected", self.expected), ("found", self.found), ("fix", self.fix)]
        return [(label, text) for label, text in rows if text]

    def text(self, file: str) -> str:
        """The fault as plain text of several lines, beginning with its place in the file."""
        file = self.file or file
        place = f"{file}:{self.line}:{self.column}" if self.line else file
        head = f"{place}: {self.message}"
        return "\n".join([head, *(f"    {label:<9}  {text}" for label, text in self.lines())])


class RobotError(ValueError):
    """A description that describes no robot; its text lists every fault.

    Attributes:
        file: the file it was read from, as text; a name where there was no file.
        faults: every fault, in the order of the file.
    """

    def __init__(self, file: str, faults: Iterable[RobotFault]) -> None:
        self.file = file
        self.faults = tuple(
            sorted(faults, key=lambda fault: (fault.file, fault.line, fault.column))
        )
        count = len(self.faults)
        headline = f"{file}: {count} fault{'s' if count != 1 else ''} in the robot's description"
        super().__init__("\n".join([*(fault.text(file) for fault in self.faults), headline]))

    def __reduce__(self) -> tuple[Any, ...]:
        return RobotError, (self.file, self.faults)


def nearest(name: str, legal: Iterable[str]) -> str:
    """The legal name most like ``name``; empty when none is alike."""
    return next(iter(get_close_matches(name, list(legal), n=1, cutoff=0.6)), "")


def listing(names: Sequence[str], limit: int = 12) -> str:
    """Names in one line, cut off where there are many."""
    if len(names) > limit:
        return f"{', '.join(names[:limit])}, ... ({len(names)} in all)"
    return ", ".join(names) or "none"


def number(value: float) -> str:
    """A number as it would be written in the file."""
    return f"{value:.6g}"


def vector(values: Iterable[float]) -> str:
    """A list of numbers as it would be written in the file."""
    return f"[{', '.join(number(value) for value in values)}]"
