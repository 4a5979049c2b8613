"""``aloft falsify``: search the worst case of a study, make it simple, and keep it as a test."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import Cluster, JsonBesideTables, RunsFolder, Workers
from ....cli.shared.output import (
    console,
    errors_reported,
    number,
    print_json,
    print_warning,
    say,
    table,
)
from ....cli.shared.studies import check_cells, report_stop, run_maker
from ....runtime.language.errors import AloftError, ExitCode

if TYPE_CHECKING:
    from rich.console import Console

    from ....studies.study import Study
    from ..studies.falsification import Attempt, Search


def falsify(
    file: Annotated[Path, typer.Argument(help="The study file, which has a section 'falsify'.")],
    draws: Annotated[
        int, typer.Option(min=0, help="How many sets of parameters; by default the study's.")
    ] = 0,
    seed: Annotated[
        int | None, typer.Option(min=0, help="Of the search; by default the study's.")
    ] = None,
    random: Annotated[
        bool, typer.Option("--random", help="Draw at random, to compare with at equal cost.")
    ] = False,
    keep: Annotated[
        bool, typer.Option("--keep", help="Make the failure a test that 'aloft test' runs.")
    ] = False,
    output: Annotated[
        Path | None,
        typer.Option(
            "--test", help="With --keep: the test; by default test_NAME_falsified.py in tests/."
        ),
    ] = None,
    out: RunsFolder = None,
    workers: Workers = 0,
    cluster: Cluster = "",
    as_json: JsonBesideTables = False,
) -> None:
    """Search the worst case in a study's ranges of parameters, and make it simple (extra 'tune').

    The study says which parameters vary, how near a run is to failing, and perhaps whose smallest
    value that fails is searched. A search that was stopped continues where it ended. Exits with 1 when a run fails.
    """
    from ....studies.journal import Journal
    from ....studies.reading import read_study
    from ..studies import falsification

    screen = console(to_stderr=as_json)
    with errors_reported(as_json):
        study = read_study(file)
        if study.falsification is None:
            raise AloftError(f"{study.path} has no section 'falsify'")
        if output is not None and not keep:
            raise AloftError("--test goes with --keep")
        section = study.falsification
        section = replace(
            section, draws=draws or section.draws, seed=section.seed if seed is None else seed
        )
        study = replace(study, falsification=section)
        tried = falsification.searched_cells(study)
        if not tried:
            raise AloftError(f"{study.path}: 'where' of 'falsify' leaves nothing to run")
        both = [*tried, *falsification.end_cells(study, tried)]
        checked = check_cells(study, both, screen)[: len(tried)]
        total = section.draws * len(checked) * len(section.seeds or study.seeds)
        found, simplest = None, None
        with Journal((out or Path("results") / study.name) / "falsify.jsonl") as journal:
            text = f"falsifying {study.name}"
            with run_maker(journal, workers, cluster, screen, text, total) as make:
                found = falsification.search(study, checked, make, random=random)
                searched = len(make.made)
                if found.worst.failed:
                    labels = found.worst.worst.cell.labels
                    base = next(cell for cell in checked if cell.labels == labels)
                    simplest = falsification.simplify(study, found.worst, base, make)
            if make.stopped is not None:
                raise typer.Exit(report_stop(make.stopped, make.asked, journal, screen, as_json))
        assert found is not None
        result = search_json(study, found, random) | {"runs": searched}
        print_search(screen, study, found, result["reason"])
        if simplest is not None:
            result["runs_to_simplify"] = len(make.made) - searched
            result["simplest"] = attempt_json(simplest) | show(
                study, simplest, screen, keep, output
            )
    if as_json:
        print_json(result)
    raise typer.Exit(ExitCode.SUCCESS if result["success"] else ExitCode.NOT_SUCCESSFUL)


def show(
    study: Study, simplest: Attempt, screen: Console, keep: bool, output: Path | None
) -> dict[str, Any]:
    """Print the simplest failure as a graph, after running it once more, and keep it if asked to."""
    from ....runtime.graph import Graph
    from ....runtime.loading import checked_text
    from ..studies import falsification

    folder = Path()
    if keep:
        tests = Path("tests") if Path("tests").is_dir() else Path()
        output = output or tests / f"test_{study.name}_falsified.py"
        folder = output.parent
    outcome = simplest.worst.outcome
    assert outcome is not None
    text = falsification.graph_text(study, simplest, folder)
    again = Graph(checked_text(text, folder / "falsified.yaml")).run(log=False)
    same = again.run_hash == outcome.run_hash
    if not same:
        print_warning("the graph gave other bytes than the run of the search")
    say(screen, f"the simplest failure, {outcome.reason}:\n\n{text}")
    told: dict[str, Any] = {"graph": text, "same_bytes": same}
    if output is not None:
        test, graph = falsification.keep(text, outcome.reason, output)
        say(screen, f"kept: {test} with {graph}; to run it: aloft test {test}")
        told |= {"test": str(test), "graph_file": str(graph)}
    return told


def attempt_json(each: Attempt) -> dict[str, Any]:
    """Return an attempt and its worst run as plain data."""
    run = each.worst
    assert run.outcome is not None
    return {
        "draw": each.number, "set": dict(each.values), "margin": each.margin, "value": each.value,
        "task": run.cell.task, "arm": run.cell.arm, **run.cell.coordinates, "seed": run.seed,
        "success": run.outcome.success, "reason": run.outcome.reason,
        "run_hash": run.outcome.run_hash,
    }  # fmt: skip


def search_json(study: Study, found: Search, random: bool) -> dict[str, Any]:
    """Return the search as one JSON object."""
    section, worst = study.falsification, found.worst
    assert section is not None
    first = next((each.number for each in found.attempts if each.failed), None)
    n = len(found.attempts)
    reason = f"{found.failures} of {n} draws failed"
    if not found.failures:
        reason += f"; the least margin is {worst.margin:.3g}"
    elif first == 0:
        reason = "the graph fails as it is written"
    return {
        "success": not worst.failed,
        "reason": reason,
        "study": study.name,
        "method": "random" if random else "tpe",
        "seed": section.seed,
        "seeds": list(section.seeds or study.seeds),
        "draws": n,
        "failures": found.failures,
        "first_failure": first,
        "progress": [{"draw": e.number, "value": e.value, "failed": e.failed} for e in found.progress],
        "worst": attempt_json(worst),
        "simplest": None,
    }  # fmt: skip


MOST_STEPS = 12


def print_search(screen: Console, study: Study, found: Search, reason: str) -> None:
    """Print how the search came to its worst attempt."""
    section = study.falsification
    assert section is not None
    keys = [each.key for each in section.ranges]
    rows = [
        (
            str(each.number),
            *(str(each.values.get(key, "")) for key in keys),
            "fails" if each.failed else f"margin {number(each.margin)}",
            each.worst.outcome.reason if each.worst.outcome and each.failed else "",
        )
        for each in found.progress[-MOST_STEPS:]
    ]
    screen.print(table(study.title, (">draw", *keys, "", "why"), rows))
    say(screen, reason)
