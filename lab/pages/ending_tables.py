"""Tables of how runs end: on untold ground, and with broken parts; see ``refresh``."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

from result_tables import Row, table

UPRIGHT = 12.0
"""A robot whose torso leans by less at the end is upright [deg]."""


def ground_table(runs: Sequence[Row], of: str) -> str:
    """Format one row for each value of the column ``of``, one column an arm: the numbers that
    succeed, and that end upright."""
    groups: dict[str, dict[str, list[Row]]] = {}
    for run in runs:
        groups.setdefault(run[of], {}).setdefault(
            run["arm"].replace("default", "shipped"), []
        ).append(run)
    arms = list(dict.fromkeys(arm for group in groups.values() for arm in group))
    return table(
        ("", *(f"{arm}: {what}" for arm in arms for what in ("success", "upright"))),
        [(name, *(cell for arm in arms for cell in _landed(group.get(arm, ()))))
         for name, group in groups.items()],
    )  # fmt: skip


def _landed(runs: Sequence[Row]) -> tuple[str, str]:
    """Return the numbers of runs that succeed, and that end upright, as text."""
    if not runs:
        return "-", "-"
    tilts = [run["final_tilt_deg"] for run in runs]
    upright = sum(tilt is not None and tilt < UPRIGHT for tilt in tilts)
    return f"{sum(run['success'] for run in runs)} of {len(runs)}", str(upright)


def fault_table(runs: Sequence[Row]) -> str:
    """Format one row a fault, one column for each time of its onset: the number of runs that
    succeed, the ends of the others, and what stopped them after which time."""
    cells: dict[str, dict[str, list[Row]]] = {}
    for run in runs:
        cells.setdefault(run["fault"], {}).setdefault(run["task"], []).append(run)
    tasks = list(dict.fromkeys(run["task"] for run in runs))
    return table(
        ("fault", *tasks),
        [
            (name, *(_fault_cell(row.get(task, ())) for task in tasks))
            for name, row in cells.items()
        ],
    )


def _fault_cell(runs: Sequence[Row]) -> str:
    """Summarise the runs of one fault, such as ``2 succeed, 3 fall; tilt after 0.41 s; 4 warned:
    torque after 0.1 s``."""
    ends = {"succeed": 0, "fall": 0, "stop": 0, "fail": 0}
    stops: dict[str, list[float]] = {}
    warned: dict[str, list[float]] = {}
    for run in runs:
        reason = run["reason"]
        ends["succeed" if run["success"] else "fall" if reason.startswith("fell") else
             "stop" if reason.startswith(("safety", "detector", "the run failed")) else "fail"] += 1  # fmt: skip
        if run.get("safety_fault_time_s") is not None and run.get("fault_time_s") is not None:
            after = run["safety_fault_time_s"] - run["fault_time_s"]
            stops.setdefault(run["safety_fault"].replace("_", " "), []).append(after)
        if run.get("stopped_time_s") is not None and run.get("fault_time_s") is not None:
            after = run["stopped_time_s"] - run["fault_time_s"]
            stops.setdefault(run["stopped_for"], []).append(after)
        if run.get("suspect_time_s") is not None and run.get("fault_time_s") is not None:
            after = run["suspect_time_s"] - run["fault_time_s"]
            warned.setdefault(run["suspect"], []).append(after)
    parts = [", ".join(f"{n} {end}" for end, n in ends.items() if n)]
    parts.append(", ".join(f"{who} after {median(after):.2f} s" for who, after in stops.items()))
    parts += [
        f"{len(after)} warned: {who} after {median(after):.2f} s" for who, after in warned.items()
    ]
    return "; ".join(part for part in parts if part) or "-"
