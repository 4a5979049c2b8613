"""``aloft plan --library``: plan a grid of jumps into a library, on all cores or on a cluster."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from ...runtime.language.errors import ExitCode
from ..shared.output import print_json, say, table
from ..shared.stopping import stopped_by_signals
from .plan_output import failure_rows

if TYPE_CHECKING:
    from rich.console import Console

    from ...planner.library.library import PlanLibrary
    from ...planner.task.task import JumpTask
    from ...studies.batch.plan_grid import GridRow


def plan_grid(
    grid: Path,
    keep: Path | None,
    anew: bool,
    workers: int,
    cluster: str,
    screen: Console,
    as_json: bool,
) -> ExitCode:
    """Fill the library with a grid of tasks. If a signal stops it, print how much is done."""
    from ...planner.library.library import PlanLibrary
    from ...studies.batch.plan_grid import fill, read_grid, robot_of
    from ..shared.progress import progress_bar

    tasks = read_grid(grid)
    library = PlanLibrary(robot_of(tasks), keep)
    there = library.hashes()
    missing = [task for task in tasks if task.hash(library.robot) not in there]
    counts = dict.fromkeys(("planned", "kept", "failed", "known"), 0)
    rows: list[GridRow] = []
    with stopped_by_signals() as received:
        if missing and not cluster:
            compile_once(library, missing, screen)
        with (
            progress_bar(screen, f"planning {len(tasks)} jumps", len(tasks)) as (bar, bar_task),
            closing(
                fill(tasks, library, workers=workers, cluster=cluster or None, again=anew)
            ) as results,
        ):
            for row in results:
                counts[row.outcome] += 1
                rows.append(row)
                text = ", ".join(f"{n} {what}" for what, n in counts.items() if n)
                bar.update(bar_task, advance=1, description=text)
    failed = [row for row in rows if row.outcome in ("failed", "known")]
    if failed:
        screen.print(table("", ("task", "why there is no plan"), failure_rows(failed)))
    reason = ", ".join(f"{n} {what}" for what, n in counts.items())
    code = ExitCode.NOT_SUCCESSFUL if failed else ExitCode.SUCCESS
    if received:
        code = ExitCode(128 + received[0])
        reason = (
            f"stopped by {received[0].name} after {len(rows)} of {len(tasks)}: {reason}; the same "
            "command goes on from here"
        )
    say(screen, f"{reason}; library: {library.folder}")
    if as_json:
        listed = [
            {
                "task": row.task.name,
                "outcome": row.outcome,
                "reason": row.reason,
                "path": str(row.path) if row.path else None,
            }
            for row in sorted(rows, key=lambda row: row.task.name)
        ]
        success = code == ExitCode.SUCCESS
        print_json({"success": success, "reason": reason, "counts": counts, "rows": listed})
    return code


def compile_once(library: PlanLibrary, tasks: list[JumpTask], screen: Console) -> None:
    """Compile before the workers start; otherwise each of them would compile the same functions."""
    from ...planner.solving.solve import make_problem
    from ...planner.task.errors import PlanError
    from ...planner.task.task import TaskError

    # In the plane and out of it there are other functions, and for every formulation.
    kinds = {(t.formulation, bool(t.distance_y or t.twist), t.impact): t for t in tasks}
    with screen.status("compiling the model, once") as status:

        def progress(text: str, done: int, total: int) -> None:
            status.update(f"{text} ({done} of {total})")

        for task in kinds.values():
            try:
                make_problem(task, library.robot, progress=progress)
            except (PlanError, TaskError, ValueError):
                continue  # the task itself will say so
