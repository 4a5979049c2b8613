"""Brings the README's excerpts of files up to date: ``python docs/refresh_excerpts.py``.

An excerpt stays what lies between its first and its last line; tests/test_docs.py finds one that
has fallen behind.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
EXCERPT = re.compile(r"(<!-- from: (\S+) -->\n```\w+\n)(.*?)(```)", re.DOTALL)


def refreshed(match: re.Match[str]) -> str:
    """The excerpt as the file has it now. Raises ``ValueError`` if its first or last line is gone."""
    head, path, text, tail = match.groups()
    excerpt, lines = text.splitlines(), (ROOT / path).read_text().splitlines()
    first = lines.index(excerpt[0])
    last = lines.index(excerpt[-1], first)
    return head + "\n".join(lines[first : last + 1]) + "\n" + tail


if __name__ == "__main__":
    readme = ROOT / "README.md"
    readme.write_text(EXCERPT.sub(refreshed, readme.read_text()))
