"""Runs a graph once for each of many seeds, and prints a row for each."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ...runtime.language.errors import ExitCode
from ..shared.output import number, print_json, table
from ..shared.stopping import stopped_by_signals

if TYPE_CHECKING:
    from rich.console import Console

    from ...studies.batch.seeds import SeedRow

MOST_METRIC_COLUMNS = 5


def run_many(
    path: Path,
    overrides: list[str],
    seeds: list[int],
    out: Console,
    as_json: bool,
    *,
    plain: bool = False,
    fuse: bool = True,
) -> ExitCode:
    """Run the graph once with each seed; print a row for each, and how many succeeded."""
    from ...studies.batch.seeds import run_seeds
    from ..shared.progress import progress_bar

    rows: list[SeedRow] = []
    with (
        stopped_by_signals() as received,
        progress_bar(out, f"running {len(seeds)} seeds", len(seeds)) as (progress, task),
        closing(run_seeds(path, overrides, seeds, plain=plain, fuse=fuse)) as results,
    ):
        for row in results:
            rows.append(row)
            progress.advance(task)
    successes = sum(row.success for row in rows)
    reason = f"{successes} of {len(rows)} seeds succeeded"
    success = successes == len(seeds)
    code = ExitCode.SUCCESS if success else ExitCode.NOT_SUCCESSFUL
    if received:
        success, code = False, ExitCode(128 + received[0])
        reason = f"stopped by {received[0].name} after {len(rows)} of {len(seeds)} seeds"
    print_rows(out, rows)
    if as_json:
        summary = {"n": len(rows), "successes": successes, "seeds": seeds}
        outcome: dict[str, Any] = {"success": success, "reason": reason, "recording": None}
        outcome |= {"overrides": overrides, "summary": summary}
        print_json({**outcome, "rows": [vars(row) for row in rows]})
    else:
        typer.secho(reason, fg=typer.colors.GREEN if success else typer.colors.RED)
    return code


def print_rows(out: Console, rows: list[SeedRow]) -> None:
    """Print one line for each seed, with the first few metrics that differ between seeds."""
    values: dict[str, list[Any]] = {}
    for row in rows:
        for name, value in row.metrics.items():
            values.setdefault(name, []).append(value)
    differing = [name for name, found in values.items() if len(set(found)) > 1]
    names = differing[:MOST_METRIC_COLUMNS]
    out.print(
        table(
            "",
            (">seed", "success", *(f">{name}" for name in names), "reason"),
            [
                (
                    str(row.seed),
                    "yes" if row.success else "no",
                    *(number(row.metrics.get(name, "")) for name in names),
                    row.reason,
                )
                for row in rows
            ],
        )
    )
