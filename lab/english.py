"""Holds the pages to plain English: ``python lab/english.py [FILE ...]`` prints what to write otherwise.

Each rule is a pattern that a fluent engineer would not write, and what to write in its place. Code,
links' addresses and the changelog are left out. The exit code is 1 where something was found.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
RULES = {
    r"\bWhoever \w+": "say who: 'If you ...'",
    r"\bis noticed by nothing\b": "goes undetected",
    r"\bof that of\b": "name the thing again",
    r"\blibrary of C\b": "a C library",
    r"\bnothing is said twice\b": "say what it means for the reader",
    r"\bof (?:yours|theirs) need not\b": "does not have to",
    r"\bthat nobody tuned\b": "untuned",
    r"\bmade anew\b": "rebuilt, recomputed",
    r"\ba folder of yours\b": "your own folder",
    r"\bwhat you then do without\b": "trade-offs",
    r"\bas they stand\b, because": "two sentences",
    r"\bis no success\b": "fails",
}
"""Patterns, and what to write in place of what they match."""
PAGES = ("README.md", "CONTRIBUTING.md", "docs/index.md", "docs/install.md", "docs/tutorial.md",
         "docs/gallery.md", "docs/frameworks.md", "docs/known_gaps.md")  # fmt: skip
"""The pages that a new user reads first; others are held to the rules when they are named."""
CODE = re.compile(r"^ *```.*?^ *```$|`[^`\n]*`|\]\([^)]*\)", re.DOTALL | re.MULTILINE)


class Finding(NamedTuple):
    """A place in a page that a rule matches."""

    line: int
    text: str
    instead: str


def findings(page: str) -> Iterator[Finding]:
    """Yield what the rules match in a page, outside of code and addresses."""
    prose = CODE.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), page)
    for pattern, instead in RULES.items():
        for match in re.finditer(pattern, prose):
            yield Finding(prose.count("\n", 0, match.start()) + 1, match[0], instead)


def main(names: list[str]) -> int:
    """Print the findings of the named pages, or of those that a new user reads first."""
    count = 0
    for name in names or PAGES:
        path = Path(name) if names else ROOT / name
        if path.name == "CHANGELOG.md":
            continue
        for found in findings(path.read_text(encoding="utf-8")):
            print(f"{name}:{found.line}: {found.text!r}; better: {found.instead}")
            count += 1
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
