"""``aloft export``: a graph in a form that other tools run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .shared.options import AsJson, Overrides
from .shared.output import console, errors_reported, print_json, say, table

export = typer.Typer(
    name="export",
    help="Write a graph, or a part of it, for other tools: as a Functional Mock-up Unit.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@export.command("fmu")
def fmu(
    graph: Annotated[
        str, typer.Argument(help="The graph file, and behind a colon the sub-graph or block.")
    ],
    to: Annotated[Path, typer.Option("--to", help="The file to write, such as controller.fmu.")],
    output: Annotated[
        list[str] | None,
        typer.Option("--output", help="An output, as block.port, in place of all. Repeatable."),
    ] = None,
    set_: Overrides = None,
    as_json: AsJson = False,
) -> None:
    """A Functional Mock-up Unit (FMI 3.0, co-simulation) of a graph or of a sub-graph.

    What the sub-graph reads from outside becomes its inputs, what it declares as outputs its
    outputs. Of a whole graph the inputs are its blocks blocks.External, and the outputs what no
    block reads. aloft has to be installed in the Python that runs the FMU.
    """
    with errors_reported(as_json):
        from ..fmi.exporting.write import export as write

        path, part = _parts(graph)
        made = write(path, to, part, set_ or [], output or [])
        terminals = [("input", t) for t in made.inputs] + [("output", t) for t in made.outputs]
        if as_json:
            print_json(
                {
                    "file": str(made.file),
                    "period_s": made.period,
                    "inputs": [t.plain() for t in made.inputs],
                    "outputs": [t.plain() for t in made.outputs],
                    "problems": made.problems,
                }
            )
            return
        out = console()
        rows = [
            (kind, t.name, str(list(t.shape)), t.unit if t.unit is not None else "not checked")
            for kind, t in terminals
        ]
        out.print(table("", ["", "variable", "shape", "unit"], rows))
        say(out, f"{made.file}: FMI 3.0, co-simulation, steps of {made.period:.6g} s")
        for problem in made.problems or ():
            say(out, f"FMPy's validator: {problem}")
        if made.problems == ():
            say(out, "FMPy's validator found no problem")


def _parts(graph: str) -> tuple[str, str]:
    """The graph's file or address, and the path of the part behind it."""
    shipped = "aloft:" if graph.startswith("aloft:") else ""
    path, _, part = graph.removeprefix(shipped).partition(":")
    return f"{shipped}{path}", part
