"""The parameters of a sub-graph: what one use of it gives, beside what its file declares."""

from __future__ import annotations

from ..problems import Code, Problems, instead, listing, nearest
from ..reading.nodes import Node, ScalarNode, plain, text_of
from ..reading.written import WrittenGraph
from .flat import FlatBlock


def parameter_values(
    block: FlatBlock, subgraph: WrittenGraph, problems: Problems
) -> dict[str, Node] | None:
    """The values of a sub-graph's parameters for one use; ``None`` if one is missing."""
    declared = {entry.key: entry for entry in subgraph.parameters}
    misspelt: dict[str, None] = {}
    for entry in block.parameters:
        if entry.key not in declared:
            similar = nearest(entry.key, declared)
            misspelt.update(dict.fromkeys(similar[:1]))
            problems.add(
                Code.UNKNOWN_PARAMETER,
                f"{subgraph.file} has no parameter {entry.key!r}",
                entry.key_where,
                at=f"{block.path}.{entry.key}",
                expected=listing(declared),
                found=entry.key,
                nearest=similar,
                fix=instead(entry.key, text_of(plain(entry.value)), entry.key_where, similar[0])
                if similar
                else f"remove {entry.key!r}",
            )
    values: dict[str, Node] = {}
    complete = True
    for name, entry in declared.items():
        given = block.parameters.get(name)
        default = entry.value
        if given is not None:
            values[name] = given.value
        elif isinstance(default, ScalarNode) and default.value is None:
            complete = False
            if name in misspelt:
                continue  # one mistake, one problem
            problems.add(
                Code.MISSING_PARAMETER,
                f"{block.path} does not give the parameter {name!r}",
                block.parameters.where,
                at=f"{block.path}.{name}",
                other=name,
                other_where=entry.key_where,
                fix=f"with: {{{name}: ...}}",
            )
        else:
            values[name] = default
    return values if complete else None
