"""Writes the tables of one tick into the page of compiled kernels and into README, and draws the picture.

::

    aloft bench tick --tsid FOLDER --since 65ca00c --json > tick.json
    python docs/refresh_tick.py tick.json
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from marks import refresh

from aloft.benchmarks.tick.chart import BARS, tick_chart

PAGE = Path(__file__).parent / "compiled.md"
README = PAGE.parent.parent / "README.md"
PICTURE = "tick.svg"


def tick_tables(found: Mapping[str, Any]) -> str:
    """What was measured, the picture, and two tables: of blocks, and of ratios."""
    machine, load = found["machine"], found["load"]
    rows: Sequence[Mapping[str, Any]] = found["rows"]
    blocks = {prefix: _blocks(rows, prefix) for prefix, _ in BARS}
    shown = [(prefix, label) for prefix, label in BARS if blocks[prefix]]
    where = (
        f"{machine['processor']}, {machine['cores']} cores, Python {machine['python']}; load before "
        f"{load['before'][0]:g}, after {load['after'][0]:g}. Ratios bear load well, times do not."
    )
    lines = [
        where,
        "",
        f"![The blocks of one tick in all tiers]({PICTURE})",
        "",
        f"| median [us] | {' | '.join(label for _, label in shown)} |",
        "|---|" + "---|" * len(shown),
    ]
    for block in blocks["block "]:
        cells = (
            f"{blocks[prefix][block]:.1f}" if block in blocks[prefix] else "" for prefix, _ in shown
        )
        lines.append(f"| `{block}` | {' | '.join(cells)} |")
    lines += [
        "",
        "| | median | as many times as fast as | times | floor | goal | |",
        "|---|" + "---|" * 6,
    ]
    lines += [_line(row) for row in rows if not row["name"].startswith(tuple(blocks))]
    return "\n".join(lines) + "\n"


def _blocks(rows: Sequence[Mapping[str, Any]], prefix: str) -> dict[str, float]:
    return {r["name"][len(prefix) :]: r["value"] for r in rows if r["name"].startswith(prefix)}


def _line(row: Mapping[str, Any]) -> str:
    value = (
        "-" if row["value"] is None else f"{row['value']:.4g} {row['unit'].removesuffix('/tick')}"
    )
    cells = [row["name"], value, row["peer"]]
    for key in ("ratio", "floor", "goal"):
        number = row[key]
        if number is None:
            cells.append("")
        else:
            cells.append(f"{1.0 / number:.3g}" if row["peer"] else f"{number:g} {row['unit']}")
    measured = row["ratio"] if row["peer"] else row["value"]
    met = {True: "goal reached", False: "missed", None: ""}[row["met"]]
    if row["met"] is False and row["floor"] is not None and measured <= row["floor"]:
        met = "floor reached"
    return f"| {' | '.join([*cells, '; '.join(filter(None, (met, row['note'])))])} |"


def short_table(found: Mapping[str, Any]) -> str:
    """Only the ratios that have a goal, with the picture."""
    lines = [
        f"![The blocks of one tick beside its peers](docs/{PICTURE})",
        "",
        "| | median | as many times as fast as | times | floor | goal | |",
        "|---|" + "---|" * 6,
        *(_line(row) for row in found["rows"] if row["goal"] is not None),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    result = json.loads(Path(sys.argv[1]).read_text())
    refresh(PAGE, "tick", tick_tables(result))
    refresh(README, "tick", short_table(result))
    PAGE.with_name(PICTURE).write_text(tick_chart(result["rows"]))
