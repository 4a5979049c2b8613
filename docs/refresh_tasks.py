"""Writes a page's table of tasks from a study's summary. Where no page is named, it is that of the
results, and the README gets the rows of ``HEADLINE`` and all that missed their goals.

::

    aloft study graphs/studies/tasks.yaml
    python docs/refresh_tasks.py results/tasks/summary.json
    aloft study graphs/studies/robots.yaml
    python docs/refresh_tasks.py results/robots/summary.json docs/robots_results.md
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from marks import refresh

ROOT = Path(__file__).parent.parent
HEADLINE = (
    "in situ, 18 cm above standing",
    "forward 38 cm",
    "backward 12 cm",
    "sideways 20 cm",
    "turn 60 deg",
    "step up 8 cm",
    "step down 15 cm",
    "beyond, forward 60 cm",
    "push 100 N forward",
)
"""The tasks that the README shows in any case."""
HEAD = ("| task | succeeded | 95 % interval | goal |", "|---|---|---|---|")


def tasks_table(summary: Mapping[str, Any]) -> str:
    """One row a task: how many of its runs succeeded, and between which rates that lies."""
    return "\n".join([*HEAD, *map(_line, summary["rows"])]) + "\n"


def headline_table(summary: Mapping[str, Any]) -> str:
    """How many tasks met their goal, the rows of ``HEADLINE``, and those of all that did not.

    Raises:
        ValueError: the summary lacks a task of ``HEADLINE``.
    """
    rows: Sequence[Mapping[str, Any]] = summary["rows"]
    if lacking := [name for name in HEADLINE if name not in {row["task"] for row in rows}]:
        raise ValueError(f"the summary has no task {lacking[0]!r}, which the README shows")
    met = sum(row["met"] for row in rows)
    shown = [row for row in rows if row["task"] in HEADLINE or not row["met"]]
    count = f"{met} of {len(rows)} tasks and pushes met their goal. Some of these, and all that missed it:"
    return "\n".join([count, "", *HEAD, *map(_line, shown)]) + "\n"


def _line(row: Mapping[str, Any]) -> str:
    low, high = (f"{100.0 * row[key]:.0f} %" for key in ("ci_low", "ci_high"))
    goal = f"{100.0 * row['goal']:.0f} %, {'met' if row['met'] else 'missed'}"
    return f"| {row['task']} | {row['successes']} of {row['n']} | {low} to {high} | {goal} |"


if __name__ == "__main__":
    found = json.loads(Path(sys.argv[1]).read_text())
    if len(sys.argv) > 2:
        refresh(Path(sys.argv[2]), "tasks", tasks_table(found))
    else:
        refresh(ROOT / "docs" / "results.md", "tasks", tasks_table(found))
        refresh(ROOT / "README.md", "tasks", headline_table(found))
