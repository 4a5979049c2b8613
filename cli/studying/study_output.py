"""Shows the results of a study: as a table for people, as JSON for programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..shared.output import number, print_warning, table

if TYPE_CHECKING:
    from rich.console import Console

    from ...studies.study import Study
    from ...studies.summary import Row
    from ...studies.tuning import Draw

MOST_ROWS = 60


def study_json(
    study: Study, rows: Sequence[Row], seeds: Sequence[int], folder: Path
) -> dict[str, Any]:
    """The results as one JSON object."""
    from ...studies.fingerprint import code_fingerprint
    from ...studies.study import FIRST_REPORT_SEED

    n, successes = sum(row.n for row in rows), sum(row.successes for row in rows)
    errors = sum(row.errors for row in rows)
    goals = [row.met for row in rows if row.met is not None]
    reason = f"{successes} of {n} runs succeeded"
    if goals:
        reason += f"; {sum(goals)} of {len(goals)} goals met"
    if errors:
        reason += f"; {errors} runs broke"
    return {
        "success": not errors and all(goals),
        "reason": reason,
        "study": study.name,
        "n": n,
        "successes": successes,
        "errors": errors,
        "seeds": list(seeds),
        "tuning_seeds": [seed for seed in seeds if seed < FIRST_REPORT_SEED],
        "code": code_fingerprint(),
        "table": str(folder / "runs.parquet"),
        "rows": [row.to_json() for row in rows],
    }


def print_rows(screen: Console, study: Study, rows: Sequence[Row], seeds: Sequence[int]) -> None:
    """Print one line for each cell. Axes with a single value are left out."""
    from ...studies.study import FIRST_REPORT_SEED

    tuning = sum(seed < FIRST_REPORT_SEED for seed in seeds)
    if tuning:
        print_warning(
            f"{tuning} of {len(seeds)} seeds are tuning seeds (below {FIRST_REPORT_SEED}): "
            "no result to report"
        )
    axes = [name for name in study.axis_names if len(study.labels_of(name)) > 1] or ["task"]
    cells = [
        (
            *(row.cell.labels[axis] for axis in axes),
            f"{row.successes}/{row.n}",
            f"{row.rate:.1%}",
            f"{row.ci_low:.1%} to {row.ci_high:.1%}",
            "" if row.goal is None else f"{row.goal:.0%}",
            "" if row.met is None else number(row.met),
            next(iter(row.reasons), ""),
        )
        for row in rows[:MOST_ROWS]
    ]
    columns = (
        *axes,
        ">succeed",
        ">rate",
        ">95 % interval",
        ">goal",
        "met",
        "most frequent failure",
    )
    screen.print(table(study.title, columns, cells))
    if len(rows) > MOST_ROWS:
        screen.print(f"... and {len(rows) - MOST_ROWS} more cells, in the summary")


def tuned_json(study: Study, best: Mapping[str, Draw], path: Path, broken: int) -> dict[str, Any]:
    """The result of tuning as one JSON object."""
    assert study.tuning is not None
    return {
        "success": True,
        "reason": f"tuned {len(best)} arms",
        "study": study.name,
        "seeds": list(study.tuning.seeds),
        "draws_per_arm": study.tuning.draws,
        "errors": broken,
        "file": str(path),
        "arms": {
            arm: {"draw": d.number, "successes": d.successes, "n": d.n, "set": dict(d.values)}
            for arm, d in best.items()
        },
    }


def print_tuned(screen: Console, study: Study, best: Mapping[str, Draw]) -> None:
    """Print the best draw of every arm."""
    from ...runtime.loading.reading.nodes import text_of

    assert study.tuning is not None
    cells = [
        (
            arm,
            str(found.number),
            f"{found.successes}/{found.n}",
            ", ".join(f"{key} {text_of(value)}" for key, value in found.values.items())
            or "as written",
        )
        for arm, found in best.items()
    ]
    title = f"best of {study.tuning.draws} draws for every arm"
    screen.print(table(title, ("arm", ">draw", ">succeed", "parameters"), cells))
