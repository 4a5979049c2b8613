"""Changes a flat graph by overrides, as if they had been given when its files were read."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

from ....files.nodes import Entry, MapNode, Node, ScalarNode, plain
from ....files.problems import Code, Position, Problems, listing, nearest
from ...language.flat_graph import FlatBlock, FlatGraph
from ..reading.overrides import Override, Overrides, is_graph_key, merge, read_overrides
from ..reading.written import wrong_kind
from .machines import placed

SUBGRAPH_SUFFIXES = (".yaml", ".yml")
VALUES = ("rate", "duration", "robot", "actuators")
"""Keys of a graph that are one value each."""
SECTIONS = ("dimensions", "clock", "recording", "machines", "links", "faults")
"""Keys of a graph that are mappings."""


def change(graph: FlatGraph, overrides: Overrides, problems: Problems) -> FlatGraph:
    """Return the graph with other parameters and keys; what is wrong is reported and left out.

    A block may use another class, but no sub-graph: those were expanded when the files were read.
    """
    commands = read_overrides(overrides, problems)
    by_path = {block.path: block for block in graph.blocks}
    keys = MapNode(tuple(_entries(graph)), Position(graph.file, 0, 0))
    robot_folder = graph.robot_folder
    for command in commands:
        if is_graph_key(command, by_path):
            names = tuple(command.key.split("."))
            keys = merge(keys, names, command.value, command.where)
            robot_folder = graph.folder if names == ("robot",) else robot_folder
        elif command.block in by_path:
            by_path[command.block] = _changed_block(by_path[command.block], command, problems)
        else:
            paths = [*by_path, *graph.subgraphs]
            report_unknown_block(command.key, command.block, command.where, paths, problems)
    blocks = placed(tuple(by_path.values()), mapping_of(keys, "place", problems), {}, problems)
    return replace(
        graph,
        blocks=blocks,
        robot_folder=robot_folder,
        overrides={**graph.overrides, **{each.key: plain(each.value) for each in commands}},
        **graph_keys(keys, problems),
    )


def graph_keys(keys: MapNode, problems: Problems) -> dict[str, Any]:
    """Return the keys of a graph as fields of ``FlatGraph``."""
    values: dict[str, Any] = {key: keys.get(key) for key in VALUES}
    return {**values, **{key: mapping_of(keys, key, problems) for key in SECTIONS}}


def mapping_of(keys: MapNode, key: str, problems: Problems) -> MapNode | None:
    """Return the mapping under a key of the graph; anything else is reported and left out."""
    entry = keys.get(key)
    if entry is None or isinstance(entry.value, MapNode):
        return entry.value if entry else None  # type: ignore[return-value]  # a MapNode
    wrong_kind(entry.value, repr(key), "a mapping", problems)
    return None


def assign(
    use: Node | None, parameters: MapNode, override: Override
) -> tuple[Node | None, MapNode]:
    """Return what a block uses and its parameters after one override."""
    if override.path == ("use",):
        return override.value, parameters
    return use, parameters.assign(override.path, override.value, override.where)


def named_use(use: Node | None, at: str, problems: Problems) -> str:
    """Return the name of what a block uses, empty where none is given; report what is no name."""
    if use is None:
        return ""
    if isinstance(use, ScalarNode) and isinstance(use.value, str):
        return use.value
    expected = "a block such as blocks.JointPD, module:Class, or a file.yaml"
    wrong_kind(use, "'use'", expected, problems, at=at)
    return ""


def report_unknown_block(
    key: str,
    block: str,
    where: Position,
    paths: Collection[str],
    problems: Problems,
    code: Code = Code.OVERRIDE,
) -> None:
    """Report an override or a wire, ``key``, of a block that does not exist."""
    similar = nearest(block, paths)
    problems.add(
        code,
        f"{key!r}: there is no block {block!r}",
        where,
        at=key,
        expected=listing(paths),
        found=block,
        nearest=similar,
        fix=(key if where.line else where.file).replace(block, similar[0], 1) if similar else "",
    )


def _entries(graph: FlatGraph) -> list[Entry]:
    """Return the keys of the graph beside its blocks."""
    values = [entry for key in VALUES if (entry := getattr(graph, key)) is not None]
    sections: list[tuple[str, MapNode | None]] = [(key, getattr(graph, key)) for key in SECTIONS]
    return [*values, *(Entry(key, node.where, node) for key, node in sections if node is not None)]


def _changed_block(block: FlatBlock, override: Override, problems: Problems) -> FlatBlock:
    """Return the block after one override."""
    use, parameters = assign(None, block.parameters, override)
    if use is None:
        return replace(block, parameters=parameters)
    name = named_use(use, block.path, problems)
    if name.endswith(SUBGRAPH_SUFFIXES):
        problems.add(
            Code.OVERRIDE,
            f"{override.key!r}: {block.path} cannot become the sub-graph {name} any more",
            override.where,
            at=override.key,
            expected="a block such as blocks.JointPD or module:Class",
            found=name,
            fix=f"give {override.key} where the graph is loaded, not to one that is",
        )
    return replace(block, use=name, use_where=use.where)
