"""``aloft study paper``: the paper's figures from our own runs, and the page about them."""

from __future__ import annotations

import json
import signal
import subprocess
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from ...cli.shared.output import plain, print_json, print_warning, say
from ...runtime.language.errors import AloftError, ExitCode

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from ...studies.execution import Run
    from ...studies.journal import Journal
    from ..figures.trace import Trace


NAME = "paper"
STANDS_TILT = 5.0
STUDY = Path(__file__).parents[2] / "graphs" / "studies" / "paper.yaml"


def draw_paper(
    out: Path | None,
    seeds: str,
    workers: int,
    screen: Console,
    as_json: bool,
    study: Path = STUDY,
) -> ExitCode:
    """Make the missing runs of ``study``, draw all figures, and write the page about them.

    The pictures, ``paper.json`` and ``paper.md`` go into ``out``, by default ``docs``. The pictures
    show the runs of the first seed, which are made every time. All other runs are kept in
    ``results/paper`` or, with ``out``, in its folder ``runs``.
    """
    from ...cli.shared.studies import check_cells, make_all, report_stop
    from ...studies.batch.seeds import parse_seeds
    from ...studies.execution import Run
    from ...studies.expansion import cells as expand
    from ...studies.journal import Journal
    from ...studies.reading import read_study
    from ...studies.summary import make_table, summarise, write_table
    from ..figures.paper import draw, page

    found = read_study(study)
    chosen = parse_seeds(seeds) if seeds else list(found.seeds)
    cells = check_cells(found, list(expand(found)), screen)
    runs = [Run(cell, seed) for cell in cells for seed in chosen]
    kept, folder = (out / "runs" if out else Path("results") / NAME), out or Path("docs")
    with Journal(kept / "runs.jsonl") as journal:
        traces = traced(runs, chosen[0], journal, workers, screen)
        done = make_all(runs, journal, workers, "", screen, "the paper's figures")
        if isinstance(done, signal.Signals):
            return report_stop(done, runs, journal, screen, as_json)
    rows = summarise(found, done)
    write_table(kept / "runs.parquet", make_table(done))
    folder.mkdir(parents=True, exist_ok=True)
    results = plain(draw(traces, rows, stands_by_task(done), chosen, folder))
    results["commit"] = commit_of_code()
    text = json.dumps(results, indent=1, allow_nan=False) + "\n"
    (folder / "paper.json").write_text(text, encoding="utf-8")
    (folder / "paper.md").write_text(page(results), encoding="utf-8")
    for name, figure in results["figures"].items():
        if figure["drawn"]:
            say(screen, f"picture: {folder / figure['file']}")
        else:
            print_warning(f"no figure {name}: {figure['reason']}")
    say(screen, f"page: {folder / 'paper.md'}; numbers: {folder / 'paper.json'}")
    broken = sum(row.errors for row in rows)
    if as_json:
        print_json({"success": not broken, "reason": f"{broken} runs broke", **results})
    return ExitCode.RUN_FAILED if broken else ExitCode.SUCCESS


def stands_by_task(runs: Sequence[Run]) -> dict[str, int]:
    """Return how many runs of each task stand at the end: no fall, and a tilt below 5 degrees. A run that was ended by a
    fall has no final tilt."""
    found: dict[str, int] = {}
    for run in runs:
        tilt = None if run.outcome is None else run.outcome.metrics.get("final_tilt_deg")
        stands = isinstance(tilt, int | float) and tilt < STANDS_TILT
        found[run.cell.task] = found.get(run.cell.task, 0) + stands
    return found


def commit_of_code() -> str:
    """Return the commit of the checkout that runs; empty where there is none."""
    found = subprocess.run(
        ["git", "rev-parse", "HEAD"], cwd=STUDY.parent, capture_output=True, text=True, check=False
    )
    return found.stdout.strip()


def traced(
    runs: Sequence[Run], seed: int, journal: Journal, workers: int, screen: Console
) -> dict[str, Trace]:
    """Make the runs with that seed and return their signals, by task. Their outcomes are added to
    the journal.

    Raises:
        AloftError: one of them broke.
    """
    from ...cli.shared.output import progress_bar
    from ...processes.child_process import processors
    from ...studies.batch.jobs import job_results
    from ...studies.expansion import job
    from ..figures.trace import make_trace

    shown = [run for run in runs if run.seed == seed]
    jobs = [(run.cell.task, job(run.cell, seed)) for run in shown]
    count = min(workers or processors(), len(jobs))
    found: dict[str, Trace] = {}
    with (
        closing(job_results(make_trace, jobs, workers=count)) as results,
        progress_bar(screen, "runs with all signals", len(jobs)) as (bar, task),
    ):
        for result in results:
            if result.error:
                raise AloftError(f"no figures: {result.error}")
            run, trace = shown[result.index], result.value
            found[run.cell.task] = trace
            if run.key not in journal.outcomes:
                journal.add(run.key, trace.outcome)
            bar.advance(task)
    return found
