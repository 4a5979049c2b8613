"""The first stage: one file as the user wrote it; its keys are checked, its values unchanged."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ....files.nodes import Entry, ListNode, MapNode, Node, ScalarNode, kind, plain, text_of
from ....files.problems import Code, Position, Problems, fix_for_key, listing, nearest
from ...language.errors import UnitError
from .graph_file import (
    BLOCK_KEYS,
    COMMON_KEYS,
    EXAMPLES,
    GRAPH_KEYS,
    SUBGRAPH_KEYS,
    positive_quantity,
)

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z][A-Za-z0-9_]*)*$")


@dataclass(frozen=True)
class WrittenBlock:
    """One entry of ``blocks``; an attribute is ``None`` if its key is missing."""

    name: str
    where: Position
    use: Node | None = None
    parameters: MapNode | None = None
    inputs: MapNode | None = None
    rate: Node | None = None
    offset: Node | None = None
    machine: Node | None = None
    background: MapNode | None = None


@dataclass(frozen=True)
class WrittenGraph:
    """One file. ``graph`` has the entries of the file whose keys are ``GRAPH_KEYS``."""

    file: str
    folder: Path
    tree: MapNode
    graph: tuple[Entry, ...] = ()
    include: tuple[ScalarNode, ...] = ()
    inputs: tuple[Entry, ...] = ()
    outputs: tuple[Entry, ...] = ()
    parameters: tuple[Entry, ...] = ()
    blocks: tuple[WrittenBlock, ...] = ()
    wires: tuple[Entry, ...] = ()
    sets: tuple[Entry, ...] = ()

    @property
    def text(self) -> str:
        """The file's content as YAML, with anchors and merges resolved, and without comments."""
        return "\n".join(f"{e.key}: {text_of(plain(e.value))}" for e in self.tree) + "\n"


def read_graph(
    tree: MapNode, file: str, folder: Path, problems: Problems, *, subgraph: bool
) -> WrittenGraph:
    """Check the keys of a file; what is wrong is reported to ``problems`` and left out."""
    keys = {entry.key: entry for entry in tree if not entry.key.startswith("_")}
    mine = SUBGRAPH_KEYS if subgraph else GRAPH_KEYS
    others = GRAPH_KEYS if subgraph else SUBGRAPH_KEYS
    for entry in keys.values():
        if entry.key in others:
            problems.add(
                Code.MISPLACED_KEY,
                f"{entry.key!r} belongs to the graph that is run, not to a sub-graph"
                if subgraph
                else f"{entry.key!r} belongs to the file of a sub-graph, which a block uses",
                entry.key_where,
                at=entry.key,
                fix=f"move {entry.key!r} to the graph that uses this file"
                if subgraph
                else f"remove {entry.key!r}, or use this file as a block: {{use: {file}}}",
            )
        elif entry.key not in mine + COMMON_KEYS:
            unknown_key(entry, (*mine, *COMMON_KEYS), "of a graph file", problems)

    def entries(key: str) -> tuple[Entry, ...]:
        node = _mapping(keys.get(key), problems)
        return node.entries if node else ()

    blocks = []
    for entry in entries("blocks"):
        if not entry.key.startswith("_"):
            blocks.append(_read_block(entry, problems))
    return WrittenGraph(
        file,
        folder,
        tree,
        graph=() if subgraph else tuple(keys[k] for k in GRAPH_KEYS if k in keys),
        include=_read_include(keys.get("include"), problems),
        inputs=entries("inputs") if subgraph else (),
        outputs=entries("outputs") if subgraph else (),
        parameters=entries("parameters") if subgraph else (),
        blocks=tuple(block for block in blocks if block is not None),
        wires=entries("wires"),
        sets=entries("set"),
    )


def unknown_key(entry: Entry, legal: Iterable[str], of: str, problems: Problems) -> str:
    """Report an unknown key. Returns the key that was meant, if that is clear."""
    names = tuple(legal)
    similar = nearest(entry.key, names)
    problems.add(
        Code.UNKNOWN_KEY,
        f"{entry.key!r} is not a key {of}",
        entry.key_where,
        expected=listing(names, 16),
        found=entry.key,
        nearest=similar,
        fix=fix_for_key(entry.key, text_of(plain(entry.value)), entry.key_where, similar[0])
        if similar
        else f"remove {entry.key!r}",
    )
    return similar[0] if similar else ""


def wrong_kind(node: Node, what: str, expected: str, problems: Problems, **details: str) -> None:
    """Report a value of the wrong kind."""
    problems.add(
        Code.WRONG_KIND,
        f"{what} cannot be {kind(node)}",
        node.where,
        expected=expected,
        found=kind(node),
        **details,
    )


def _mapping(entry: Entry | None, problems: Problems) -> MapNode | None:
    if entry is None:
        return None
    if isinstance(entry.value, MapNode):
        return entry.value
    if isinstance(entry.value, ScalarNode) and entry.value.value is None:
        return None  # an empty section; perhaps all its lines are commented out
    wrong_kind(entry.value, repr(entry.key), "a mapping", problems)
    return None


def _read_include(entry: Entry | None, problems: Problems) -> tuple[ScalarNode, ...]:
    if entry is None:
        return ()
    items = entry.value.items if isinstance(entry.value, ListNode) else (entry.value,)
    files = []
    for item in items:
        if isinstance(item, ScalarNode) and isinstance(item.value, str):
            files.append(item)
        elif not (isinstance(item, ScalarNode) and item.value is None):
            wrong_kind(item, "'include'", "a list of files: include: [a.yaml, b.yaml]", problems)
    return tuple(files)


def _ascii(name: str) -> str:
    """Return a name like this one in the letters that names may have; empty where there is none."""
    for letters, instead_of in (("ae", "ä"), ("oe", "ö"), ("ue", "ü"), ("ss", "ß")):
        name = name.replace(instead_of, letters)
    name = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    return name if _NAME.match(name) else ""


def _read_block(entry: Entry, problems: Problems) -> WrittenBlock | None:
    name, where = entry.key, entry.key_where
    if name == "inputs" or not _NAME.match(name):
        problems.add(
            Code.BLOCK_NAME,
            "'inputs' stands for a sub-graph's own inputs and cannot name a block"
            if name == "inputs"
            else f"{name!r} cannot name a block",
            where,
            expected="a letter from a to z or A to Z, then such letters, digits and _",
            found=name,
            fix=_ascii(name) if not name.isascii() else "",
        )
        return None
    if not isinstance(entry.value, MapNode):
        example = f"{name}: {{use: blocks.SomeBlock, in: {{input: source.output}}}}"
        wrong_kind(entry.value, f"block {name!r}", example, problems, at=name)
        return WrittenBlock(name, where)
    found = {item.key: item for item in entry.value if not item.key.startswith("_")}
    meant = [
        unknown_key(item, BLOCK_KEYS, f"of block {name!r}", problems)
        for item in found.values()
        if item.key not in BLOCK_KEYS
    ]
    if "use" not in found and "use" not in meant:
        problems.add(
            Code.MISSING_KEY,
            f"block {name!r} does not say which block it uses",
            where,
            at=name,
            expected="a key 'use'",
            fix="use: blocks.SomeBlock",
        )

    def value(key: str) -> Node | None:
        item = found.get(key)
        return item.value if item else None

    return WrittenBlock(
        name,
        where,
        value("use"),
        _mapping(found.get("with"), problems),
        _mapping(found.get("in"), problems),
        value("rate"),
        value("offset"),
        value("on"),
        _mapping(found.get("background"), problems),
    )


def read_quantity(node: Node, what: str, unit: str, problems: Problems) -> float | None:
    """Read a positive quantity as a number, or text with a unit."""
    try:
        return positive_quantity(node.value if isinstance(node, ScalarNode) else None, unit)
    except UnitError as error:
        reason = str(error)
    problems.add(
        Code.BAD_VALUE,
        f"{what} cannot be {kind(node)}" + (f": {reason}" if reason else ""),
        node.where,
        at=what,
        expected=f"a positive number in {unit}, such as {EXAMPLES[unit]}",
        found=kind(node),
    )
    return None
