"""``aloft plan``: plan a jump, or a grid of them; table, picture and recording of what came out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..runtime.errors import ExitCode
from .output import console, errors_reported, number, print_error, print_json, say, table
from .plan_grid import plan_grid
from .plan_output import failure, plan_json, print_plan, recorded_motion
from .run import viewer

if TYPE_CHECKING:
    from rich.console import Console

    from ..blocks.planner.plan import JumpPlan
    from ..blocks.planner.task import JumpTask
    from ..runtime.description import RobotDescription


def plan(
    tasks: Annotated[list[Path] | None, typer.Argument(help="Task files.")] = None,
    grid: Annotated[
        Path | None, typer.Option("--library", help="Plan every task of this grid file, resumably.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for pictures and recordings.")] = Path("plans"),
    keep: Annotated[
        Path | None, typer.Option(help="Library folder plans are kept in; default: your cache.")
    ] = None,
    anew: Annotated[
        bool,
        typer.Option(
            "--anew",
            help="Solve also what is kept, from nothing; in a grid: try again what failed before.",
        ),
    ] = False,
    workers: Annotated[int, typer.Option(help="Processes for a grid; 0: one a core.", min=0)] = 0,
    cluster: Annotated[
        str, typer.Option(help="Plan a grid on the Dask scheduler at this address.")
    ] = "",
    no_pictures: Annotated[
        bool, typer.Option("--no-pictures", help="Write no picture and no recording.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Tables go to standard error, one JSON object to output.")
    ] = False,
) -> None:
    """Plan jumps, check each with exact dynamics, and keep the valid ones in the plan library."""
    if bool(tasks) == (grid is not None):
        raise typer.BadParameter("give task files, or --library with a grid file")
    screen = console(to_stderr=as_json)
    with errors_reported(as_json):
        if grid is not None:
            code = plan_grid(grid, keep, anew, workers, cluster, screen, as_json)
        else:
            folder = None if no_pictures else out
            code = plan_tasks(tasks or [], keep, anew, folder, screen, as_json)
    raise typer.Exit(code)


def plan_tasks(
    paths: list[Path],
    keep: Path | None,
    anew: bool,
    out: Path | None,
    screen: Console,
    as_json: bool,
) -> ExitCode:
    """Plan each task file; all of them, even where one fails."""
    from ..blocks.planner.task import read_task
    from ..runtime.description import find_robot

    rows: list[dict[str, Any]] = []
    for path in paths:
        task = read_task(path)
        robot = find_robot(task.robot, path.parent)
        rows.append(plan_task(task, robot, keep, anew, out, screen))
    failed = [row["task"] for row in rows if not row["success"]]
    reason = f"not planned: {', '.join(failed)}" if failed else f"{len(rows)} planned and valid"
    if len(rows) > 1:
        cells = [
            (r["task"], "yes" if r["success"] else "no", number(r.get("cpu_s", "")), r["reason"])
            for r in rows
        ]
        screen.print(table("", ("task", "valid", ">CPU [s]", "what came of it"), cells))
    if as_json:
        print_json({"success": not failed, "reason": reason, "plans": rows})
    return ExitCode.NOT_SUCCESSFUL if failed else ExitCode.SUCCESS


def plan_task(
    task: JumpTask, robot: RobotDescription, keep: Path | None, anew: bool, out: Path | None,
    screen: Console,
) -> dict[str, Any]:  # fmt: skip
    """Plan one task; print it, picture it, and return its row."""
    from ..blocks.planner.errors import PlanError
    from ..blocks.planner.library import PlanLibrary
    from ..blocks.planner.validity import InvalidPlanError

    library = PlanLibrary(robot, keep)
    found: JumpPlan | None = None
    try:
        with screen.status(f"planning {task.name}") as status:
            found, kept = library.plan(task, solver_with_progress(status.update), anew=anew)
        reason = "kept from before" if kept else "planned"
    except InvalidPlanError as error:
        found, kept, reason = error.plan, False, str(error)
    except PlanError as error:
        print_error(str(error))
        return failure(task, robot, error)
    row = plan_json(found, robot, library.path_of(task), kept, reason)
    print_plan(screen, found)
    if not found.valid:
        print_error(reason)
    if out is not None:
        row |= write_pictures(found, robot, out, screen)
    if row["path"]:
        say(screen, f"plan: {row['path']} ({reason})")
    return row


def solver_with_progress(tell: Any) -> Any:
    """The planner, which tells what it is compiling."""
    from ..blocks.planner.solve import solve_jump

    def make(task: JumpTask, robot: RobotDescription, warm_start: JumpPlan | None) -> JumpPlan:
        def progress(text: str, done: int, total: int) -> None:
            tell(f"planning {task.name}: {text} ({done} of {total})")

        return solve_jump(task, robot, warm_start=warm_start, progress=progress)

    return make


def write_pictures(
    found: JumpPlan, robot: RobotDescription, out: Path, screen: Console
) -> dict[str, str]:
    """The picture and the recording of a plan."""
    from ..blocks.planner.picture import write_picture
    from ..logs.motion_recording import write_motion

    name = found.task.name
    picture = write_picture(out / f"{name}.svg", found, robot)
    recording = write_motion(out / f"{name}.rrd", recorded_motion(found, robot), name)
    say(screen, f"picture: {picture}")
    say(screen, f"recording: {recording}; to see it: {viewer()} {recording}")
    return {"picture": str(picture), "recording": str(recording)}
