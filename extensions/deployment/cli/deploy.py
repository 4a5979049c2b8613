"""``aloft deploy``: a folder with everything that one machine needs to run its part of a graph."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ....cli.shared.options import AsJson, Overrides
from ....cli.shared.output import console, errors_reported, print_json, say, table


def deploy(
    graph: Annotated[Path, typer.Argument(help="The graph file.")],
    to: Annotated[Path, typer.Option("--out", "-o", help="The folder to write.")],
    machine: Annotated[
        str, typer.Option(help="The machine; a graph without machines is deployed as a whole.")
    ] = "",
    keys: Annotated[
        Path | None,
        typer.Option(help="The folder of `aloft keys`; the machine's own part is copied."),
    ] = None,
    wheels: Annotated[
        Path | None,
        typer.Option(help="A folder of wheels to include, aloft's own among them, such as dist."),
    ] = None,
    overrides: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Write what a machine needs to run its part: graph, robot, plans, libraries, keys, modules, wheels, and
    what starts it: a script, a unit of systemd, a container file."""
    with errors_reported(as_json):
        from ..deployment import deploy as write

        made = write(graph, machine, to, overrides or [], keys, wheels)
    if as_json:
        print_json({"success": True, **vars(made)})
        return
    out = console()
    rows = [(name, str((to / name).stat().st_size)) for name in made.files]
    out.print(table(f"{to}", ("file", ">bytes"), rows))
    motors = (
        "moves actuators: nothing restarts it" if made.moves_actuators else "moves no actuators"
    )
    say(out, f"{len(made.requirements)} packages in requirements.txt; this part {motors}")
