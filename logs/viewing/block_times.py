"""The time that each block of a run took, as a table."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

COLUMNS = (
    ("runs", "calls", "d"),
    ("mean [us]", "mean_us", ".1f"),
    ("median [us]", "p50_us", ".1f"),
    ("99 % [us]", "p99_us", ".1f"),
    ("longest [us]", "max_us", ".1f"),
    ("overruns", "overruns", "d"),
)


def times_table(outcome: Mapping[str, Any]) -> str:
    """The table as Markdown, made from an outcome (``RunResult.to_json``), in the order of execution."""
    blocks: Mapping[str, Mapping[str, Any]] = outcome.get("blocks", {})
    lines = ["| block | " + " | ".join(title for title, *_ in COLUMNS) + " |"]
    lines.append("|---|" + "---:|" * len(COLUMNS))
    for path, times in blocks.items():
        cells = [format(times[key], form) for _, key, form in COLUMNS]
        lines.append(f"| {path} | " + " | ".join(cells) + " |")
    total = sum(float(times["mean_us"]) for times in blocks.values())
    ticks, wall = outcome.get("ticks", 0), float(outcome.get("wall_time_s") or 0.0)
    lines += ["", f"{ticks} ticks in {wall:.2f} s; all blocks together {total:.0f} us on average."]
    return "\n".join(lines)
