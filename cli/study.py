"""``aloft study``: run a grid of graphs, overrides and seeds; table, summary and pictures."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..runtime.language.errors import AloftError, ExitCode
from .shared.options import Cluster, JsonBesideTables, StudySeeds, Workers
from .shared.output import console, errors_reported, print_json, print_warning, say
from .shared.studies import (
    check_cells,
    make_all,
    print_comparisons,
    print_rows,
    report_stop,
    study_json,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from ..studies.comparison import Comparing
    from ..studies.study import CellFilter, Study


PAPER = "paper"
"""The study that draws the figures of the paper; the lab has it."""


def study(
    file: Annotated[
        Path, typer.Argument(help="The study file; or 'paper': redraw the paper's figures.")
    ],
    seeds: StudySeeds = "",
    where: Annotated[
        list[str] | None,
        typer.Option(help="Only part of the grid: axis=value, task=..., arm=... Repeatable."),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check everything and count the runs; run nothing.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results; by default results/NAME.")
    ] = None,
    workers: Workers = 0,
    cluster: Cluster = "",
    compared: Annotated[
        str,
        typer.Option(
            "--compare",
            help="The axis whose settings are compared seed by seed, and the base: arm=paper. "
            "By default the arms, or the first axis, with the first value.",
        ),
    ] = "",
    detect: Annotated[
        list[str] | None,
        typer.Option(
            help="Difference for which the number of seeds needed is reported: 5%, or peak_tilt_deg=2. "
            "By default the measured one. Repeatable."
        ),
    ] = None,
    number: Annotated[
        int,
        typer.Option("--open", help="Record run N of the worst runs (worst.md), and show it."),
    ] = 0,
    no_show: Annotated[
        bool, typer.Option("--no-show", help="With --open: only write the recording.")
    ] = False,
    as_json: JsonBesideTables = False,
) -> None:
    """Run a study: every graph, arm and grid point with every seed, on all cores.

    Runs that were made before are not made again, so a study that was stopped or killed continues
    where it ended. Settings are compared over equal seeds. 'aloft tune' searches the parameters of a
    study's arms, 'aloft falsify' the worst case, and 'aloft sensitivity' ranks parameters. Exits with 0 when all goals are met, 1 when one is missed, 3 when a run broke.

    'aloft study paper' makes the runs of the paper's figures, draws them into docs (or --out), and
    writes the page about them there.
    """
    from ..runtime.language.extensions import provided
    from ..studies.batch.seeds import parse_seeds
    from ..studies.comparison import Comparing, compared_axis, read_detect
    from ..studies.reading import read_study, rows_where

    screen = console(to_stderr=as_json)
    with errors_reported(as_json):
        if number and (dry_run or cluster):
            raise AloftError("--open takes --where, --seeds, --out, --no-show and --json")
        if no_show and not number:
            raise AloftError("--no-show would do nothing; add --open N")
        if file == Path(PAPER) and not file.exists():
            if where or dry_run or cluster:
                raise AloftError(
                    f"'aloft study {PAPER}' takes --out, --seeds, --workers and --json"
                )
            draw_paper = provided("study_paper")
            raise typer.Exit(draw_paper(out, seeds, workers, screen, as_json))
        found = read_study(file)
        chosen = parse_seeds(seeds) if seeds else list(found.seeds)
        folder = out or Path("results") / found.name
        part = rows_where(found, where or [])
        if number:
            from .shared.studies import open_run

            raise typer.Exit(
                open_run(found, part, chosen, folder, number, screen, as_json, show=not no_show)
            )
        comparing = Comparing(*compared_axis(found, compared), read_detect(detect or []))
        code = run_study(
            found, part, chosen, folder, workers, cluster, screen, as_json, comparing,
            dry_run=dry_run,
        )  # fmt: skip
    raise typer.Exit(code)


def run_study(
    found: Study,
    part: CellFilter,
    seeds: Sequence[int],
    folder: Path,
    workers: int,
    cluster: str,
    screen: Console,
    as_json: bool,
    comparing: Comparing,
    *,
    dry_run: bool = False,
) -> ExitCode:
    """Make the study's runs; write and print the results."""
    from ..studies.charts import write_plots
    from ..studies.comparison import compare
    from ..studies.execution import Run
    from ..studies.expansion import cells as expand
    from ..studies.journal import Journal
    from ..studies.summary import make_table, summarise, write_table
    from ..studies.tuning import extreme_cells, read_tuned, tuned_path, tuning_cells
    from ..studies.worst import write_page

    tuned = {} if dry_run and not tuned_path(found).is_file() else read_tuned(found)
    chosen = [cell for cell in expand(found, tuned) if part.takes(cell.labels)]
    cells = check_cells(found, chosen, screen)
    if dry_run and found.tuning is not None:
        tried = tuning_cells(found)
        check_cells(found, [*tried, *extreme_cells(found, tried)], screen)
    runs = [Run(cell, seed) for cell in cells for seed in seeds]
    if dry_run:
        reason = f"{len(cells)} cells and {len(seeds)} seeds: {len(runs)} runs; no problems"
        say(screen, f"{found.path}: {reason}")
        if as_json:
            print_json({"success": True, "reason": reason, "cells": len(cells), "runs": len(runs)})
        return ExitCode.SUCCESS
    with Journal(folder / "runs.jsonl") as journal:
        stopped = make_all(runs, journal, workers, cluster, screen, f"study {found.name}")
        if isinstance(stopped, signal.Signals):
            return report_stop(stopped, runs, journal, screen, as_json)
        done = stopped
    rows = summarise(found, done)
    comparisons = compare(found, done, comparing)
    write_table(folder / "runs.parquet", make_table(done))
    page = write_page(found, done, folder / "worst.md")
    result = study_json(found, rows, seeds, folder)
    plots, undrawn = write_plots(found, done, rows, folder)
    result["comparisons"] = [each.to_json() for each in comparisons]
    result["tuned"], result["worst"] = tuned, str(page)
    result["plots"] = {name: str(path) for name, path in plots.items()}
    (folder / "summary.json").write_text(json_text(result), encoding="utf-8")
    print_rows(screen, found, rows, seeds)
    print_comparisons(screen, comparisons)
    say(screen, f"table: {folder / 'runs.parquet'}; summary: {folder / 'summary.json'}")
    say(screen, f"worst runs: {page}; to see the first: aloft study {found.path} --open 1")
    for path in plots.values():
        say(screen, f"picture: {path}")
    for problem in undrawn:
        print_warning(problem)
    if as_json:
        print_json(result)
    elif result["success"]:
        typer.secho(result["reason"], fg=typer.colors.GREEN)
    else:
        typer.secho(result["reason"], fg=typer.colors.RED, err=True)
    if any(row.errors for row in rows):
        return ExitCode.RUN_FAILED
    missed = any(row.met is False for row in rows)
    return ExitCode.NOT_SUCCESSFUL if missed else ExitCode.SUCCESS


def json_text(value: dict[str, Any]) -> str:
    """Write the text of a JSON file; numbers that are not finite become null."""
    import json

    from .shared.output import plain

    return json.dumps(plain(value), allow_nan=False, indent=1) + "\n"
