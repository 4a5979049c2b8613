"""The rehearsal of a plan, for ``aloft plan`` and ``aloft jump``: made, kept and shown."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...runtime.language.errors import AloftError
from .output import say, table
from .robot_trials import graph_of, jump_graphs

if TYPE_CHECKING:
    from rich.console import Console

    from ...planner.library.library import PlanLibrary
    from ...planner.library.rehearsed import Rehearsed
    from ...planner.task.task import JumpTask


REHEARSE_HELP = (
    "Run the plan in simulation and learn what the controller misses at lift-off: 3 to 9 runs."
)

LANDING_HELP = "Rehearse the landing: learn what lands the torso upright and in its place; 72 runs of the robust trial."


def rehearsal_of_file(
    file: Path, task: JumpTask, library: PlanLibrary, keep: Path | None, wanted: bool,
    screen: Console, landing: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Rehearse as ``rehearsal`` does, with a task's file in the shipped graph of its robot."""
    from ...files.nodes import text_of

    if task.robot not in jump_graphs() and not wanted:
        return {}
    path, settings = graph_of(task.robot)
    settings.append(f"plan.task={text_of(str(file.resolve()))}")
    if keep is not None:
        settings.append(f"plan.library={text_of(str(keep.resolve()))}")
    return rehearsal(path, settings, task, library, wanted, screen, landing)


def rehearsal(
    path: Path, settings: Sequence[str], task: JumpTask, library: PlanLibrary, wanted: bool,
    screen: Console, landing: bool = False,
) -> dict[str, Any]:  # fmt: skip
    """Rehearse a kept plan in a graph if that is ``wanted``, and show what was learnt now or before.

    With ``landing`` it is rehearsed as far as its landing (``studies/rehearsing/landing``).

    Returns:
        What the plan's JSON object says of it: nothing where nothing was rehearsed.

    Raises:
        AloftError: the graph does not take what is learnt, a run could not be made, or what was
            learnt before is damaged.
    """
    from ...planner.library.rehearsed import (
        controller_hash,
        find_rehearsed,
        keep_rehearsed,
        was_rehearsed,
    )
    from ...runtime.graph import load
    from ...runtime.loading import flatten
    from ...studies.rehearsing.landing import rehearse_landing, response
    from ...studies.rehearsing.lift_off import LEVER, corrected_parameters, rehearse

    if not wanted and not was_rehearsed(library, task):
        return {}
    flat = flatten(path, settings)
    # A damaged file must not be in the way of making it anew.
    graph = load(path, [*settings, "plan.rehearsed=false"]).checked
    controller = controller_hash(flat.plain(), graph.base_rate, "plan")
    if not wanted:
        found = find_rehearsed(library, task, controller)
        return {} if found is None else show(found, task, screen)
    parameters = corrected_parameters(flat)
    plan = library.find(task)
    if plan is None:
        raise AloftError(f"there is no valid plan of {task.name} to rehearse")
    unit = library.robot.total_mass * LEVER * float(plan.com[0, 2])
    with screen.status(f"rehearsing {task.name}") as status:

        def on_try(text: str) -> None:
            status.update(f"rehearsing {task.name}: {text}")

        if landing:
            answer = response(plan, library.robot.total_mass)
            learnt = rehearse_landing(path, settings, parameters, answer, unit, on_try=on_try)
        else:
            learnt = rehearse(path, settings, parameters, unit, on_try=on_try)
    kept = keep_rehearsed(library, task, controller, learnt)
    shown = show(learnt, task, screen)
    say(screen, f"rehearsal: {kept}")
    return shown


def show(found: Rehearsed, task: JumpTask, screen: Console) -> dict[str, Any]:
    """Print what a rehearsal has learnt; returns it for the plan's JSON object."""
    rows = []
    for kind, unit in (("velocity", "mm/s"), ("momentum", "mN m s")):
        cells = (getattr(found.before, kind), getattr(found.after, kind))
        learnt = getattr(found, f"{kind}_correction")
        for k, axis in enumerate("xyz"):
            name = f"{'velocity' if kind == 'velocity' else 'angular momentum'} {axis} [{unit}]"
            rows.append((name, *(f"{1e3 * cell[k]:.1f}" for cell in (*cells, learnt))))
    sizes = (found.before, found.after)
    rows.append(("altogether [mm/s]", *(f"{1e3 * each.size:.1f}" for each in sizes), ""))
    rows.append(("its scatter [mm/s]", *(f"{1e3 * each.scatter:.1f}" for each in sizes), ""))
    rows.append(("runs that landed", *(f"{each.landed} of {each.runs}" for each in sizes), ""))
    columns = ("deviation at lift-off", ">before", ">after", ">correction")
    screen.print(table(f"{task.name}: rehearsed", columns, rows))
    say(screen, f"rehearsed in the {found.trial} trial: {found.reason}")
    return {"rehearsal": {**asdict(found), "corrects": found.corrects}}
