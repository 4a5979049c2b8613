"""Count docstrings that begin with a relative clause, and list ``Args:`` that document no argument.

    python lab/count_docstrings.py              the counts, folder by folder, and every place
    python lab/count_docstrings.py --json       the same for other programs

A docstring of a value names the quantity and its unit; of a function, it begins with a verb. "What the
motors give" and "By how much it turns" do neither. ruff's D401 holds the verbs of functions. All Python
files that git tracks are read, tests excepted; nothing is imported.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
RELATIVE = re.compile(
    r"(?:(?:In|On|At|By|For|From|To|Of|With|Under|Through|As)\s+)?"
    r"(?:what|how|whether|where|who|whom|whose|which|when|why|that|whatever|whoever)\b"
    r"|(?:By|Those)\b|The (?:thing|one)s? (?:that|which)\b",
    re.IGNORECASE,
)
"""Beginnings of a docstring that is a relative clause, or hides one behind an empty noun."""
DOCUMENTED = re.compile(r"([*`]*\w[\w`*, ]*?)(?:\s*\([^)]*\))?:(?:\s|$)")
"""Entry of a section ``Args:``, its names before the colon."""
Documented = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


class Docstring(NamedTuple):
    """A docstring with its place; ``arguments`` are the names that it may document, ``None`` if any."""

    path: str
    line: int
    text: str
    arguments: set[str] | None

    @property
    def is_one_line(self) -> bool:
        return "\n" not in self.text.strip()

    @property
    def place(self) -> str:
        return f"{self.path}:{self.line}"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--json", action="store_true", help="print JSON")
    arguments = parser.parse_args()
    found = [each for path, text in tracked().items() for each in docstrings(path, text)]
    relative = [each for each in found if is_relative(each.text)]
    one_line = [each for each in relative if each.is_one_line]
    longer = [each for each in relative if not each.is_one_line]
    stale = stale_arguments(found)
    if arguments.json:
        report = {
            "one_line": len(one_line),
            "longer": len(longer),
            "places": {each.place: first_line(each.text) for each in relative},
            "stale_args": stale,
        }
        json.dump(report, sys.stdout, indent=1)
        print()
        return
    for each in relative:
        print(f"{each.place}: {first_line(each.text)}")
    for line in stale:
        print(line)
    folders = Counter(each.path.split("/")[0] if "/" in each.path else "." for each in relative)
    for folder, count in folders.most_common():
        print(f"{count:6} {folder}")
    print(f"{len(one_line)} docstrings of one line begin with a relative clause")
    print(f"{len(longer)} longer ones do")
    print(f"{len(stale)} names in sections Args are no arguments")


def tracked() -> dict[str, str]:
    """Read the Python files that git tracks, without those of tests, by path."""
    command = ["git", "ls-files", "*.py"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    paths = [name for name in names.split() if "tests" not in name.split("/")]
    return {name: (ROOT / name).read_text("utf-8") for name in paths if (ROOT / name).exists()}


def docstrings(path: str, text: str) -> list[Docstring]:
    """Find the docstrings of a file: of modules, classes and functions, and below assignments."""
    found = []
    nodes: list[ast.AST] = [ast.parse(text)]
    for node in nodes:  # a list that grows by the statements in each
        for field in ("body", "handlers", "orelse", "finalbody", "cases"):
            nodes += getattr(node, field, ())
        body: list[ast.stmt] = getattr(node, "body", [])
        for before, statement in zip((None, *body), body, strict=False):
            if not isinstance(statement, ast.Expr) or not isinstance(statement.value, ast.Constant):
                continue
            if not isinstance(statement.value.value, str):
                continue
            owner = node if before is None else before
            if isinstance(owner, (Documented, ast.Assign, ast.AnnAssign)):
                # not the node itself, which would keep the tree of the file in memory
                given = arguments_of(owner)
                found.append(Docstring(path, statement.lineno, statement.value.value, given))
    return sorted(found, key=lambda each: each.line)


def first_line(text: str) -> str:
    """Return the first line that is not empty."""
    return text.strip().partition("\n")[0]


def is_relative(text: str) -> bool:
    """Tell whether a docstring begins with a relative clause."""
    return RELATIVE.match(text.strip()) is not None


def stale_arguments(found: list[Docstring]) -> list[str]:
    """List the names in sections ``Args:`` that are no argument, each with its place."""
    stale = []
    for each in found:
        if each.arguments is not None:
            stale += [
                f"{each.place}: Args names {name!r}, which is no argument"
                for name in documented_names(each.text)
                if name not in each.arguments
            ]
    return stale


def documented_names(text: str) -> Iterator[str]:
    """Yield the names in the section ``Args:`` of a docstring."""
    lines = text.splitlines()
    start = next((i for i, line in enumerate(lines) if line.strip() == "Args:"), len(lines))
    depth = None
    for line in lines[start + 1 :]:
        indent = len(line) - len(line.lstrip())
        if not line.strip():
            continue
        if indent <= len(lines[start]) - len(lines[start].lstrip()):
            return
        depth = indent if depth is None else depth
        entry = DOCUMENTED.match(line.strip()) if indent == depth else None
        if entry is not None:
            yield from (name.strip(" *`") for name in entry[1].split(","))


def arguments_of(owner: ast.AST) -> set[str] | None:
    """Return the names of a function's arguments, or of a class's; ``None`` where bases give them."""
    if isinstance(owner, ast.FunctionDef | ast.AsyncFunctionDef):
        given = owner.args
        every = (*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg)
        return {each.arg for each in every if each is not None}
    if not isinstance(owner, ast.ClassDef):
        return None
    makers = ("__init__", "__new__", "__call__")
    own = [each for each in owner.body if isinstance(each, ast.FunctionDef) and each.name in makers]
    names = set[str]().union(*(arguments_of(each) or set() for each in own))
    names |= {
        each.target.id
        for each in owner.body
        if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
    }
    return names if own or not owner.bases else None


if __name__ == "__main__":
    main()
