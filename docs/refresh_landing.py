"""Writes the tables of the landing study's page from the study's summary and its tuned gains.

::

    aloft study graphs/studies/push_polar.yaml
    python docs/refresh_landing.py results/push_polar/summary.json
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "landing.md"
TUNED = ROOT / "graphs" / "studies" / "push_polar.tuned.yaml"
QUARTERS = {"ahead": 0, "left": 90, "back": 180, "right": 270}
"""Each with the directions within 45 degrees of it, those at its edges counted half on each side."""

Row = Mapping[str, Any]


def arms_of(rows: Sequence[Row]) -> list[str]:
    """The arms in the study's order."""
    return list(dict.fromkeys(row["arm"] for row in rows))


def impulse_table(rows: Sequence[Row]) -> str:
    """Success over all directions, a line an arm, a column an impulse."""
    impulses = list(dict.fromkeys(row["impulse_n_s"] for row in rows))
    lines = [
        "| arm | " + " | ".join(f"{impulse:g} N s" for impulse in impulses) + " |",
        "|---" * (len(impulses) + 1) + "|",
    ]
    for arm in arms_of(rows):
        cells = []
        for impulse in impulses:
            mine = [r for r in rows if r["arm"] == arm and r["impulse_n_s"] == impulse]
            done, n = sum(r["successes"] for r in mine), sum(r["n"] for r in mine)
            cells.append(f"{done} of {n} ({100 * done / n:.0f} %)")
        lines.append(f"| {arm} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def quarter_table(rows: Sequence[Row]) -> str:
    """Success over all impulses, a column a quarter of the directions."""
    lines = ["| arm | " + " | ".join(QUARTERS) + " |", "|---" * (len(QUARTERS) + 1) + "|"]
    for arm in arms_of(rows):
        cells = []
        for middle in QUARTERS.values():
            done = n = 0.0
            for row in rows:
                away = abs((row["direction_deg"] - middle + 180) % 360 - 180)
                if row["arm"] == arm and away <= 45:
                    share = 0.5 if away == 45 else 1.0
                    done, n = done + share * row["successes"], n + share * row["n"]
            cells.append(f"{100 * done / n:.0f} %")
        lines.append(f"| {arm} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def gains_table(tuned: Mapping[str, Any]) -> str:
    """What the search found for every arm."""
    lines = ["| arm | succeeded in the search | gains |", "|---|---|---|"]
    for arm, found in tuned["arms"].items():
        gains = ", ".join(
            f"`{key.removeprefix('landing.')}` {_rounded(value)}"
            for key, value in found["set"].items()
        )
        lines.append(f"| {arm} | {found['successes']} of {found['n']} | {gains or 'as written'} |")
    return "\n".join(lines) + "\n"


def _rounded(value: Any) -> str:
    if isinstance(value, list):
        return "(" + ", ".join(_rounded(each) for each in value) + ")"
    return f"{float(value):.3g}"


def replaced(text: str, mark: str, table: str) -> str:
    """The page with what is between the marks of that name replaced."""
    pattern = re.compile(rf"(<!-- {mark} -->\n).*?(<!-- end of {mark} -->)", re.DOTALL)
    if not pattern.search(text):
        raise SystemExit(f"{PAGE} has no <!-- {mark} -->")
    return pattern.sub(lambda found: f"{found[1]}{table}{found[2]}", text)


if __name__ == "__main__":
    every = json.loads(Path(sys.argv[1]).read_text())["rows"]
    page = PAGE.read_text()
    page = replaced(page, "impulses", impulse_table(every))
    page = replaced(page, "quarters", quarter_table(every))
    page = replaced(page, "gains", gains_table(yaml.safe_load(TUNED.read_text())))
    PAGE.write_text(page)
