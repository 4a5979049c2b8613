"""Parameters that another block tells: ``scene: {from: plan.scene}`` becomes the value itself.

The flattened graph, and with it every recording, has the value. Whoever sets the parameter to
something else replaces the reference.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from ....files.nodes import MapNode, Node, ScalarNode, from_plain
from ....files.problems import Code, Problems, listing, nearest
from ....files.validation import unit_of
from ...language.block import Block, Clock, Context, UnmetRequirement
from ...language.flat_graph import FlatBlock, FlatGraph
from ...language.parameters import Parameters, declared_fields
from ...language.registry import find_block
from ...language.requirements import unmet_requirements
from .parameters import check_parameters, plain_parameters
from .settings import Settings

KEY = "from"


def resolve_references(graph: FlatGraph, settings: Settings, problems: Problems) -> FlatGraph:
    """Return the graph with every reference to a value of another block replaced by the value.

    A reference that leads nowhere is reported. One to a block with problems of its own is left
    out without a word, because those problems are reported where they are.
    """
    if not any(True for block in graph.blocks for _ in _references(block)):
        return graph
    return _ReferenceResolver(graph, settings, problems).resolved()


def _references(block: FlatBlock) -> Iterator[tuple[tuple[str, ...], ScalarNode]]:
    """Yield the parameters of a block, and in its groups, that are ``{from: text}``: the path and the text of each."""
    return _references_in(block.parameters, ())


def _references_in(
    node: MapNode, path: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], ScalarNode]]:
    for entry in node:
        inner, at = entry.value, (*path, entry.key)
        if not isinstance(inner, MapNode):
            continue
        source = inner.entries[0].value if inner.keys() == (KEY,) else None
        if isinstance(source, ScalarNode) and isinstance(source.value, str):
            yield at, source
        else:
            yield from _references_in(inner, at)


def _with_value(node: MapNode, path: tuple[str, ...], value: Node | None) -> MapNode:
    """Return the mapping with another value at a path; without the key where the value is ``None``."""
    entries = []
    for entry in node:
        if entry.key != path[0]:
            entries.append(entry)
        elif len(path) > 1:
            assert isinstance(entry.value, MapNode)
            entries.append(replace(entry, value=_with_value(entry.value, path[1:], value)))
        elif value is not None:
            entries.append(replace(entry, value=value))
    return replace(node, entries=tuple(entries))


class _ReferenceResolver:
    """Replaces the references of one graph; computes the exported values of each block once."""

    def __init__(self, graph: FlatGraph, settings: Settings, problems: Problems) -> None:
        self.graph, self.settings, self.problems = graph, settings, problems
        self.blocks = {block.path: block for block in graph.blocks}
        self.done: dict[str, FlatBlock] = {}
        self.exported: dict[str, Mapping[str, tuple[Any, str]] | None] = {}
        self.asked: dict[str, set[str]] = {}
        for reader in graph.blocks:
            for _, source in _references(reader):
                path, what = self.source_of(reader, source)
                self.asked.setdefault(path, set()).add(what)

    def resolved(self) -> FlatGraph:
        blocks = tuple(self.block(block.path, ()) for block in self.graph.blocks)
        return replace(self.graph, blocks=blocks)

    def block(self, path: str, waiting_blocks: tuple[str, ...]) -> FlatBlock:
        """Return a block without references; ``waiting_blocks`` are the blocks that wait for it."""
        if path in self.done:
            return self.done[path]
        block = self.blocks[path]
        block_type = self.type_of(block)
        parameters = block.parameters
        for place, source in _references(block):
            node = self.value(block, block_type, ".".join(place), source, (*waiting_blocks, path))
            parameters = _with_value(parameters, place, node)
        self.done[path] = replace(block, parameters=parameters)
        return self.done[path]

    def value(
        self, reader: FlatBlock, block_type: type[Block] | None, parameter: str,
        source: ScalarNode, waiting_blocks: tuple[str, ...],
    ) -> Node | None:  # fmt: skip
        """Return the value that replaces a reference; ``None`` where it is not known."""
        at = f"{reader.path}.{parameter}"
        path, what = self.source_of(reader, source)
        if not path:
            name = str(source.value).rpartition(".")[0]
            self._report_unknown(source, at, f"there is no block {name!r}", name, self.blocks)
            return None
        if path in waiting_blocks:
            ring = [*waiting_blocks[waiting_blocks.index(path) :], path]
            self.problems.add(
                Code.LOOP,
                f"the parameters of {' -> '.join(ring)} follow from each other",
                source.where,
                at=at,
                fix="give one of them a value of its own",
            )
            return None
        exported = self.tells(path, waiting_blocks)
        if exported is None:
            return None
        if what not in exported:
            use = self.blocks[path].use
            self._report_unknown(
                source, at, f"{path} ({use}) tells no {what!r}", what, exported, path
            )
            return None
        value, unit = exported[what]
        if isinstance(value, UnmetRequirement):
            self.problems.add(
                Code.UNMET_REQUIREMENT,
                f"{at} cannot follow from {source.value}: {value.message}",
                source.where,
                at=at,
                other=str(source.value),
                other_where=self.blocks[path].where,
                expected=value.expected,
                found=value.found,
                nearest=value.nearest,
                fix=value.fix,
            )
            return None
        own = unit_of(info) if block_type and (
            info := dict(declared_fields(block_type.Params)).get(parameter)) else unit  # fmt: skip
        if unit and own and unit != own:
            self.problems.add(
                Code.UNIT,
                f"{at} is in {own}, and {source.value} is in {unit}",
                source.where,
                at=at,
                other=str(source.value),
                expected=own,
                found=unit,
            )
            return None
        return from_plain(value, source.where)

    def source_of(self, reader: FlatBlock, source: ScalarNode) -> tuple[str, str]:
        """Return the path of the block that a reference names, empty if there is none, and the name of the
        value."""
        name, _, what = str(source.value).rpartition(".")
        folder = reader.path.rpartition("/")[0]
        return next((p for p in (f"{folder}/{name}", name) if p in self.blocks), ""), what

    def tells(
        self, path: str, waiting_blocks: tuple[str, ...]
    ) -> Mapping[str, tuple[Any, str]] | None:
        """Return the exported values of a block and its parameters, with units; ``None`` if it has
        a problem."""
        if path not in self.exported:
            self.exported[path] = self._ask(self.block(path, waiting_blocks))
        return self.exported[path]

    def _ask(self, block: FlatBlock) -> Mapping[str, tuple[Any, str]] | None:
        block_type = self.type_of(block)
        robot = self.settings.robot
        if block_type is None or not self.settings.robot_known:
            return None
        params = check_parameters(block, block_type, Problems(), robot)
        if params is None:
            return None
        context = Context(
            path=block.path,
            clock=Clock(1.0 / (self.settings.base_rate or 1.0)),
            robot=robot,
            folder=block.folder,
            graph_folder=self.settings.folder,
            asked=frozenset(self.asked[block.path]),
            graph=self.graph.plain(),
        )
        try:
            exported = block_type.exported_values(params, context)
        except Exception as error:  # noqa: BLE001  the block's own code must not hide others
            if not unmet_requirements(block_type, params, context):
                self.problems.add(
                    Code.UNMET_REQUIREMENT,
                    f"{block.path} ({block.use}) cannot tell what follows from its parameters: "
                    + f"{type(error).__name__}: {error}",
                    block.where,
                    at=block.path,
                )
            return None
        return {**_own_values(params), **{name: (value, "") for name, value in exported.items()}}

    def type_of(self, block: FlatBlock) -> type[Block] | None:
        """Return the class of a block; ``None`` if it has none, which is reported elsewhere."""
        for folder in dict.fromkeys([block.folder, self.graph.folder]):
            try:
                return find_block(block.use, folder) if block.use else None
            except Exception:  # noqa: BLE001, S112  reported where the block is examined
                continue
        return None

    def _report_unknown(
        self, source: ScalarNode, at: str, message: str, name: str, known: Mapping[str, Any],
        path: str = "",
    ) -> None:  # fmt: skip
        if self.graph.incomplete:
            return
        near = nearest(name, known)
        self.problems.add(
            Code.UNKNOWN_PARAMETER,
            f"{at}: {message}",
            source.where,
            at=at,
            expected=f"a value of its own, or {{from: block.name}}; {path or 'there is'} has "
            + listing(known)
            if known
            else "a value of its own",
            found=str(source.value),
            nearest=near,
            fix=f"{{from: {path + '.' if path else ''}{near[0]}}}" if near else "",
        )


def _own_values(params: Parameters) -> dict[str, tuple[Any, str]]:
    """Return the parameters of a block as plain data, with their units."""
    data = plain_parameters(params)
    return {k: (data[k], unit_of(info)) for k, info in type(params).model_fields.items()}
