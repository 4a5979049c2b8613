"""``aloft steer``: hops a robot about, by the arrow keys or by a file of commands."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ....cli.shared.live_view import (
    Live,
    Record,
    Rerun,
    leave_viewer,
    open_viewer,
    recorder_started,
)
from ....cli.shared.options import CompletedOverrides, JsonBesideTables, NoRecord, Quiet
from ....cli.shared.output import console, errors_reported, progress_bar, say
from ....cli.shared.robot_trials import about_robot, robot_setting
from ....cli.shared.run_graph import OneRunOptions, run_once
from ....runtime.language.errors import AloftError

if TYPE_CHECKING:
    from rich.console import Console


def steer(
    graph: Annotated[
        Path | None,
        typer.Argument(help="The graph file; by default the robot by keys, or by --commands."),
    ] = None,
    robot: Annotated[
        str, typer.Option(help="The robot: its name, or a URDF, MJCF or YAML file.")
    ] = "bruce",
    commands: Annotated[
        Path | None,
        typer.Option(
            help="A YAML list of commands instead of the keyboard: [{ahead: 15 cm}, ...]."
        ),
    ] = None,
    overrides: CompletedOverrides = None,
    rerun: Rerun = Live.NONE,
    record: Record = None,
    no_record: NoRecord = False,
    as_json: JsonBesideTables = False,
    quiet: Quiet = False,
) -> None:
    """Hop a robot about with the arrow keys: each jump is planned from where it has landed."""
    from ....runtime.graph import load

    out = console(to_stderr=as_json, quiet=quiet)
    with errors_reported(as_json):
        name = "steer_by_keys" if commands is None else "steer"
        settings, about = [*(overrides or [])], {}
        if commands is not None:
            settings.append(f"commands.commands={json.dumps(read_commands(commands))}")
        if robot != "bruce":
            if graph is not None:
                raise AloftError(
                    f"{graph} names its robot: leave out --robot, or --set robot={robot}"
                )
            name = f"robots/{name}"
            settings.insert(0, robot_setting(robot))
            about = about_robot(robot, "hop", out)
            plan_hops(robot, out)
        with recorder_started(wanted=not no_record) as link:
            loaded = load(graph or f"aloft:hopping/{name}", settings)
            messages: list[str] = []
            viewer = open_viewer(rerun, messages)
            default = Path("recordings") / f"{loaded.checked.name}.rrd"
            options = OneRunOptions(
                record=None if no_record else record or default, as_json=as_json
            )
            code = run_once(
                loaded, options, out, viewer=viewer, link=link, messages=messages, also=about
            )
            if viewer is not None:
                leave_viewer(viewer, wait=not as_json and sys.stdin.isatty())
    raise typer.Exit(code)


def plan_hops(name: str, out: Console) -> None:
    """Plan and keep the hops of a robot from which those in the loop are interpolated, where there are none.

    Raises:
        PlanError: not even a jump on the spot has a valid plan.
    """
    from ....robots.description import path_of, read
    from ..planner.hop_plans import level_reach, own_path, samples_file
    from ..planner.hop_request import HopRequest
    from ..planner.make_samples import COUNT, plan_level_hops, reach_for
    from ..planner.plan_samples import write_samples

    robot = read(path_of(name)).description
    if samples_file(robot) is not None:
        return
    say(out, f"planning hops of {robot.name}, once: it takes some minutes")
    with progress_bar(out, "planning hops", COUNT + 1) as (bar, task):

        def tell(wanted: HopRequest, valid: bool) -> None:
            bar.update(task, advance=1)

        samples = plan_level_hops(robot, reach_for(robot), tell, COUNT)
    write_samples(own_path(robot), samples)
    ahead, back, aside, turn, _ = level_reach(robot)
    say(
        out,
        f"{robot.name} hops up to {100.0 * ahead:.0f} cm ahead, {100.0 * back:.0f} cm back, {100.0 * aside:.0f} cm "
        f"to a side and turns by up to {math.degrees(turn):.0f} degrees; farther commands are shortened",
    )


def read_commands(path: Path) -> list[Any]:
    """Read the list in a file of commands, for the parameter ``commands`` of ``CommandSchedule``.

    Raises:
        AloftError: there is no file, it is no YAML, or it is no list.
    """
    import yaml

    try:
        found = yaml.safe_load(path.read_text())
    except OSError as error:
        raise AloftError(f"cannot read {path}: {error.strerror or error}") from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise AloftError(f"{path} is no YAML: {' '.join(str(error).split())}") from error
    if not isinstance(found, list) or not found:
        raise AloftError(
            f"{path} has no list of commands; expected, for example, '- {{ahead: 15 cm, turn: 20 deg}}' in each line"
        )
    return found
