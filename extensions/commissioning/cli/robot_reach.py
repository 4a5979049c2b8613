"""``aloft robot reach``: a robot's reach in every direction, and the limits that end it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.options import JsonBesideTables, Workers
from ....cli.shared.output import console, errors_reported, print_json, say, table
from ....files.names import inside
from ....runtime.language.errors import ExitCode

if TYPE_CHECKING:
    from rich.console import Console


def reach(
    name: Annotated[str, typer.Argument(help="A shipped robot, or a YAML, URDF or MJCF file.")],
    seeds: Annotated[
        str, typer.Option(help="Seeds of the robust trial for each jump: 9000:9004.")
    ] = "",
    out: Annotated[
        Path | None, typer.Option(help="Folder for the results; by default results/reach/NAME.")
    ] = None,
    minutes: Annotated[
        float,
        typer.Option(min=0.1, help="On two free cores; what is found by then is told."),
    ] = 10.0,
    workers: Workers = 0,
    as_json: JsonBesideTables = False,
) -> None:
    """Search how far a robot jumps in every direction: planned, landed, and by its motors alone.

    It also says what binds: of the robot in the last plan, and in the last run. Searches that the time ends are
    told with a plus; more minutes go on from there, as it does after an interruption. A picture shows the robot
    beside BRUCE, in lengths of the legs of each.
    """
    from ....cli.shared.robot_trials import about_robot, graph_of
    from ....robots.description import path_of, read
    from ....runtime.graph import load
    from ....studies.batch.seeds import parse_seeds
    from ....studies.trials import trial_settings
    from ..reach.charts import save_reach_chart
    from ..reach.reach import SEEDS, bruce_reach
    from ..reach.reach import reach as find_reach
    from ..reach.search import JumpGraph

    screen = console(to_stderr=as_json)
    with errors_reported(as_json):
        chosen = parse_seeds(seeds) if seeds else SEEDS
        path, own = graph_of(name)
        about_robot(name, "jump", screen)
        file = path_of(name).resolve()
        robot, named = read(file).description, str(file)
        settings = {"robot": named, **trial_settings("robust")} if own else trial_settings("robust")
        graph = JumpGraph(named, path, settings)
        load(path, settings)
        folder = out or inside(Path("results") / "reach", robot.name)
        compile_functions(robot, folder, screen)
        told = find_reach(
            robot, graph, folder, seeds=chosen, workers=workers, minutes=minutes,
            progress=lambda text: say(screen, text),
        )  # fmt: skip
        pictures = save_reach_chart(told, bruce_reach(), folder)
        (folder / "reach.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    show(told, screen)
    say(screen, f"drawn to {pictures[0]} and {pictures[1].name}")
    landed = any(each["reached"] for each in told["directions"])
    if as_json:
        why = "jumps land" if landed else "no jump lands"
        drawn = {"picture": str(pictures[0]), "picture_png": str(pictures[1])}
        print_json({"success": landed, "reason": why, **told, **drawn})
    raise typer.Exit(ExitCode.SUCCESS if landed else ExitCode.NOT_SUCCESSFUL)


def compile_functions(robot: Any, folder: Path, screen: Console) -> None:
    """Compile what plans are made with once, before the workers start."""
    from ....cli.shared.planning import derive_once
    from ....planner.library.library import PlanLibrary
    from ....planner.task.task import make_task

    tasks = [
        make_task({"name": "", "robot": robot.name, "rise": 0.1, **more}).resolved(robot)
        for more in ({}, {"distance_y": 0.1})
    ]
    derive_once(PlanLibrary(robot, folder, ()), tasks, screen)


def show(told: dict[str, Any], screen: Console) -> None:
    """Print a row for every direction, and what ended the searches."""
    rows = []
    for each in told["directions"]:
        values = [
            f"{each[key]:g}{'' if each[f'{key}_ended'] else '+'} {each['unit']}"
            for key in ("reached", "planned", "theory")
        ]
        fails = "" if each["fails_at"] is None else f"{each['fails_at']:g}: {each['why']}"
        rows.append(
            (each["name"], *values, f"{each['in_legs']['reached']:.2f}", each["planned_binds"],
             each["binds"] or each["beyond"], fails)
        )  # fmt: skip
    columns = (
        "direction", ">lands", ">planned", ">theory", ">in legs", "what binds in the plan", "and in theory",
        "what fails beyond",
    )  # fmt: skip
    title = f"{told['robot']}, {told['mass_kg']:.4g} kg, legs of {told['leg_length_m']:.3g} m"
    screen.print(table(title, columns, rows))
    spent = told["cpu_s"]
    say(screen, f"{spent:.0f} s of processor time for plans and runs of {len(told['seeds'])} seeds"
        + ("; + stands where the time ran out: --minutes gives more" if told["ended"] else ""))  # fmt: skip
