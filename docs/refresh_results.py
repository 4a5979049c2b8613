"""Runs the standard trial's reported seeds, and writes the table of results and the README's sentence."""

from __future__ import annotations

from pathlib import Path
from statistics import median

from marks import refresh

from aloft.studies.batch.seeds import SeedRow, run_seeds

ROOT = Path(__file__).parent.parent
SEEDS = range(6000, 6020)  # chosen before looking, and never run while anything was tuned
FIGURES = (
    ("apex_above_standing_m", "apex above standing", 100.0, "cm", "10.8 to 13.2"),
    ("apex_from_squat_m", "apex from squat", 100.0, "cm", "at least 15"),
    ("lift_off_speed_m_s", "take-off speed", 1.0, "m/s", ""),
    ("touchdown_speed_m_s", "touchdown speed", 1.0, "m/s", ""),
    ("flight_time_s", "flight", 1000.0, "ms", ""),
    ("peak_tilt_deg", "peak tilt", 1.0, "deg", "below 15"),
    ("final_tilt_deg", "tilt 1.5 s after touchdown", 1.0, "deg", "below 5"),
    ("foot_slip_m", "feet slip", 1000.0, "mm", "below 5"),
    ("peak_motor_torque_nm", "peak motor torque", 1.0, "N m", ""),
    ("peak_motor_speed_rad_s", "peak motor speed", 1.0, "rad/s", ""),
    ("qp_failures", "QP failures", 1.0, "", "0"),
)


def results_table(rows: list[SeedRow]) -> str:
    """The table of least, median and greatest over the seeds."""
    lines = [
        f"{_count(rows)}.",
        "",
        "| | least | median | greatest | unit | goal |",
        "|---|---|---|---|---|---|",
    ]
    for name, text, scale, unit, goal in FIGURES:
        values = [row.metrics[name] * scale for row in rows if name in row.metrics]
        cells = (min(values), median(values), max(values))
        numbers = " | ".join(f"{cell:.3g}" for cell in cells)
        lines.append(f"| {text} | {numbers} | {unit} | {goal} |")
    seeds = f"{SEEDS.start}:{SEEDS.stop}"
    lines += ["", f"`aloft run graphs/jump.yaml --seeds {seeds}` repeats it."]
    return "\n".join(lines) + "\n"


def headline(rows: list[SeedRow]) -> str:
    """How many seeds succeeded, and the median of the first figure."""
    name, text, scale, unit, goal = FIGURES[0]
    middle = median(row.metrics[name] * scale for row in rows if name in row.metrics)
    return f"{_count(rows)}, with an {text} of {middle:.3g} {unit} in the median (goal {goal}).\n"


def _count(rows: list[SeedRow]) -> str:
    successes = sum(row.success for row in rows)
    seeds = f"seeds {SEEDS[0]} to {SEEDS[-1]}"
    return f"Jump on the spot, {seeds}: **{successes} of {len(rows)} succeed**"


if __name__ == "__main__":
    found = list(run_seeds(ROOT / "graphs" / "jump.yaml", [], SEEDS))
    refresh(ROOT / "docs" / "results.md", "results", results_table(found))
    refresh(ROOT / "README.md", "results", headline(found))
