"""Makes one flat graph from the written files: expands includes, sub-graphs and their parameters,
and applies overrides."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ....files.document import read_file, read_mapping
from ....files.nodes import Entry, MapNode, Node, ScalarNode, changed, plain
from ....files.problems import Code, Position, Problems
from ...language.flat_graph import FlatBlock, FlatGraph, FlatWire
from ..reading.files import PREFIX, FileTree, Stack, files_like, is_another_kind
from ..reading.overrides import (
    Override,
    Overrides,
    is_graph_key,
    merge,
    read_overrides,
    read_sets,
)
from ..reading.written import WrittenBlock, WrittenGraph, read_graph
from .change import (
    SUBGRAPH_SUFFIXES,
    assign,
    graph_keys,
    mapping_of,
    named_use,
    report_unknown_block,
)
from .machines import placed
from .rates import wrap_offset
from .subgraphs import Bindings, Instance, Resolver, parameter_values, report_unused
from .written_wires import WrittenWire, read_wire

_MAXIMAL_BLOCKS = 5000


_GivenWire = tuple[WrittenWire | None, Position, str]
"""A wire under ``wires``: the wire, its place and its file."""


@dataclass(frozen=True)
class _Scope:
    """Scope in which blocks are expanded: the root, or one use of a sub-graph."""

    bindings: Bindings
    instance: str | None = None
    stack: Stack = ()
    rate: Node | None = None
    offset: Node | None = None
    machine: Node | None = None
    shifted: bool = False
    """True if the offset is set in an outer scope than the rate, so that it may exceed a period."""
    sets: tuple[Override, ...] = ()
    wires: Mapping[str, _GivenWire] = field(default_factory=dict)
    """Wires that other files give, by ``block.input``."""

    @property
    def prefix(self) -> str:
        """Prefix of the paths of this scope's blocks."""
        return f"{self.instance}/" if self.instance else ""


@dataclass
class _GraphDraft:
    """A block whose wires are not resolved yet."""

    block: FlatBlock
    links: dict[str, WrittenWire | None]
    shifted: bool = False
    """True if the offset is inherited from an outer scope than the rate."""


def flatten_file(path: Path, overrides: Overrides, problems: Problems) -> FlatGraph:
    """Flatten the graph in a file; what is wrong is reported to ``problems`` and left out."""
    similar = () if path.exists() else files_like(path.as_posix(), path.parent)
    if similar:
        shipped = similar[0].startswith(PREFIX)
        problems.add(
            Code.FILE,
            f"cannot read {path}: no such file",
            Position(str(path), 0, 0),
            nearest=similar,
            fix=f"{similar[0]}, which is shipped; 'aloft graph' lists all"
            if shipped
            else similar[0],
        )
        return _Flattener(problems).run(path, None, overrides)
    return _Flattener(problems).run(path, read_file(path, str(path), problems), overrides)


def flatten_text(text: str, path: Path, overrides: Overrides, problems: Problems) -> FlatGraph:
    """Flatten the graph in a text that stands for the file ``path``."""
    return _Flattener(problems).run(path, read_mapping(text, str(path), problems), overrides)


class _Flattener:
    def __init__(self, problems: Problems) -> None:
        self.problems = problems
        self.files = FileTree(problems)
        self.drafts: dict[str, _GraphDraft] = {}
        self.instances: dict[str, Instance] = {}

    def run(self, path: Path, tree: MapNode | None, overrides: Overrides) -> FlatGraph:
        shown = str(path)
        commands = read_overrides(overrides, self.problems)
        graph = MapNode((), Position(shown, 0, 0))
        robot_folder = path.parent
        empty = False
        if tree is not None and is_another_kind(tree, shown, self.problems):
            tree = None
        self.files.incomplete = tree is None
        if tree is not None:
            root = read_graph(tree, shown, path.parent, self.problems, subgraph=False)
            scope = _Scope(Bindings(None, self.problems), stack=((path.resolve(), shown),))
            files = self.files.gather(root, scope.stack)
            empty = not any(_has_blocks(file) for file in files)
            names = [block.name for file in files for block in file.blocks]
            own = tuple(o for o in commands if not is_graph_key(o, names))
            given: list[tuple[tuple[str, ...], Node, Position, Path]] = [
                ((entry.key,), entry.value, entry.key_where, file.folder)
                for file in files
                for entry in file.graph
            ]
            given += [
                (tuple(command.key.split(".")), command.value, command.where, path.parent)
                for command in commands
                if is_graph_key(command, names)
            ]
            for keys, value, where, folder in given:
                graph = merge(graph, keys, value, where)
                if keys == ("robot",):
                    robot_folder = folder
            self._expand(files, replace(scope, sets=own))
        resolver = Resolver(self.instances, self.problems)
        rate = graph.get("rate")
        base_rate = rate.value if rate is not None else None
        blocks = tuple(
            wrap_offset(_finish(draft, resolver), base_rate)
            if draft.shifted
            else _finish(draft, resolver)
            for draft in self.drafts.values()
        )

        blocks = placed(
            blocks, mapping_of(graph, "place", self.problems), self.instances, self.problems
        )
        return FlatGraph(
            name=path.stem,
            file=shown,
            folder=path.parent,
            blocks=blocks,
            robot_folder=robot_folder,
            overrides={command.key: plain(command.value) for command in commands},
            empty=empty and not self.files.incomplete,
            incomplete=self.files.incomplete,
            broken=tuple(p for p, instance in self.instances.items() if instance.broken),
            subgraphs=resolver.outputs(),
            subgraph_inputs=Resolver(self.instances, Problems()).inputs(),
            **graph_keys(graph, self.problems),
        )

    def _expand(self, files: list[WrittenGraph], scope: _Scope) -> None:
        prefix = scope.prefix
        sets: list[Override] = []
        wires: dict[str, _GivenWire] = {}
        first: dict[str, WrittenBlock] = {}
        mine: list[tuple[WrittenBlock, WrittenGraph]] = []
        for file in files:
            for found in read_sets(file.sets, prefix, self.problems):
                sets.append(replace(found, value=scope.bindings.substitute(found.value)))
            for entry in file.wires:
                target = f"{prefix}{entry.key}"
                link = self._link(entry, scope, target)
                wires[target] = (link, entry.key_where, file.file)
            for block in file.blocks:
                if block.name in first:
                    self._duplicate(prefix + block.name, block.where, first[block.name].where)
                    continue
                first[block.name] = block
                mine.append((block, file))
        inner = replace(scope, sets=(*sets, *scope.sets), wires={**wires, **scope.wires})
        sets_of: dict[str, list[Override]] = {}
        for override in inner.sets:
            sets_of.setdefault(override.block, []).append(override)
        wires_to: dict[str, dict[str, _GivenWire]] = {}
        for target, given in inner.wires.items():
            path, _, name = target.rpartition(".")
            wires_to.setdefault(path, {})[name] = given
        for block, file in mine:
            path = prefix + block.name
            self._block(block, file, inner, sets_of.get(path, ()), wires_to.get(path, {}))
        self._report_lost(sets, wires, scope)

    def _report_lost(
        self,
        sets: Iterable[Override],
        wires: Mapping[str, _GivenWire],
        scope: _Scope,
    ) -> None:
        """Report overrides and wires of blocks that do not exist."""
        lost = [(o.block, o.key, o.where, Code.OVERRIDE) for o in sets]
        if scope.instance is None:
            lost += [(o.block, o.key, o.where, Code.OVERRIDE) for o in scope.sets]
        for target, (_, where, _) in wires.items():
            block, dot, _ = target.rpartition(".")
            if not dot:
                self.problems.add(
                    Code.WRONG_KIND,
                    f"{target!r} does not name an input",
                    where,
                    expected="block.input: source",
                    found=target,
                )
                continue
            lost.append((block, target, where, Code.UNKNOWN_INPUT))
        paths = [*self.drafts, *self.instances]
        if self.files.incomplete:
            return
        for block, key, where, code in lost:
            if block in self.drafts or block in self.instances:
                continue
            if any(block.startswith(f"{p}/") and i.broken for p, i in self.instances.items()):
                continue
            report_unknown_block(key, block, where, paths, self.problems, code)

    def _duplicate(self, path: str, where: Position, other: Position) -> None:
        self.problems.add(
            Code.DUPLICATE_BLOCK,
            f"there are two blocks {path!r}",
            where,
            at=path,
            other=path,
            other_where=other,
            fix="rename one; to change a block of an included file use 'set' and 'wires'",
        )

    def _link(self, entry: Entry, scope: _Scope, at: str) -> WrittenWire | None:
        node = scope.bindings.substitute(entry.value)
        return read_wire(node, scope.prefix, scope.instance, at, self.problems)

    def _block(
        self,
        block: WrittenBlock,
        file: WrittenGraph,
        scope: _Scope,
        sets: Sequence[Override],
        wires: Mapping[str, _GivenWire],
    ) -> None:
        """Add a block, or expand a sub-graph; ``sets`` and ``wires`` are what other files give it."""
        path = scope.prefix + block.name
        if not self._has_room_for(path, block.where):
            return
        use, parameters = _overridden(block, scope, sets)
        name = named_use(use, path, self.problems)
        links, places = self._links(block, file, scope, path, wires)
        draft = _GraphDraft(
            FlatBlock(
                path,
                block.where,
                name,
                use.where if use is not None and name else block.where,
                file.folder,
                parameters,
                input_places=places,
                **_timing(block, scope),
            ),
            links,
            block.offset is None and (block.rate is not None or scope.shifted),
        )
        if not name.endswith(SUBGRAPH_SUFFIXES):
            self.drafts[path] = draft
            return
        self._report_background(draft.block)
        self._instance(draft, file, scope)

    def _has_room_for(self, path: str, where: Position) -> bool:
        """Check that the graph is not too large, and that no block has that path yet; report it."""
        if len(self.drafts) >= _MAXIMAL_BLOCKS:
            self.problems.add(Code.TOO_LARGE, f"more than {_MAXIMAL_BLOCKS} blocks", where)
            return False
        if path in self.drafts or path in self.instances:
            present = self.drafts[path].block if path in self.drafts else self.instances[path]
            self._duplicate(path, where, present.where)
            return False
        return True

    def _report_background(self, block: FlatBlock) -> None:
        """Report a sub-graph that should work in the background."""
        if block.background is None:
            return
        self.problems.add(
            Code.MISPLACED_KEY,
            f"{block.path} uses a sub-graph, and only single blocks work in the background",
            block.background.where,
            at=f"{block.path}.background",
            fix="move 'background' to a block of the sub-graph",
        )

    def _links(
        self,
        block: WrittenBlock,
        file: WrittenGraph,
        scope: _Scope,
        path: str,
        wires: Mapping[str, _GivenWire],
    ) -> tuple[dict[str, WrittenWire | None], dict[str, Position]]:
        links: dict[str, WrittenWire | None] = {}
        places: dict[str, Position] = {}
        for entry in block.inputs or ():
            links[entry.key] = self._link(entry, scope, f"{path}.{entry.key}")
            places[entry.key] = entry.key_where
        for name, (link, where, wire_file) in wires.items():
            if name in places and wire_file == file.file:
                target = f"{path}.{name}"
                self.problems.add(
                    Code.WIRED_TWICE,
                    f"{target} is wired here and at its block",
                    where,
                    at=target,
                    other=target,
                    other_where=places[name],
                    fix="remove one of the two",
                )
                continue
            links[name] = link
            places[name] = where
        return links, places

    def _instance(self, draft: _GraphDraft, file: WrittenGraph, scope: _Scope) -> None:
        """Expand one use of a sub-graph."""
        block, problems = draft.block, self.problems
        path = block.path
        instance = Instance(path, block.where, block.use, draft.links)
        self.instances[path] = instance
        located = self.files.locate(ScalarNode(block.use, block.use_where), file, scope.stack)
        subgraph = self.files.read(*located, subgraph=True) if located else None
        if located is None or subgraph is None:
            return
        stack = (*scope.stack, located)
        incomplete, self.files.incomplete = self.files.incomplete, False
        files = self.files.gather(subgraph, stack, subgraph=True)
        missing, self.files.incomplete = self.files.incomplete, incomplete
        values = parameter_values(block, subgraph, problems)
        if values is None or missing:
            return
        instance.broken = False
        instance.declare_inputs(subgraph, block.input_places, problems)
        report_unused(subgraph, files, problems)
        inner = replace(
            scope,
            bindings=Bindings(values, problems),
            instance=path,
            stack=stack,
            rate=block.rate,
            offset=block.offset,
            machine=block.machine,
            shifted=draft.shifted,
        )
        for entry in subgraph.outputs:
            instance.outputs[entry.key] = self._link(entry, inner, f"{path}.{entry.key}")
        self._expand(files, inner)


def _overridden(
    block: WrittenBlock, scope: _Scope, sets: Iterable[Override]
) -> tuple[Node | None, MapNode]:
    """Return what a block uses and its parameters, with those of its scope and the overrides."""
    substitute = scope.bindings.substitute
    use = substitute(block.use) if block.use else None
    parameters = substitute(block.parameters) if block.parameters else None
    if not isinstance(parameters, MapNode):
        parameters = MapNode((), block.where)
    for override in sets:
        use, parameters = assign(use, parameters, override)
    return use, parameters


def _timing(block: WrittenBlock, scope: _Scope) -> dict[str, Any]:
    """Return when and where a block runs, its own or its scope's, as fields of ``FlatBlock``."""
    substitute = scope.bindings.substitute
    background = substitute(block.background) if block.background else None
    assert background is None or isinstance(background, MapNode)
    return {
        "rate": substitute(block.rate) if block.rate else scope.rate,
        "offset": substitute(block.offset) if block.offset else scope.offset,
        "machine": substitute(block.machine) if block.machine else scope.machine,
        "background": background,
    }


def _finish(draft: _GraphDraft, resolver: Resolver) -> FlatBlock:
    """Return the block, every wire of which comes from an output of a block that is no
    sub-graph."""
    wires: dict[str, FlatWire] = {}
    excused = []
    for name, link in draft.links.items():
        resolved = resolver.resolve(link, f"{draft.block.path}.{name}")
        if isinstance(resolved, FlatWire):
            wires[name] = resolved
        elif resolved is None:
            excused.append(name)
    return changed(draft.block, wires=wires, excused=tuple(excused))


def _has_blocks(file: WrittenGraph) -> bool:
    """Return whether anything is written under ``blocks``, even if it is wrong."""
    entry = file.tree.get("blocks")
    if entry is None:
        return False
    node = entry.value
    if isinstance(node, ScalarNode):
        return bool(node.value)
    return bool(node.entries if isinstance(node, MapNode) else node.items)
