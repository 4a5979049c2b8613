"""Sensitivity of a metric, for ``aloft sensitivity``: the runs, the table and the chart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import Cluster, JsonBesideTables, RunsFolder, StudySeeds, Workers
from ....cli.shared.output import console, errors_reported, number, print_json, say, table
from ....cli.shared.studies import check_cells, report_stop, run_maker
from ....runtime.language.errors import AloftError, ExitCode

if TYPE_CHECKING:
    from rich.console import Console

    from ....mathematics.arrays import Array
    from ....studies.study import CellFilter, Study
    from ..studies.sensitivity import Effect


def sensitivity(
    file: Annotated[Path, typer.Argument(help="The study file.")],
    metric: Annotated[
        str,
        typer.Argument(
            help="The metric by whose change the graph's numeric parameters are ranked, or 'success'."
        ),
    ],
    vary: Annotated[
        list[str] | None, typer.Option(help="Only these parameters, such as 'wbc.*'. Repeatable.")
    ] = None,
    spread: Annotated[
        float, typer.Option(min=1e-6, max=1.0, help="Relative variation of each parameter.")
    ] = 0.2,
    trajectories: Annotated[
        int, typer.Option(min=2, help="Elementary effects of each parameter.")
    ] = 4,
    sobol: Annotated[int, typer.Option(min=0, help="Sobol indices of the first N.")] = 0,
    samples: Annotated[
        int, typer.Option(min=8, help="With --sobol: samples, a power of two; N + 2 runs each.")
    ] = 64,
    seeds: StudySeeds = "",
    where: Annotated[
        list[str] | None,
        typer.Option(help="The cell of the grid: axis=value, task=..., arm=... Repeatable."),
    ] = None,
    out: RunsFolder = None,
    workers: Workers = 0,
    cluster: Cluster = "",
    as_json: JsonBesideTables = False,
) -> None:
    """Rank the numeric parameters of a graph by their effect on a metric (extra 'analysis').

    Elementary effects after Morris rank all of them, Sobol indices those that matter most.
    """
    from ....studies.batch.seeds import parse_seeds
    from ....studies.reading import read_study, rows_where

    screen = console(to_stderr=as_json)
    with errors_reported(as_json):
        found = read_study(file)
        options = SensitivityOptions(metric, vary, spread, trajectories, sobol, samples)
        chosen = parse_seeds(seeds) if seeds else list(found.seeds)
        folder = out or Path("results") / found.name
        code = rank_parameters(
            found, rows_where(found, where or []), chosen, folder, workers, cluster, options, screen,
            as_json,
        )  # fmt: skip
    raise typer.Exit(code)


@dataclass(frozen=True)
class SensitivityOptions:
    """The question: a metric, and how the parameters are varied; see ``sensitivity``."""

    metric: str
    vary: list[str] | None
    spread: float
    trajectories: int
    sobol: int
    samples: int


def rank_parameters(
    found: Study, part: CellFilter, seeds: Sequence[int], folder: Path, workers: int, cluster: str,
    options: SensitivityOptions, screen: Console, as_json: bool,
) -> ExitCode:  # fmt: skip
    """Make the runs, print the ranking, and draw it.

    Raises:
        AloftError: the study has several cells, nothing varies, or there is no such metric.
    """
    from ....studies.expansion import cells as expand
    from ....studies.journal import Journal
    from ..studies.sensitivity import (
        as_data,
        elementary_effects,
        import_salib,
        metric_at,
        numeric_parameters,
        sobol_indices,
        write_chart,
    )

    import_salib()
    if options.samples & (options.samples - 1):
        raise AloftError(f"--samples {options.samples} is no power of two")
    chosen = [cell for cell in expand(found) if part.takes(cell.labels)]
    if len(chosen) != 1:
        raise AloftError(
            f"sensitivities are those of one cell, and {len(chosen)} are chosen: --where AXIS=VALUE"
        )
    (cell,) = check_cells(found, chosen, screen)
    with screen.status("loading the graph with every parameter at the ends of its range"):
        varied, left = numeric_parameters(cell, options.spread, options.vary or ("*",))
    if len(varied) < 2:
        raise AloftError(f"fewer than two numeric parameters vary: {[v.key for v in varied]}")
    runs = options.trajectories * (len(varied) + 1) * len(seeds)
    some = min(options.sobol, len(varied))
    runs += options.samples * (some + 2) * len(seeds) if some else 0
    title = f"{found.name}: {options.metric} within {100.0 * options.spread:g} %"
    with Journal(folder / "sensitivity.jsonl") as journal:
        with run_maker(
            journal, workers, cluster, screen, f"sensitivity of {found.name}", runs
        ) as make:

            def evaluate(points: Array) -> Array:
                return metric_at(points, names, options.metric, cell, seeds, make)

            names = varied
            effects = elementary_effects(varied, evaluate, options.trajectories, seed=0)
            if some:
                first = [each.key for each in effects[:some]]
                names = [v for v in varied if v.key in first]
                indices = sobol_indices(names, evaluate, options.samples, seed=0)
                effects = [_with_indices(each, indices.get(each.key)) for each in effects]
        if make.stopped is not None:
            return report_stop(make.stopped, make.asked, journal, screen, as_json)
    plots = write_chart(effects, title, folder)
    idle = [each.key for each in effects if each.mean_size == 0.0]
    if as_json:
        print_json({
            "success": True, "study": found.name, "metric": options.metric,
            "spread": options.spread, "seeds": list(seeds), "trajectories": options.trajectories,
            "runs": len(make.made), "effects": as_data(effects), "without_effect": idle,
            "not_varied": left, "plots": plots,
        })  # fmt: skip
        return ExitCode.SUCCESS
    show(effects, title, screen)
    say(
        screen,
        f"{len(idle)} of {len(effects)} parameters have no effect; {len(left)} could not be varied",
    )
    say(screen, f"{len(make.made)} runs; picture: {plots['svg']}")
    return ExitCode.SUCCESS


def _with_indices(effect: Effect, indices: tuple[float, float, float, float] | None) -> Effect:
    if indices is None:
        return effect
    first, first_interval, total, total_interval = indices
    return replace(
        effect, first=first, first_interval=first_interval, total=total, total_interval=total_interval
    )  # fmt: skip


MOST_ROWS = 20


def show(effects: Sequence[Effect], title: str, screen: Console) -> None:
    """Print the parameters with the largest effects."""

    def cell(value: Any, interval: Any) -> str:
        return "" if value is None else f"{number(value)} +- {number(interval)}"

    rows = [
        (e.key, cell(e.mean_size, e.mean_size_interval), number(e.mean), number(e.spread),
         cell(e.first, e.first_interval), cell(e.total, e.total_interval))
        for e in effects[:MOST_ROWS]
    ]  # fmt: skip
    columns = (
        "parameter",
        ">mean size of effects",
        ">mean",
        ">spread",
        ">first index",
        ">total index",
    )
    screen.print(table(title, columns, rows))
