"""The options that several verbs have, each written once."""

from __future__ import annotations

from typing import Annotated

import typer

from .completion import parameter_names
from .output import SET_HELP

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
