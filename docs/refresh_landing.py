"""Writes the tables of the landing study's page from the summaries of its two studies.

::

    aloft study graphs/studies/push_polar.yaml
    aloft study graphs/studies/push_polar_12cm.yaml
    python docs/refresh_landing.py results/push_polar/summary.json results/push_polar_12cm/summary.json
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from marks import refresh

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "landing.md"
QUARTERS = {"ahead": 0, "left": 90, "back": 180, "right": 270}
"""Each with the directions within 45 degrees of it, those at its edges counted half on each side."""

SPEED = 5.118 * (9.80665 * 0.32) ** 0.5
"""The impulse [N s] that changes BRUCE's speed by sqrt(g h), with h = 0.32 m."""
SHIPPED = "predicted"
"""The arm of the shipped law."""
Row = Mapping[str, Any]


def arms_of(rows: Sequence[Row]) -> list[str]:
    """The arms in the study's order."""
    return list(dict.fromkeys(row["arm"] for row in rows))


def rate(successes: float, runs: float) -> str:
    """A success rate in percent, or a dash where nothing was run."""
    return f"{100 * successes / runs:.0f} %" if runs else "-"


def impulses_of(rows: Sequence[Row]) -> list[float]:
    """The impulses [N s] in the study's order."""
    return list(dict.fromkeys(row["impulse_n_s"] for row in rows))


def count(rows: Sequence[Row], **wanted: object) -> tuple[int, int]:
    """Successes and runs of the rows with these values."""
    mine = [row for row in rows if all(row[name] == value for name, value in wanted.items())]
    return sum(row["successes"] for row in mine), sum(row["n"] for row in mine)


def impulse_table(rows: Sequence[Row]) -> str:
    """Success over all directions, a line an arm, a column an impulse."""
    impulses = impulses_of(rows)
    names = [f"{impulse:g} N s, {impulse / SPEED:.3f} sqrt(g h)" for impulse in impulses]
    lines = [f"| arm | {' | '.join(names)} |", "|---" * (len(impulses) + 1) + "|"]
    for arm in arms_of(rows):
        cells = []
        for impulse in impulses:
            done, n = count(rows, arm=arm, impulse_n_s=impulse)
            cells.append(f"{done} of {n} ({rate(done, n)})")
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
            cells.append(rate(done, n))
        lines.append(f"| {arm} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def direction_table(rows: Sequence[Row]) -> str:
    """The shipped law's and the best other arm's successes, a line a direction."""
    impulses = impulses_of(rows)
    others = [arm for arm in arms_of(rows) if arm != SHIPPED]
    names = [f"{impulse:g} N s" for impulse in impulses]
    lines = [f"| direction | {' | '.join(names)} |", "|---" * (len(impulses) + 1) + "|"]
    for direction in sorted({row["direction_deg"] for row in rows}):
        cells = []
        for impulse in impulses:
            where = {"direction_deg": direction, "impulse_n_s": impulse}
            done, n = count(rows, arm=SHIPPED, **where)
            best = max((count(rows, arm=arm, **where)[0] for arm in others), default=0)
            better = f" (best other arm {best})" if best > done else ""
            cells.append(f"{done} of {n}{better}")
        lines.append(f"| {direction:g} deg | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    for mark, file in zip(("", " 12 cm"), sys.argv[1:], strict=False):
        every = json.loads(Path(file).read_text())["rows"]
        refresh(PAGE, "impulses" + mark, impulse_table(every))
        refresh(PAGE, "quarters" + mark, quarter_table(every))
        refresh(PAGE, "directions" + mark, direction_table(every))
