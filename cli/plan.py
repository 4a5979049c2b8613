"""``aloft plan``: plans a jump or a grid of jumps, with a table, a picture and a recording of each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..runtime.language.errors import ExitCode
from .shared.options import JsonBesideTables, expand_option_groups
from .shared.output import console, errors_reported, print_json, say
from .shared.planning import (
    listed_row,
    listing,
    plan_grid,
    plan_task,
    summary,
)
from .shared.rehearsal import LANDING_HELP, REHEARSE_HELP, rehearsal_of_file

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True)
class PlanLibraryOptions:
    """The library of plans, and what becomes of the plans in it."""

    keep: Annotated[
        Path | None,
        typer.Option(help="The library's folder, where plans are kept; by default your cache."),
    ] = None
    anew: Annotated[
        bool,
        typer.Option(
            "--anew",
            help="Ignore stored plans and solve from scratch; in a grid: retry what failed before.",
        ),
    ] = False
    listed: Annotated[bool, typer.Option("--list", help="List the stored plans.")] = False
    prune: Annotated[
        bool,
        typer.Option("--prune", help="Remove the plans of all other tasks from --keep."),
    ] = False


@dataclass(frozen=True)
class PoolOptions:
    """The processes or the cluster that plan a grid."""

    workers: Annotated[
        int, typer.Option(help="Worker processes for a grid; 0: one per core.", min=0)
    ] = 0
    cluster: Annotated[
        str, typer.Option(help="Plan a grid on the Dask scheduler at this address.")
    ] = ""


@dataclass(frozen=True)
class SearchOptions:
    """The options of planning a task."""

    nearest: Annotated[
        bool,
        typer.Option(
            help="Where a task has no plan, search for the nearest one that has; up to 6 s of CPU."
        ),
    ] = True
    rehearse: Annotated[bool, typer.Option("--rehearse", help=REHEARSE_HELP)] = False
    rehearse_landing: Annotated[bool, typer.Option("--rehearse-landing", help=LANDING_HELP)] = False


@expand_option_groups
def plan(
    tasks: Annotated[list[Path] | None, typer.Argument(help="Task files.")] = None,
    grid: Annotated[
        Path | None, typer.Option("--library", help="Plan every task of this grid file, resumably.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for pictures and recordings.")] = Path("plans"),
    *,
    library: PlanLibraryOptions,
    pool: PoolOptions,
    no_pictures: Annotated[
        bool, typer.Option("--no-pictures", help="Write no picture and no recording.")
    ] = False,
    search: SearchOptions,
    as_json: JsonBesideTables = False,
) -> None:
    """Plan jumps, check each with exact dynamics, and keep the valid ones in the plan library."""
    if bool(tasks) + (grid is not None) + library.listed != 1:
        raise typer.BadParameter("give task files, or --library with a grid file, or --list")
    if library.prune and (library.keep is None or not tasks):
        raise typer.BadParameter("--prune goes with task files and --keep")
    if search.rehearse and search.rehearse_landing:
        raise typer.BadParameter("give --rehearse or --rehearse-landing")
    if (search.rehearse or search.rehearse_landing) and not tasks:
        named = "--rehearse" if search.rehearse else "--rehearse-landing"
        raise typer.BadParameter(f"{named} goes with task files")
    screen = console(to_stderr=as_json)
    with errors_reported(as_json):
        if library.listed:
            code = list_plans(library.keep, screen, as_json)
        elif grid is not None:
            code = plan_grid(
                grid, library.keep, library.anew, pool.workers, pool.cluster, screen, as_json
            )
        else:
            folder = None if no_pictures else out
            code = plan_tasks(tasks or [], library, folder, search, screen, as_json)
    raise typer.Exit(code)


def plan_tasks(
    paths: list[Path],
    kept: PlanLibraryOptions,
    out: Path | None,
    search: SearchOptions,
    screen: Console,
    as_json: bool,
) -> ExitCode:
    """Plan each task file, also after one has failed. All files are read before anything is planned.

    Raises:
        JumpTaskError: what is wrong with any of them.
    """
    from ..planner.library.library import PlanLibrary
    from ..planner.task.files import JumpTaskError
    from ..planner.task.read_task import read_task
    from ..robots.description import find_robot

    tasks, wrong = [], []
    for path in paths:
        try:
            tasks.append(read_task(path))
        except JumpTaskError as error:
            wrong.append(str(error))
    if wrong:
        raise JumpTaskError("\n".join(wrong))
    rows: list[dict[str, Any]] = []
    for path, task in zip(paths, tasks, strict=True):
        library = PlanLibrary(find_robot(task.robot, path.parent), kept.keep)
        row = plan_task(task, library, kept.anew, out, search.nearest, screen)
        if row["success"]:
            landing = search.rehearse_landing
            wanted = search.rehearse or landing
            row |= rehearsal_of_file(path, task, library, kept.keep, wanted, screen, landing)
        rows.append(row)
    failed = [row["task"] for row in rows if not row["success"]]
    if kept.prune and not failed:
        for name in dict.fromkeys(task.robot for task in tasks):
            own = [task for task in tasks if task.robot == name]
            for path in PlanLibrary(find_robot(name), kept.keep).prune(own):
                say(screen, f"removed: {path}")
    reason = f"not planned: {', '.join(failed)}" if failed else f"{len(rows)} planned and valid"
    if len(rows) > 1:
        screen.print(summary(rows))
    if as_json:
        print_json({"success": not failed, "reason": reason, "plans": rows})
    return ExitCode.NOT_SUCCESSFUL if failed else ExitCode.SUCCESS


def list_plans(keep: Path | None, screen: Console, as_json: bool) -> ExitCode:
    """Print every plan of the library: its task, what it does, and its file."""
    from ..planner.library.library import PlanLibrary
    from ..robots.description import find_robot

    library = PlanLibrary(find_robot("bruce"), keep)
    rows = [listed_row(path, header) for path, header in library.headers()]
    screen.print(listing(rows))
    if as_json:
        print_json({"success": True, "reason": f"{len(rows)} plans", "plans": rows})
    return ExitCode.SUCCESS
