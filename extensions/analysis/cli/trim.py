"""``aloft trim``: operating points of a graph under conditions on its signals and states."""

from __future__ import annotations

from typing import Annotated

import typer

from ....cli.shared.options import AsJson, Overrides
from ....cli.shared.output import (
    console,
    errors_reported,
    number,
    print_json,
    say,
    table,
)
from ....runtime.language.errors import AloftError, ExitCode


def trim(
    graph: Annotated[str, typer.Argument(help="The graph file.")],
    free: Annotated[
        list[str],
        typer.Option(help="A state or signal that is searched, such as motor.y=0:2. Repeatable."),
    ],
    hold: Annotated[
        list[str] | None,
        typer.Option(help="A condition, such as 'truth.base_position[2] == 0.3 m'. Repeatable."),
    ] = None,
    at: Annotated[float | None, typer.Option(help="The instant of the start [s].")] = None,
    when: Annotated[
        str, typer.Option(help="The first instant at which it holds: 'phase.phase == STAND'.")
    ] = "",
    settle: Annotated[int, typer.Option(min=0, help="Periods before the one that is judged.")] = 4,
    tolerance: Annotated[
        float, typer.Option(help="For residuals, relative to the larger of 1 and what is wanted.")
    ] = 1e-6,
    overrides: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """Find an operating point: free states that come to rest, and signals, under conditions.

    Exits with 1 when a condition cannot hold, and says which.
    """
    from ....runtime.graph import load
    from .. import trim as trim_graph

    with errors_reported(as_json):
        if tolerance <= 0.0:
            raise AloftError(f"the tolerance is {tolerance:g}; it must be above 0")
        found = trim_graph(
            load(graph, overrides or []), free=free, hold=hold or [], at=at, when=when,
            settle=settle, tolerance=tolerance,
        )  # fmt: skip
    if as_json:
        print_json({"graph": graph, **found.as_data()})
    else:
        out = console()
        values = [(name, number(value), found.units[name]) for name, value in found.values.items()]
        out.print(table("operating point", ("free", ">value", "unit"), values))
        rows = [
            (c.name, c.kind, number(c.residual), c.unit, "" if c.holds else "cannot hold")
            for c in found.conditions
        ]
        out.print(table("conditions", ("", "", ">off by", "unit", ""), rows))
        for key, numbers in found.settings.items():
            say(out, f"--set '{key}={numbers}'")
        say(out, found.reason)
    raise typer.Exit(ExitCode.SUCCESS if found.success else ExitCode.NOT_SUCCESSFUL)
