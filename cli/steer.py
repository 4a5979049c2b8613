"""``aloft steer``: hops a robot about, by the arrow keys or by a file of commands."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ..runtime.language.errors import AloftError
from .run import Live, leave_viewer, open_viewer, recorder_started
from .shared.options import CompletedOverrides, JsonBesideTables, NoRecord, Quiet
from .shared.output import console, errors_reported
from .shared.run_graph import OneRunOptions, run_once


def steer(
    graph: Annotated[
        Path | None,
        typer.Argument(help="The graph file; by default BRUCE by keys, or by --commands."),
    ] = None,
    commands: Annotated[
        Path | None,
        typer.Option(
            help="A YAML list of commands instead of the keyboard: [{ahead: 15 cm}, ...]."
        ),
    ] = None,
    overrides: CompletedOverrides = None,
    rerun: Annotated[
        Live, typer.Option(help="Show the run while it goes on: in a window, in a browser.")
    ] = Live.NONE,
    record: Annotated[
        Path | None, typer.Option(help="Where the recording goes; by default recordings/NAME.rrd.")
    ] = None,
    no_record: NoRecord = False,
    as_json: JsonBesideTables = False,
    quiet: Quiet = False,
) -> None:
    """Hop BRUCE about with the arrow keys: each jump is planned from where it has landed."""
    from ..planner.library.library import shipped_folder
    from ..runtime.graph import load

    out = console(to_stderr=as_json, quiet=quiet)
    with errors_reported(as_json):
        name = "steer_by_keys.yaml" if commands is None else "steer.yaml"
        settings = [*(overrides or [])]
        if commands is not None:
            settings.append(f"commands.commands={json.dumps(read_commands(commands))}")
        with recorder_started(wanted=not no_record) as link:
            loaded = load(graph or shipped_folder() / name, settings)
            messages: list[str] = []
            viewer = open_viewer(rerun, messages)
            default = Path("recordings") / f"{loaded.checked.name}.rrd"
            options = OneRunOptions(
                record=None if no_record else record or default, as_json=as_json, times=False
            )
            code = run_once(loaded, options, out, viewer=viewer, link=link, messages=messages)
            if viewer is not None:
                leave_viewer(viewer, wait=not as_json and sys.stdin.isatty())
    raise typer.Exit(code)


def read_commands(path: Path) -> list[Any]:
    """The list in a file of commands, for the parameter ``commands`` of ``CommandSchedule``.

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
