"""The worst runs of a study, numbered, so that any of them can be recorded and looked at."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isnan
from os import PathLike
from pathlib import Path

from ..runtime.language.errors import AloftError
from ..runtime.running.run_result import RunResult
from ..runtime.running.sink import Sink
from .execution import Run
from .expansion import job, seeded_graph
from .journal import Outcome
from .study import Study

TILT = "peak_tilt_deg"
"""The metric that ranks runs of the same outcome, where they have it: a run that leans far is near
a fall."""
MOST_LISTED = 50


def worst_first(runs: Sequence[Run]) -> list[Run]:
    """Sort all runs that were made: those that broke, those that failed, those that succeeded;
    among equal ones those that tilted most come first, and then the order of the study counts."""
    made = [run for run in runs if run.outcome is not None]
    return sorted(made, key=_rank)


def _rank(run: Run) -> tuple[int, float]:
    outcome = run.outcome
    assert outcome is not None
    tilt = tilt_of(outcome)
    return (0 if outcome.error else 2 if outcome.success else 1), 0.0 if tilt is None else -tilt


def tilt_of(outcome: Outcome) -> float | None:
    """Return the robot's largest tilt [deg], where that is known."""
    tilt = outcome.metrics.get(TILT)
    return float(tilt) if isinstance(tilt, int | float) and not isnan(tilt) else None


def labels_of(run: Run) -> str:
    """Describe the run's place in the study: ``task up_5cm, arm shipped, force 70, seed 7003``."""
    cell = run.cell
    names = {"task": cell.task, "arm": cell.arm, **cell.coordinates, "seed": run.seed}
    return ", ".join(f"{name} {value}" for name, value in names.items() if value not in ("", None))


def chosen_run(runs: Sequence[Run], number: int) -> Run:
    """Return the run with that number of the list, which begins with 1.

    Raises:
        AloftError: there is no such number.
    """
    ordered = worst_first(runs)
    if not 1 <= number <= len(ordered):
        raise AloftError(
            f"there is no run {number} in the list of the worst: it has 1 to {len(ordered)}"
        )
    return ordered[number - 1]


def file_name(run: Run) -> str:
    """Return a name for the run's recording."""
    return re.sub(r"[^A-Za-z0-9_.+-]+", "_", labels_of(run)).strip("_") + ".rrd"


def run_again(run: Run, sinks: Sequence[Sink]) -> RunResult:
    """Make the run once more. Raises ``AloftError`` where it cannot be set up."""
    return seeded_graph(job(run.cell, run.seed)).run(sinks=sinks, log=False)


def write_page(study: Study, runs: Sequence[Run], path: str | PathLike[str]) -> Path:
    """Write the list of the worst runs as a Markdown page, which says how to open each."""
    ordered = worst_first(runs)
    failed = sum(not run.outcome.success for run in ordered if run.outcome is not None)
    how = (
        f"{failed} of {len(ordered)} runs did not succeed. `aloft study {study.path} --open N` "
        "makes run N once more, records it, and shows it."
    )
    lines = [
        f"# The worst runs of the study {study.name}",
        "",
        how,
        "",
        "| N | run | result | tilt [deg] |",
        "|--:|---|---|--:|",
    ]
    for number, run in enumerate(ordered[:MOST_LISTED], 1):
        lines.append(f"| {number} | {labels_of(run)} | {_result(run)} | {_tilt(run)} |")
    if len(ordered) > MOST_LISTED:
        lines += ["", f"{len(ordered) - MOST_LISTED} further runs are not listed."]
    path = Path(path)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def _result(run: Run) -> str:
    assert run.outcome is not None
    text = run.outcome.error or run.outcome.reason
    return " ".join(text.split()).replace("|", "\\|")[:160]


def _tilt(run: Run) -> str:
    assert run.outcome is not None
    tilt = tilt_of(run.outcome)
    return "" if tilt is None else f"{tilt:.1f}"


def with_outcomes(runs: Sequence[Run], outcomes: Mapping[str, Outcome]) -> list[Run]:
    """Return the runs with the outcomes of a journal, without those that were not made."""
    return [replace(run, outcome=outcomes[run.key]) for run in runs if run.key in outcomes]
