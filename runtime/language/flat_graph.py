"""The second stage: one graph with its includes and sub-graphs expanded and overrides applied."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from ...files.nodes import Entry, MapNode, Node, plain, text_of
from ...files.problems import Position
from ...robots.description import ROBOT_FILES
from ...robots.importing.package_files import SCHEME
from .selection import WHOLE, Selection

_WIDTH = 100
Item = TypeVar("Item")


class HasSource:
    """The base of every stage's wire, which has a ``source``: an output ``block.port``."""

    source: str

    @property
    def source_block(self) -> str:
        """The path of the block that writes."""
        return self.source.rpartition(".")[0]

    @property
    def source_port(self) -> str:
        """The name of the output."""
        return self.source.rpartition(".")[2]


@dataclass(frozen=True)
class WireElement:
    """One piece of a wire that is put together: what is selected of a source, or a ``literal``."""

    where: Position
    wire: FlatWire | None = None
    selection: Selection = WHOLE
    literal: Node | None = None

    def plain(self) -> Any:
        """Return the piece as written in a graph file."""
        if self.literal is not None:
            return plain(self.literal)
        assert self.wire is not None
        return f"{self.wire.source}{self.selection}"


@dataclass(frozen=True)
class WireSlice(Generic[Item]):
    """Source of one field of an input: one item, or a list of several one behind another.

    ``field`` is empty for the input's only field. Items are wires as they are written, and elements
    once sub-graphs are expanded.
    """

    field: str
    where: Position
    items: tuple[Item, ...]
    is_list: bool = False


@dataclass(frozen=True)
class FlatWire(HasSource):
    """Source of one input: the output ``source`` (``block.port``), a ``constant``, or ``slices``
    that are put together."""

    source: str
    where: Position
    delay: int = 0
    initial: MapNode | None = None
    truth: bool = False
    constant: MapNode | None = None
    slices: tuple[WireSlice[WireElement], ...] = ()
    shown: str = ""
    """Text in the graph in place of ``source``, where loading has put a block between."""

    @property
    def selected(self) -> str:
        """Selection written behind the source: ``.position[2]``."""
        return self.shown.removeprefix(self.source) if self.shown else ""

    def inner(self) -> tuple[FlatWire, ...]:
        """Return the wires that this one is made of: itself, or those of its parts; none of a
        constant."""
        if self.constant is not None:
            return ()
        items = [item for wire_slice in self.slices for item in wire_slice.items]
        return tuple(i.wire for i in items if i.wire is not None) if self.slices else (self,)

    def plain(self) -> Any:
        """Return the wire as written in a graph file."""
        if self.constant is not None:
            return {"value": plain(self.constant)}
        source: Any = self.source
        if self.slices:
            one = len(self.slices) == 1 and not self.slices[0].field
            fields = {wire_slice.field: plain_slice(wire_slice) for wire_slice in self.slices}
            source = fields[""] if one else fields
        if not self.delay and not self.truth:
            return source
        data: dict[str, Any] = {"from": source}
        if self.delay:
            data["delay"] = self.delay
        if self.initial is not None:
            data["initial"] = plain(self.initial)
        if self.truth:
            data["allow"] = "truth"
        return data


def plain_slice(wire_slice: WireSlice[WireElement]) -> Any:
    """Return the part as written in a graph file."""
    items = [item.plain() for item in wire_slice.items]
    return items if wire_slice.is_list else items[0]


@dataclass(frozen=True)
class FlatBlock:
    """One block. ``excused`` inputs are unwired because of a problem that is already reported."""

    path: str
    where: Position
    use: str
    use_where: Position
    folder: Path
    parameters: MapNode
    wires: Mapping[str, FlatWire] = field(default_factory=dict)
    rate: Node | None = None
    offset: Node | None = None
    excused: tuple[str, ...] = ()
    input_places: Mapping[str, Position] = field(default_factory=dict)
    """Place of the name of each wired input."""
    machine: Node | None = None
    """The name of the machine that the block is placed on."""
    background: MapNode | None = None
    """Settings for work in the background; ``None`` if the block has none."""

    @property
    def _settings(self) -> Mapping[str, Any]:
        """Settings given beside the block's use, parameters and wires, as plain data."""
        given = {
            "rate": self.rate,
            "offset": self.offset,
            "on": self.machine,
            "background": self.background,
        }
        return {key: plain(node) for key, node in given.items() if node is not None}

    def plain(self) -> dict[str, Any]:
        """Return the block as an entry of ``blocks``, as plain data."""
        return {
            "use": self.use,
            "with": plain(self.parameters),
            "in": {name: wire.plain() for name, wire in self.wires.items()},
            **self._settings,
        }

    def text(self) -> str:
        """Return the block as an entry of ``blocks``."""
        lines = [f"  {self.path}:", f"    use: {text_of(self.use)}"]
        lines += _section("with", _escape(plain(self.parameters)))
        lines += _section("in", {name: wire.plain() for name, wire in self.wires.items()})
        lines += [f"    {key}: {text_of(value)}" for key, value in self._settings.items()]
        return "\n".join(lines)


@dataclass(frozen=True)
class FlatGraph:
    """The whole graph.

    ``incomplete`` is true if some file could not be read, so that names may be missing. ``broken``
    holds the paths of the sub-graph blocks that could not be expanded.
    """

    name: str
    file: str
    folder: Path
    blocks: tuple[FlatBlock, ...]
    rate: Entry | None = None
    duration: Entry | None = None
    robot: Entry | None = None
    robot_folder: Path = Path()
    actuators: Entry | None = None
    dimensions: MapNode | None = None
    clock: MapNode | None = None
    recording: MapNode | None = None
    machines: MapNode | None = None
    links: MapNode | None = None
    faults: MapNode | None = None
    overrides: Mapping[str, Any] = field(default_factory=dict)
    empty: bool = False
    """True if no file has any blocks."""
    incomplete: bool = False
    broken: tuple[str, ...] = ()
    subgraphs: Mapping[str, Mapping[str, FlatWire]] = field(default_factory=dict)
    """The sub-graph blocks that were expanded, and where their outputs come from."""
    subgraph_inputs: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """The same for their inputs, ``block.port``, as far as each is one whole output."""

    def plain(self) -> dict[str, dict[str, Any]]:
        """Return the entries of all blocks as plain data, by their paths."""
        return {block.path: block.plain() for block in self.blocks}

    @property
    def text(self) -> str:
        """The graph as the text of a file that, lying in ``folder``, loads to the same graph."""
        lines = []
        for entry in (self.rate, self.duration):
            if entry is not None:
                lines.append(f"{entry.key}: {text_of(plain(entry.value))}")
        if self.robot is not None:
            robot = plain(self.robot.value)
            is_file = isinstance(robot, str) and robot.endswith(ROBOT_FILES)
            if is_file and not robot.startswith(SCHEME):
                robot = Path(os.path.relpath(self.robot_folder / robot, self.folder)).as_posix()
            lines.append(f"robot: {text_of(robot)}")
        if self.actuators is not None:
            lines.append(f"actuators: {text_of(plain(self.actuators.value))}")
        for key, node in (
            ("dimensions", self.dimensions),
            ("clock", self.clock),
            ("recording", self.recording),
            ("machines", self.machines),
            ("links", self.links),
            ("faults", self.faults),
        ):
            if node is not None and node.entries:
                lines.append(f"{key}: {text_of(plain(node))}")
        lines.append("blocks:" if self.blocks else "blocks: {}")
        lines.extend(block.text() for block in self.blocks)
        return "\n".join(lines) + "\n"


def _section(key: str, data: Mapping[str, Any]) -> list[str]:
    """Return the lines of a mapping inside a block: one line where it fits."""
    if not data:
        return []
    line = f"    {key}: {text_of(data)}"
    if len(line) <= _WIDTH:
        return [line]
    return [f"    {key}:", *(f"      {text_of(k)}: {text_of(v)}" for k, v in data.items())]


def _escape(value: Any) -> Any:
    """Return the value with the leading ``$`` of every text doubled, which a file reads as one
    ``$``."""
    if isinstance(value, str):
        return f"${value}" if value.startswith("$") else value
    if isinstance(value, list):
        return [_escape(item) for item in value]
    if isinstance(value, dict):
        return {key: _escape(item) for key, item in value.items()}
    return value
