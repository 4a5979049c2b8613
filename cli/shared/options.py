"""The options that several verbs have, and what the shell offers for them when the tab key is pressed."""

from __future__ import annotations

from typing import Annotated

import typer

from .output import SET_HELP


def block_names(incomplete: str) -> list[str]:
    """The names of blocks that begin with a text."""
    from ...runtime.language.registry import known_names

    return [name for name in known_names() if name.startswith(incomplete)]


def parameter_names(context: typer.Context, incomplete: str) -> list[str]:
    """The parameters, as ``block.parameter=``, of the graph on the command line that begin with a text."""
    from ...runtime.loading import LoadError, load

    # Arguments in front of an option that still waits for its value are not parsed yet.
    given = context.params.get("graph") or next(iter(context.args), "")
    try:
        graph = load(str(given))
    except LoadError:
        return []  # no graph yet, or one that may not run: nothing to offer
    names = [
        f"{spec.path}.{name}="
        for spec in graph.blocks
        for name in type(spec.params).model_fields
        if "~" not in spec.path  # those that loading has inserted cannot be set
    ]
    return [name for name in names if name.startswith(incomplete)]


AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
JsonBesideTables = Annotated[
    bool, typer.Option("--json", help="Tables go to standard error, one JSON object to output.")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print the verdict only.")]
NoRecord = Annotated[bool, typer.Option("--no-record", help="Write no recording.")]
Overrides = Annotated[list[str] | None, typer.Option("--set", help=SET_HELP)]
CompletedOverrides = Annotated[
    list[str] | None, typer.Option("--set", help=SET_HELP, autocompletion=parameter_names)
]
Workers = Annotated[int, typer.Option(help="Processes; 0: one a core.", min=0)]
Cluster = Annotated[str, typer.Option(help="Run on a Dask cluster: tcp://127.0.0.1:8786.")]
