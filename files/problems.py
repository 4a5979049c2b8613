"""The load report: every problem of a graph at once, each with its place and a fix to paste."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from ..runtime.language.errors import AloftError, ExitCode

if TYPE_CHECKING:
    from rich.text import Text


class Position(NamedTuple):
    """A place in a file; lines and columns count from one. Printed as ``file:line:col``.

    Line zero stands for the file as a whole, or for an override.
    """

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file


class Code(StrEnum):
    """The kinds of problems, by the stable name that the JSON form carries."""

    FILE = "file"
    YAML = "yaml"
    DUPLICATE_KEY = "duplicate-key"
    UNKNOWN_KEY = "unknown-key"
    MISSING_KEY = "missing-key"
    WRONG_KIND = "wrong-kind"
    BAD_VALUE = "bad-value"
    MISPLACED_KEY = "misplaced-key"
    CYCLE = "cycle"
    TOO_LARGE = "too-large"
    DUPLICATE_BLOCK = "duplicate-block"
    BLOCK_NAME = "block-name"
    UNKNOWN_BLOCK = "unknown-block"
    BLOCK_IMPORT = "block-import"
    BLOCK_DECLARATION = "block-declaration"
    UNKNOWN_PARAMETER = "unknown-parameter"
    MISSING_PARAMETER = "missing-parameter"
    BAD_PARAMETER = "bad-parameter"
    UNUSED_PARAMETER = "unused-parameter"
    UNKNOWN_REFERENCE = "unknown-reference"
    UNKNOWN_INPUT = "unknown-input"
    UNWIRED_INPUT = "unwired-input"
    UNUSED_INPUT = "unused-input"
    WIRED_TWICE = "wired-twice"
    UNKNOWN_SOURCE = "unknown-source"
    FIELD_MISSING = "field-missing"
    SELECTION = "selection"
    DTYPE = "dtype"
    SHAPE = "shape"
    UNIT = "unit"
    FRAME = "frame"
    TRUTH = "truth"
    DELAY = "delay"
    INITIAL = "initial"
    LOOP = "loop"
    RATE = "rate"
    OFFSET = "offset"
    BACKGROUND = "background"
    DIMENSION = "dimension"
    ROBOT = "robot"
    MACHINE = "machine"
    AGE = "age"
    UNMET_REQUIREMENT = "unmet-requirement"
    OVERRIDE = "override"


MOST_SHOWN = 20
"""Problems of one kind that are printed."""

_UNREADABLE = (Code.YAML, Code.UNKNOWN_REFERENCE)


@dataclass(frozen=True)
class Problem:
    """One mistake: what is wrong, where (both ends of a wire), what was expected, and the fix."""

    code: Code
    message: str
    where: Position
    at: str = ""
    """The path in the graph: a block, ``block.input`` or ``block.parameter``."""
    other: str = ""
    """The other end: the source of a wire, the first of two duplicates."""
    other_where: Position | None = None
    expected: str = ""
    found: str = ""
    nearest: tuple[str, ...] = ()
    """Legal names that resemble the one found, the most similar first."""
    fix: str = ""

    def lines(self) -> list[tuple[str, str]]:
        """Return the details under the headline, as (label, text)."""
        other = self.other
        if self.other_where is not None:
            other = f"{other} at {self.other_where}" if other else str(self.other_where)
        rows = [
            ("at", self.at),
            ("other end", other),
            ("expected", self.expected),
            ("found", self.found),
            ("nearest", ", ".join(self.nearest)),
            ("fix", self.fix),
        ]
        return [(label, text) for label, text in rows if text]

    def text(self) -> str:
        """Return the problem as plain text of several lines."""
        head = f"{self.where}: {self.code}: {self.message}"
        return "\n".join([head, *(f"    {label:<9}  {text}" for label, text in self.lines())])

    def as_json(self) -> dict[str, Any]:
        """Return the problem as plain data."""
        return {
            "code": str(self.code),
            "message": self.message,
            **_place(self.where),
            "at": self.at,
            "other": {
                "path": self.other,
                **(_place(self.other_where) if self.other_where else {}),
            }
            if self.other or self.other_where
            else None,
            "expected": self.expected,
            "found": self.found,
            "nearest": list(self.nearest),
            "fix": self.fix,
        }


def _place(where: Position) -> dict[str, Any]:
    return {"file": where.file, "line": where.line, "column": where.column}


@dataclass(frozen=True)
class Report:
    """All problems of one graph, sorted by position; empty when the graph may run."""

    file: str
    problems: tuple[Problem, ...] = ()

    @property
    def ok(self) -> bool:
        """True if there is no problem."""
        return not self.problems

    def headline(self) -> str:
        """One line that counts the problems."""
        count = len(self.problems)
        return f"{self.file}: {count or 'no'} problem{'s' if count != 1 else ''}"

    def printed(self) -> tuple[list[Problem], list[str]]:
        """Return the problems to print, the first ``MOST_SHOWN`` of each kind, and a line on the
        others."""
        counts: dict[Code, int] = {}
        printed_problems = []
        for problem in self.problems:
            counts[problem.code] = counts.get(problem.code, 0) + 1
            if counts[problem.code] <= MOST_SHOWN:
                printed_problems.append(problem)
        more = [
            f"{count - MOST_SHOWN} more problems of the kind {code}; --json has all of them"
            for code, count in counts.items()
            if count > MOST_SHOWN
        ]
        return printed_problems, more

    def text(self) -> str:
        """Return the report as plain text; of very many problems of one kind the first ones."""
        printed_problems, more = self.printed()
        return "\n\n".join([*(p.text() for p in printed_problems), *more, self.headline()])

    def rich(self) -> Text:
        """Return the whole report for a terminal, in colour."""
        from rich.text import Text

        styles = {"expected": "green", "found": "red", "nearest": "cyan", "fix": "bold green"}
        out = Text()
        printed_problems, more = self.printed()
        for problem in printed_problems:
            out.append(f"{problem.where}: ", "bold")
            out.append(f"{problem.code}: ", "bold red")
            out.append(f"{problem.message}\n")
            for label, text in problem.lines():
                out.append(f"    {label:<9}  ", "dim")
                out.append(f"{text}\n", styles.get(label, ""))
            out.append("\n")
        for line in more:
            out.append(f"{line}\n\n")
        out.append(self.headline(), "bold green" if self.ok else "bold red")
        return out

    def as_json(self) -> dict[str, Any]:
        """Return the report as plain data: ``file``, ``ok``, ``count``, ``problems``."""
        return {
            "file": self.file,
            "ok": self.ok,
            "count": len(self.problems),
            "problems": [problem.as_json() for problem in self.problems],
        }


class LoadError(AloftError):
    """A graph has problems and cannot run; the text of the error is the whole report."""

    exit_code = ExitCode.BAD_INPUT

    def __init__(self, report: Report) -> None:
        super().__init__(report.text())
        self.report = report


class Problems:
    """Collects problems while a graph is loaded; a problem that is noted twice is kept once."""

    def __init__(self) -> None:
        self._found: dict[Problem, None] = {}

    def add(self, code: Code, message: str, where: Position, **details: Any) -> None:
        """Note a problem; ``details`` are the other fields of ``Problem``."""
        self._found.setdefault(Problem(code, message, where, **details))

    def extend(self, others: Problems) -> None:
        """Note all problems of another collection."""
        for problem in others._found:
            self._found.setdefault(problem)

    def __len__(self) -> int:
        return len(self._found)

    def report(self, file: str) -> Report:
        """All problems so far, sorted by position; those at one position in the order of finding.

        Where a place has a syntax error, its other problems follow from that and are left out.
        """
        unread = {p.where: p for p in self._found if p.code in _UNREADABLE}
        kept = [p for p in self._found if unread.get(p.where, p) is p]
        return Report(file, tuple(sorted(kept, key=lambda problem: problem.where)))


def nearest(
    name: str, legal: Iterable[str], count: int = 3, cutoff: float = 0.6
) -> tuple[str, ...]:
    """Return the legal names most similar to ``name``, the most similar first; empty if none is.

    Names less similar than ``cutoff``, which is from 0 to 1, are left out.
    """
    names = list(dict.fromkeys(legal))
    lowered: dict[str, str] = {}
    for candidate in names:
        lowered.setdefault(candidate.lower(), candidate)
    found = difflib.get_close_matches(name.lower(), list(lowered), n=count, cutoff=cutoff)
    return tuple(lowered[match] for match in found)


def fix_for_key(key: str, value: str, where: Position, right: str) -> str:
    """Return the fix to paste for a misspelt key: the corrected override, or the key with its
    value."""
    if not where.line:
        start, dot, rest = where.file.rpartition(f".{key}")
        return f"{start}.{right}{rest}" if dot else where.file
    return f"{right}: {value if len(value) <= 60 else '...'}"


def listing(names: Iterable[str], limit: int = 12) -> str:
    """Names in one line, cut off after ``limit`` names."""
    all_names = list(names)
    printed = ", ".join(all_names[:limit])
    if len(all_names) > limit:
        return f"{printed}, ... ({len(all_names)} in all)"
    return printed or "none"
