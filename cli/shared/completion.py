"""What the shell offers when the tab key is pressed."""

from __future__ import annotations

import typer


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


def benchmark_names(incomplete: str) -> list[str]:
    """The names of benchmarks that begin with a text."""
    from ...benchmarks.catalogue import BENCHMARKS

    return [name for name in BENCHMARKS if name.startswith(incomplete)]
