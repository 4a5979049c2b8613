"""Writes the tables of docs/comparisons.md from studies' summaries, and copies their pictures.

::

    aloft study graphs/studies/formulations.yaml
    python docs/refresh_comparisons.py results/formulations results/controller results/estimator
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

from marks import refresh

PAGE = Path(__file__).parent / "comparisons.md"
Column = tuple[str, str, str, float]
"""Heading, metric, another one to take off its median, factor to the heading's unit."""

JUMP: tuple[Column, ...] = (
    ("pitch momentum at lift-off [N m s]", "lift_off_pitch_momentum_nms", "", 1.0),
    ("peak tilt after touchdown [deg]", "peak_tilt_deg", "", 1.0),
    ("apex error [cm]", "apex_above_standing_m", "planned_apex_above_standing_m", 100.0),
)
BASE: tuple[Column, ...] = (
    ("velocity in flight [mm/s]", "estimator_velocity_flight_rms_m_s", "", 1e3),
    ("velocity at touchdown [mm/s]", "estimator_velocity_touchdown_m_s", "", 1e3),
    ("position at touchdown [mm]", "estimator_position_touchdown_m", "", 1e3),
    ("attitude in flight [mrad]", "estimator_attitude_flight_rms_rad", "", 1e3),
    ("attitude at touchdown [mrad]", "estimator_attitude_touchdown_rad", "", 1e3),
)
COLUMNS = {"formulations": JUMP, "controller": JUMP, "estimator": BASE}
"""The metrics that a study's table shows."""
AXES = ("jump", "task", "arm")
"""What tells the rows of a table apart, where it does."""


def comparison_table(summary: dict[str, Any]) -> str:
    """One row a cell: how many runs succeeded and fell, and medians with their 5 % and 95 %."""
    rows, columns = summary["rows"], COLUMNS[summary["study"]]
    axes = [axis for axis in AXES if len({row.get(axis) for row in rows}) > 1]
    rows = sorted(rows, key=lambda row: [_place(rows, axis, row) for axis in axes])
    headings = [*axes, "succeeded", "95 % interval", "fell", *(column[0] for column in columns)]
    lines = [f"| {' | '.join(headings)} |", "|" + "---|" * len(headings)]
    for row in rows:
        fell = sum(n for reason, n in row["reasons"].items() if reason.startswith("fell"))
        cells = [
            *(row[axis] for axis in axes),
            f"{row['successes']} of {row['n']}",
            " to ".join(f"{100.0 * row[end]:.0f} %" for end in ("ci_low", "ci_high")),
            str(fell),
            *(_figures(row, *column[1:]) for column in columns),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _place(rows: list[dict[str, Any]], axis: str, row: dict[str, Any]) -> int:
    """Where the study has the row's value on an axis."""
    return list(dict.fromkeys(other[axis] for other in rows)).index(row[axis])


def _figures(row: dict[str, Any], metric: str, less: str, factor: float) -> str:
    """Median and the two quantiles; how many runs have them where not all do."""
    metrics = row["metrics"]
    if metric not in metrics:
        return "-"
    found = metrics[metric]
    offset = metrics[less]["median"] if less else 0.0
    ends = (found[end] - offset for end in ("median", "low", "high"))
    median, low, high = (round(factor * end, 6) + 0.0 for end in ends)  # no minus zero
    missing = f", {found['n']} runs" if found["n"] < row["n"] else ""
    return f"{median:.3g} ({low:.3g} to {high:.3g}{missing})"


if __name__ == "__main__":
    for folder in map(Path, sys.argv[1:]):
        result = json.loads((folder / "summary.json").read_text())
        study, table = result["study"], comparison_table(result)
        refresh(PAGE, f"study: {study}", table, of=study)
        for picture in result["plots"]:
            shutil.copyfile(folder / f"{picture}.svg", PAGE.with_name(f"{study}_{picture}.svg"))
