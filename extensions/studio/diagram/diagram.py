"""Content of a diagram: blocks and boxes with their ports, and the wires between these.

A box stands for a sub-graph. An open one has a diagram of its own inside; a closed one is drawn like
a block, with a port for everything that crosses its border.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from ....runtime.language.stages import CheckedGraph
from ....runtime.loading.picture import BlockRow, InputRow, table

INTO, OUT = "<in>", "<out>"
"""The names of the two nodes that stand for a box's own ports inside it."""


@dataclass(frozen=True)
class DiagramWire:
    """One wire between two nodes of a diagram, each end as (node, port)."""

    source: tuple[str, str]
    target: tuple[str, str]
    delay: int = 0
    truth: bool = False
    transition: str = ""
    wire_text: str = ""
    """Source as written in the graph file, such as ``robot.joints.position[2]``."""


@dataclass
class DiagramNode:
    """A block, a box, or a border of the box around it."""

    path: str
    title: str
    use: str = ""
    rate_hz: float = 0.0
    moore: bool = False
    machine: str = ""
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    labels: dict[str, str] = field(default_factory=dict)
    """Text beside a port, where it is not the port's name."""
    inside: Diagram | None = None
    is_box: bool = False


@dataclass
class Diagram:
    """One level of a graph: its nodes by path, in the order of execution, and its wires."""

    nodes: dict[str, DiagramNode]
    wires: list[DiagramWire]


def diagram(graph: CheckedGraph, closed: Collection[str] = ()) -> Diagram:
    """Build the diagram of a graph, in which the sub-graphs at the paths ``closed`` are closed."""
    rows = [row for row in table(graph) if "~" not in row.path]
    machines = {spec.path: spec.machine for spec in graph.blocks}
    links = [
        _DiagramLink(source, f"{row.path}.{item.name}", item)
        for row in rows
        for item in row.inputs
        for source in item.sources
    ]
    return _level("", rows, links, machines, closed)


def subgraphs(graph: CheckedGraph) -> tuple[str, ...]:
    """Return the paths of all sub-graphs, the outermost first."""
    found: dict[str, None] = {}
    for spec in graph.blocks:
        if "~" not in spec.path:
            parts = spec.path.split("/")[:-1]
            found.update(dict.fromkeys("/".join(parts[: k + 1]) for k in range(len(parts))))
    return tuple(found)


@dataclass(frozen=True)
class _DiagramLink:
    """A wire of the whole graph, from ``block.port`` to ``block.input``."""

    source: str
    target: str
    row: InputRow


def _level(
    prefix: str,
    rows: Sequence[BlockRow],
    links: Sequence[_DiagramLink],
    machines: dict[str, str],
    closed: Collection[str],
) -> Diagram:
    """Build the diagram of the blocks and boxes below a path."""
    nodes: dict[str, DiagramNode] = {}
    inner: dict[str, list[BlockRow]] = {}
    for row in rows:
        first, slash, _ = row.path.removeprefix(prefix).partition("/")
        path = f"{prefix}{first}"
        if not slash:
            nodes[path] = _block(row, first, machines.get(path, ""))
        else:
            nodes.setdefault(path, DiagramNode(path, first, "sub-graph", is_box=True))
            inner.setdefault(path, []).append(row)
    if prefix:
        nodes = {INTO: DiagramNode(INTO, ""), **nodes, OUT: DiagramNode(OUT, "")}
    wires: dict[DiagramWire, None] = {}
    for link in links:
        ends = _end(link.source, prefix, nodes, True), _end(link.target, prefix, nodes, False)
        if None in ends or ends == (INTO, OUT):
            continue
        source, target = ends
        assert source is not None and target is not None
        if source == target and nodes[source].is_box:
            continue  # inside of the box
        out = _port(nodes[source], link.source, prefix, True)
        # several readers behind a border share the port of their common source
        into = _port(nodes[target], link.target, prefix, False, link.source)
        item = link.row
        shown = DiagramWire(
            (source, out), (target, into), item.delay, item.truth,
            item.transition_of(link.source), item.source,
        )  # fmt: skip
        wires.setdefault(shown)
    for path, mine in inner.items():
        if path not in closed:
            nodes[path].inside = _level(f"{path}/", mine, links, machines, closed)
    return Diagram(nodes, list(wires))


def _block(row: BlockRow, title: str, machine: str) -> DiagramNode:
    return DiagramNode(
        row.path,
        title,
        f"{row.use}, {row.background} behind" if row.background else row.use,
        row.rate_hz,
        row.machine == "Moore",
        machine,
        [item.name for item in row.inputs],
        [text.partition(":")[0] for text in row.outputs],
    )


def _end(port: str, prefix: str, nodes: dict[str, DiagramNode], is_source: bool) -> str | None:
    """Return the node of a level at which an end of a wire lies; its border if it lies outside."""
    block = port.rpartition(".")[0]
    if not block.startswith(prefix):
        return (INTO if is_source else OUT) if prefix else None
    path = f"{prefix}{block.removeprefix(prefix).partition('/')[0]}"
    return path if path in nodes else None


def _port(node: DiagramNode, end: str, prefix: str, is_source: bool, source: str = "") -> str:
    """Return the port of a node for an end of a wire; boxes and borders get one where it is
    missing."""
    if not node.is_box and node.path not in (INTO, OUT):
        return end.rpartition(".")[2]
    ports = node.outputs if is_source else node.inputs
    # a border's port is named by the source, so that it is the same inside and outside
    name = end if is_source else (source or end)
    if name not in ports:
        ports.append(name)
        node.labels[name] = end.rpartition(".")[2]
    return name
