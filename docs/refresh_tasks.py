"""Writes a page's table of tasks from a study's summary; the page is the README unless it is named.

::

    aloft study graphs/studies/tasks.yaml
    python docs/refresh_tasks.py results/tasks/summary.json
    aloft study graphs/studies/robots.yaml
    python docs/refresh_tasks.py results/robots/summary.json docs/robots_results.md
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from marks import refresh

ROOT = Path(__file__).parent.parent


def tasks_table(summary: dict[str, object]) -> str:
    """One row a task: how many of its runs succeeded, and between which rates that lies."""
    lines = ["| task | succeeded | 95 % interval | goal |", "|---|---|---|---|"]
    for row in summary["rows"]:  # type: ignore[attr-defined]  # JSON
        low, high = (f"{100.0 * row[key]:.0f} %" for key in ("ci_low", "ci_high"))
        goal = f"{100.0 * row['goal']:.0f} %, {'met' if row['met'] else 'missed'}"
        lines.append(
            f"| {row['task']} | {row['successes']} of {row['n']} | {low} to {high} | {goal} |"
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    page = Path(sys.argv[2]) if len(sys.argv) > 2 else ROOT / "README.md"
    table = tasks_table(json.loads(Path(sys.argv[1]).read_text()))
    refresh(page, "tasks", table)
