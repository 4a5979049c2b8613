"""``aloft check``: whether a graph may run, and everything that is wrong if it may not."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .shared.options import AsJson, CompletedOverrides
from .shared.output import errors_reported, print_json


def check(
    graph: Annotated[Path | None, typer.Argument(help="The graph file.")] = None,
    overrides: CompletedOverrides = None,
    as_json: AsJson = False,
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON Schema of graph files, for editors.")
    ] = False,
) -> None:
    """Report every mistake in a graph at once: where, what is expected, what is found, the fix."""
    from ..runtime.loading import load

    if schema:
        from ..runtime.loading.schema import schema_text

        typer.echo(schema_text(), nl=False)
        return
    if graph is None:
        raise typer.BadParameter("a graph file is needed, or --schema")
    with errors_reported(as_json):
        checked = load(graph, overrides or [])
    if as_json:
        found = {"file": str(graph), "ok": True, "count": 0, "problems": []}
        print_json({"success": True, **found, "unchecked": list(checked.unchecked)})
    else:
        for text in checked.unchecked:
            typer.echo(f"unit not checked: {text}")
        count, machines = len(checked.blocks), len(checked.machines)
        spread = f" on {machines} machine{'s' if machines > 1 else ''}" if machines else ""
        typer.echo(f"{graph}: no problems; {count} blocks at {checked.base_rate:g} Hz{spread}")
