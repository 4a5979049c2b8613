"""Holds counts of runs in the prose of pages ("17 of 20") to the data files that studies wrote.

::

    python lab/pages/claims.py    what is wrong; exit 1 if anything is

``docs/data/claims.yaml`` has a claim for every such count that is no part of a table made from data, by page. A claim
``says`` a piece of the page with one count in it, and names its ``data`` file, the rows ``where`` it is found, and which
``count`` of them it adds up; or its
``goals`` are the rows of a made table, ``PAGE#MARK``, of which it counts those that are met.
``docs/paper.md`` is made whole from ``docs/paper.json``, and a test of ``aloft study paper`` holds it to that.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", "docs/comparisons.md", "docs/landing.md", "docs/planning.md")
CLAIMS = "docs/data/claims.yaml"
COUNT = re.compile(r"\b(\d+) of (?:the )?(\d+)\b(?! rad/s)")
MADE = re.compile(
    r"<!-- (?!from|file)[^>]*-->\n(?:(?!<!--).)*?<!-- end of [^>]*-->|^```.*?^```",
    re.DOTALL | re.MULTILINE,
)
"""Tables made from data, and code."""


def prose(text: str) -> str:
    """Return a page without what is made from data and without code, on the same lines."""
    return MADE.sub(lambda made: "\n" * made[0].count("\n"), text)


def covers(claims: Sequence[Mapping[str, Any]], text: str) -> tuple[list[str], list[str]]:
    """Return the counts in a page's prose that no claim covers, with their lines, and the claims that are not in it."""
    spans, gone = list[tuple[int, int]](), list[str]()
    for claim in claims:
        first = text.find(claim["says"])
        if first < 0 or text.find(claim["says"], first + 1) >= 0:
            gone.append(claim["says"])
        else:
            spans.append((first, first + len(claim["says"])))
    bare = [
        f"line {text.count(chr(10), 0, found.start()) + 1}: {found[0]}"
        for found in COUNT.finditer(text)
        if not any(first <= found.start() and found.end() <= last for first, last in spans)
    ]
    return bare, gone


def difference(claim: Mapping[str, Any], data: Mapping[str, Any]) -> str:
    """Return what a claim says otherwise than its data; empty where they agree."""
    counts = COUNT.findall(claim["says"])
    if len(counts) != 1:
        return f"{claim['says']!r} has {len(counts)} counts; a claim has one"
    rows = [
        row
        for row in data["rows"]
        if all(str(row.get(label)) == str(value) for label, value in claim.get("where", {}).items())
    ]
    if not rows:
        return f"{claim['says']!r}: no row of {claim['data']} has {claim['where']}"
    found = sum(row[claim.get("count", "successes")] for row in rows), sum(row["n"] for row in rows)
    said = int(counts[0][0]), int(counts[0][1])
    return (
        "" if said == found else f"{claim['says']!r}: {claim['data']} has {found[0]} of {found[1]}"
    )


def met_difference(claim: Mapping[str, Any], root: Path) -> str:
    """Return how a count of goals that are met differs from the made table that a claim names; empty where they agree."""
    page, _, mark = str(claim["goals"]).partition("#")
    text = (root / page).read_text(encoding="utf-8")
    table = text.partition(f"<!-- {mark} -->\n")[2].partition(f"<!-- end of {mark} -->")[0]
    goals = [row for row in table.splitlines() if row.endswith((", met |", ", missed |"))]
    found = sum(row.endswith(", met |") for row in goals), len(goals)
    said = tuple(int(number) for number in COUNT.findall(claim["says"])[0])
    return "" if said == found else f"{claim['says']!r}: {page} has {found[0]} of {found[1]}"


def read(root: Path) -> dict[str, list[dict[str, Any]]]:
    """Return the claims by page."""
    found = yaml.safe_load((root / CLAIMS).read_text(encoding="utf-8"))
    return {page: found.get(page) or [] for page in PAGES}


def wrong(root: Path) -> Iterator[str]:
    """Yield what is wrong with any page's claims."""
    for page, claims in read(root).items():
        text = prose((root / page).read_text(encoding="utf-8"))
        bare, gone = covers(claims, text)
        yield from (f"{page}, {each}: no claim in {CLAIMS} covers it" for each in bare)
        yield from (f"{page}: {says!r} is not in its prose, or twice" for says in gone)
        for claim in claims:
            if "goals" in claim:
                told = met_difference(claim, root)
            elif "data" in claim:
                path = root / "docs" / "data" / f"{claim['data']}.json"
                told = difference(claim, json.loads(path.read_text(encoding="utf-8")))
            else:
                told = f"{claim['says']!r} names neither data nor goals"
            if told:
                yield f"{page}: {told}"


def main() -> int:
    """Print what is wrong."""
    found = list(wrong(ROOT))
    print("\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
