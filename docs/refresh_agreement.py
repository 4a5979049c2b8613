"""Writes into the page of the whole-body controller how far its methods agree.

::

    aloft bench agreement --json > agreement.json
    python docs/refresh_agreement.py agreement.json
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from marks import refresh

PAGE = Path(__file__).parent / "whole_body.md"


def table(found: Mapping[str, Any]) -> str:
    """A line for every method and set of programs: the largest error, and how many were not solved."""
    lines = [
        "| programs | method | largest error of a torque [N m] | not solved | |",
        "|---|---|---|---|---|",
    ]
    rows = {row["name"]: row for row in found["rows"]}
    for name, row in rows.items():
        what, _, rest = name.partition(": ")
        method, _, kind = rest.partition(", largest error")
        if name.endswith(", largest error") and not kind:
            unsolved = rows[f"{what}: {method}, not solved"]["value"]
            lines.append(
                f"| {what} | {method} | {row['value']:.1e} | {unsolved:.0f} | {row['note']} |"
            )
        elif not rest:
            lines.append(f"| {what} | | | | {row['value']:.0f} programs, {row['note']} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    refresh(PAGE, "agreement", table(json.loads(Path(sys.argv[1]).read_text())))
