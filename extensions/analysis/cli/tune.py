"""``aloft tune``: search the parameters of a study's graphs with Optuna, against the study's score."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ....cli.shared.options import Cluster, JsonBesideTables, RunsFolder, Workers
from ....cli.shared.output import console, errors_reported, print_json, say
from ....cli.shared.studies import (
    check_cells,
    print_tuned,
    report_stop,
    run_maker,
    tuned_json,
)
from ....runtime.language.errors import AloftError, ExitCode


def tune(
    file: Annotated[Path, typer.Argument(help="The study file, which has a section 'tune'.")],
    out: RunsFolder = None,
    workers: Workers = 0,
    cluster: Cluster = "",
    as_json: JsonBesideTables = False,
) -> None:
    """Search the best parameters of every arm of a study with Optuna (extra 'tune').

    The study says what is searched: ranges, graphs, seeds and the number of draws. A search that
    was stopped continues where it ended. What is found goes into a file beside the study, from which 'aloft study FILE' takes it.
    """
    from ....studies import tuning
    from ....studies.journal import Journal
    from ....studies.reading import read_study

    screen = console(to_stderr=as_json)
    with errors_reported(as_json):
        found = read_study(file)
        if found.tuning is None:
            raise AloftError(f"{found.path} has no section 'tune'")
        tried = tuning.tuning_cells(found)
        if not tried:
            raise AloftError(f"{found.path}: 'where' of 'tune' leaves nothing to run")
        both = [*tried, *tuning.extreme_cells(found, tried)]
        checked = check_cells(found, both, screen)[: len(tried)]
        folder = out or Path("results") / found.name
        total = tuning.runs_of_search(found, checked)
        stopped: dict[str, int] = {}

        def count(arm: str, draw: tuning.Draw) -> None:
            stopped[arm] = stopped.get(arm, 0) + draw.stopped

        with Journal(folder / "tuning.jsonl") as journal:
            best = None
            with run_maker(
                journal, workers, cluster, screen, f"tuning {found.name}", total
            ) as make:
                best = tuning.search(found, checked, make, count)
            if best is None:
                assert make.stopped is not None
                raise typer.Exit(report_stop(make.stopped, make.asked, journal, screen, as_json))
        path = tuning.write_tuned(found, best, stopped)
        print_tuned(screen, found, best)
        if found.tuning.race:
            told = ", ".join(f"{count} of {arm}" for arm, count in stopped.items())
            say(screen, f"draws that were stopped as they could no longer win: {told}")
        say(screen, f"tuned parameters: {path}")
        if as_json:
            broken = sum(bool(run.outcome and run.outcome.error) for run in make.made)
            print_json(tuned_json(found, best, path, broken))
    raise typer.Exit(ExitCode.SUCCESS)
