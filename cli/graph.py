"""``aloft graph``: prints a graph as it is after loading."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..runtime.language.errors import AloftError
from .completion import parameter_names
from .output import SET_HELP, console, errors_reported, print_json, say, table

if TYPE_CHECKING:
    from rich.console import Console

    from ..runtime.language.stages import CheckedGraph


def graph(
    graph: Annotated[Path, typer.Argument(help="The graph file.")],
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", help=SET_HELP, autocompletion=parameter_names),
    ] = None,
    as_table: Annotated[bool, typer.Option("--table", help="As a table (the default).")] = False,
    mermaid: Annotated[bool, typer.Option("--mermaid", help="As a Mermaid diagram.")] = False,
    flat: Annotated[
        bool, typer.Option("--flat", help="As one YAML file: all expanded, overrides applied.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="As one JSON object.")] = False,
) -> None:
    """Print the order of execution, rates, offsets, delays, and every wire with its type."""
    from ..runtime.loading import load, picture

    with errors_reported(as_json):
        if as_table + mermaid + flat + as_json > 1:
            raise AloftError("choose one of --table, --mermaid, --flat and --json")
        checked = load(graph, overrides or [])
    if as_json:
        print_json(picture.table_json(checked))
    elif mermaid:
        typer.echo(picture.mermaid(checked), nl=False)
    elif flat:
        typer.echo(checked.text, nl=False)
    else:
        print_table(console(), checked)


def print_table(out: Console, graph: CheckedGraph) -> None:
    """Print one row for each block, in the order of execution, with one line for each of its inputs."""
    from ..runtime.loading.picture import table as rows_of

    robot = ""
    if graph.robot is not None:
        robot = f", robot {graph.robot.name} with actuators {graph.robot.motors.profile}"
    length = "until stopped" if graph.ticks is None else f"{graph.ticks} ticks"
    say(out, f"{graph.name}: base rate {graph.base_rate:g} Hz, {length}{robot}\n")
    rows = []
    for row in rows_of(graph):
        inputs = "\n".join(item.text() for item in row.inputs)
        offset = f" + {row.offset_ticks}" if row.offset_ticks else ""
        rate = f"{row.rate_hz:g} Hz{offset}"
        rows.append((str(row.order), row.path, row.use, rate, row.machine, inputs))
    out.print(table("", (">order", "block", "is", ">rate", "machine", "inputs"), rows))
