"""Writes the table of docs/bring_up.md that compares the robot's twin with the simulation, from a study.

::

    aloft study graphs/studies/twin.yaml
    python docs/refresh_twin.py results/twin/summary.json

The table of runs, ``runs.parquet``, has to be beside the summary: it says which seeds differ.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from marks import refresh

PAGE = Path(__file__).parent / "bring_up.md"
ARMS = ("simulation", "twin")
RISE, TILT = "apex_above_standing_m", "peak_tilt_deg"

Run = Mapping[str, Any]
"""A row of the table of runs: ``task``, ``arm``, ``seed``, ``success``, ``reason``."""


def pairs_of(runs: Sequence[Run]) -> dict[str, list[tuple[Run, Run]]]:
    """For each task the runs of both arms with the same seed, by seed."""
    found: dict[str, dict[int, dict[str, Run]]] = {}
    for run in runs:
        found.setdefault(run["task"], {}).setdefault(run["seed"], {})[run["arm"]] = run
    return {
        task: [(both[ARMS[0]], both[ARMS[1]]) for both in seeds.values() if len(both) == len(ARMS)]
        for task, seeds in found.items()
    }


def twin_table(rows: Sequence[Mapping[str, Any]], runs: Sequence[Run]) -> str:
    """One row a task that both arms ran, the runs that differ, and what all of them say together."""
    by_task: dict[str, dict[str, Mapping[str, Any]]] = {}
    for row in rows:
        by_task.setdefault(row["task"], {})[row["arm"]] = row
    lines = [
        "| task | simulation | twin | rise: simulation, twin | tilt: simulation, twin | seeds that differ |",
        "|---|---|---|---|---|---|",
    ]
    pairs = pairs_of(runs)
    shown = [task for task, arms in by_task.items() if len(arms) == len(ARMS) and pairs.get(task)]
    for task in shown:
        arms = [by_task[task][arm] for arm in ARMS]
        counts = " | ".join(f"{row['successes']} of {row['n']}" for row in arms)
        rises = ", ".join(_mean(row, RISE, 100.0, "cm") for row in arms)
        tilts = ", ".join(_highest(pairs[task], k) for k in range(len(ARMS)))
        differ = ", ".join(
            str(one["seed"]) for one, other in pairs[task] if one["success"] != other["success"]
        )
        lines.append(f"| {task} | {counts} | {rises} | {tilts} | {differ or '-'} |")
    return "\n".join(lines) + "\n\n" + _verdict([pairs[task] for task in shown], shown)


def equally_likely(first: int, second: int) -> float:
    """The probability of a split at least as uneven as ``first`` to ``second`` between two sides that
    are equally likely: McNemar's exact test, on both sides."""
    n, least = first + second, min(first, second)
    return min(1.0, 2.0 * math.fsum(math.comb(n, k) for k in range(least + 1)) / 2.0**n)


def _verdict(pairs: Sequence[Sequence[tuple[Run, Run]]], tasks: Sequence[str]) -> str:
    """The runs that differ, each with its reason, and McNemar's test over all pairs."""
    every = [pair for group in pairs for pair in group]
    if not every:
        raise ValueError("no task was run by both arms with the same seed")
    good = [sum(pair[k]["success"] for pair in every) for k in range(len(ARMS))]
    only = [
        sum(pair[k]["success"] and not pair[1 - k]["success"] for pair in every)
        for k in range(len(ARMS))
    ]
    seeds = sorted({pair[0]["seed"] for pair in every})
    text = (
        f"{_range(seeds)}. In all {good[0]} of {len(every)} runs succeed in simulation and {good[1]} on the twin: "
        f"{only[0]} of the pairs only in simulation, {only[1]} only on the twin."
    )
    if sum(only):
        text += (
            " If both succeeded equally often, a split at least as uneven would have the probability "
            f"{equally_likely(*only):.2g} (McNemar's exact test)."
        )
    lines = [text, ""]
    for task, group in zip(tasks, pairs, strict=True):
        for one, other in group:
            if one["success"] != other["success"]:
                arm, failed = (ARMS[0], one) if other["success"] else (ARMS[1], other)
                lines.append(
                    f"- {task}, seed {one['seed']}: only the {arm} fails, {failed['reason']}"
                )
    return "\n".join(lines).rstrip() + "\n"


def _range(seeds: Sequence[int]) -> str:
    return f"Seed {seeds[0]}" if len(seeds) == 1 else f"Seeds {seeds[0]} to {seeds[-1]}"


def _mean(row: Mapping[str, Any], name: str, scale: float, unit: str) -> str:
    figures = row["metrics"].get(name)
    return "-" if figures is None else f"{scale * figures['mean']:.1f} {unit}"


def _highest(pairs: Sequence[tuple[Run, Run]], arm: int) -> str:
    """Over the runs that succeeded: a robot that has fallen says nothing about the others."""
    values = [pair[arm][TILT] for pair in pairs if pair[arm]["success"] and pair[arm].get(TILT)]
    return f"{max(values):.0f} deg" if values else "-"


if __name__ == "__main__":
    from pyarrow import parquet

    summary = Path(sys.argv[1])
    made = parquet.read_table(summary.with_name("runs.parquet")).to_pylist()
    found = twin_table(json.loads(summary.read_text())["rows"], made)
    refresh(PAGE, "twin", found)
