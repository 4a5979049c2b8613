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
HEADLINE = (
    "controller, fused, beside OSQP",
    "whole-body program, beside DAQP",
    "state to torque, beside TSID",
    "busy-wait loop, period",
)
"""The rows that the README shows in any case."""
HEAD = ("| | median | as many times as fast as | times | floor | goal | |", "|---|" + "---|" * 6)
REACHED, FLOOR, MISSED = "goal reached", "floor reached", "missed"


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
    lines += ["", *HEAD]
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
    return f"| {' | '.join([*cells, '; '.join(filter(None, (_outcome(row), row['note'])))])} |"


def _outcome(row: Mapping[str, Any]) -> str:
    measured = row["ratio"] if row["peer"] else row["value"]
    if row["met"] is False and row["floor"] is not None and measured <= row["floor"]:
        return FLOOR
    return {True: REACHED, False: MISSED, None: ""}[row["met"]]


def short_table(found: Mapping[str, Any]) -> str:
    """The picture, how many goals are reached, the rows of ``HEADLINE``, and all missed ones."""
    rows = [row for row in found["rows"] if row["goal"] is not None]
    outcomes = [_outcome(row) for row in rows]
    shown = [
        row
        for row, outcome in zip(rows, outcomes, strict=True)
        if row["name"] in HEADLINE or outcome == MISSED
    ]
    reached, floor, missed = (outcomes.count(each) for each in (REACHED, FLOOR, MISSED))
    count = (
        f"Of {len(rows)} rows with a goal {reached} reach it, {floor} reach only their floor, and {missed} "
        "miss both. Some of these, and all that miss both:"
    )
    lines = [f"![The blocks of one tick beside its peers](docs/{PICTURE})", "", count, "", *HEAD]
    return "\n".join([*lines, *map(_line, shown)]) + "\n"


if __name__ == "__main__":
    result = json.loads(Path(sys.argv[1]).read_text())
    refresh(PAGE, "tick", tick_tables(result))
    refresh(README, "tick", short_table(result))
    PAGE.with_name(PICTURE).write_text(tick_chart(result["rows"]))
