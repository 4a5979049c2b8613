"""Finds the machines of a graph that runs, for the verbs that look at them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from ...runtime.links.observer import Observer

Keys = Annotated[
    Path | None, typer.Option(help="The folder of `aloft keys`, or the observer's own, for TLS.")
]
Local = Annotated[
    int,
    typer.Option(
        min=0, help="The process of `aloft run --local`, where several run this graph here."
    ),
]
As = Annotated[str, typer.Option("--as", help="The observer's name, of `aloft keys --observer`.")]


def observer_of(
    graph: Path, overrides: list[str], keys: Path | None, name: str, process: int = 0
) -> Observer:
    """An observer of a graph's machines, not yet connected.

    Where ``aloft run --local`` runs the graph here, its settings and endpoints count, and
    ``process`` says which run where there are several.

    Raises:
        AloftError: the graph is wrong, names no machines, or does not fit the keys; or it is not
            clear which run is meant.
    """
    from ...runtime.links.observer import Observer
    from ...runtime.loading import load
    from ...runtime.placement.placed import place
    from ...runtime.transports.keys import secured
    from .local_runs import settings_of

    placed = place(load(graph, [*settings_of(graph, process), *overrides]))
    return Observer(placed, None if keys is None else secured(placed, keys, name))
