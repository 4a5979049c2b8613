"""Writes the table of the frontier's page from its figures, and copies the picture.

::

    aloft bench frontier
    python docs/refresh_frontier.py results/frontier
"""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from marks import refresh

PAGE = Path(__file__).parent / "frontier.md"
PICTURE = "frontier.svg"
HEADINGS = (
    "direction", "lands at 95 %", "runs", "95 % interval", "next that fails, and why", "planned",
    "theory", "what binds there",
)  # fmt: skip


def frontier_table(found: Mapping[str, Any]) -> str:
    """What was run, and one row a direction."""
    lines = [
        f"{len(found['seeds'])} seeds a value, {found['seeds'][0]} to {found['seeds'][-1]}.",
        "",
        f"![How far jumps reach in every direction]({PICTURE})",
        "",
        f"| {' | '.join(HEADINGS)} |",
        "|" + "---|" * len(HEADINGS),
    ]
    return "\n".join([*lines, *(_line(each) for each in found["directions"])]) + "\n"


def _line(each: Mapping[str, Any]) -> str:
    unit, runs, fails = each["unit"], "-", "-"
    reached, between = "nothing", "-"
    if each["runs"]:
        reached = f"{each['reached']:g} {unit}"
        runs = f"{each['landed']} of {each['runs']}"
        between = f"{100 * each['ci_low']:.0f} % to {100 * each['ci_high']:.0f} %"
    if each["gaps"]:
        reached += f" (but not {', '.join(f'{gap:g}' for gap in each['gaps'])})"
    if each["fails_at"] is not None:
        landed = "" if each["fails_landed"] is None else " ({} of {})".format(*each["fails_landed"])
        fails = f"{each['fails_at']:g} {unit}{landed}: {each['why']}"
    ends = [
        f"{each[key]:g} {unit}" + ("" if each[f"{key}_ended"] else " or more")
        for key in ("planned", "theory")
    ]
    cells = [f"{each['name']}: {each['what']}", reached, runs, between, fails, *ends]
    return f"| {' | '.join([*cells, each['binds'] or '-'])} |"


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    result = json.loads((folder / "frontier.json").read_text())
    refresh(PAGE, "frontier", frontier_table(result))
    shutil.copyfile(folder / PICTURE, PAGE.with_name(PICTURE))
