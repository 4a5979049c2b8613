"""Builds a graph in Python, through the same checker as a file, and writes it as YAML.

::

    graph = GraphBuilder(rate="100 Hz", duration="2 s")
    setpoint = graph.add("setpoint", "blocks.SineWave", amplitude=1.0)
    error = graph.add("error", "blocks.Sum", weights=[1, -1])
    rate = graph.add("rate", "blocks.Gain", {"u": error.y}, gain="4 1/s")
    position = graph.add("position", "blocks.Integrator", {"u": rate.y})
    graph.wire("error.a", setpoint.y)
    graph.wire("error.b", position.y)
    result = graph.build().run()
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..files.nodes import text_of
from ..files.problems import nearest
from .graph import Graph, load
from .language.block import Block
from .language.errors import AloftError
from .language.registry import block_name


class Source:
    """An output, a field of it or some elements: ``block.port``, ``.field``, ``[2]``, ``[1:3]``."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __getattr__(self, name: str) -> Source:
        if name.startswith("__"):
            raise AttributeError(name)
        return Source(f"{self.text}.{name}")

    def __getitem__(self, index: Any) -> Source:
        parts = index if isinstance(index, tuple) else (index,)
        return Source(f"{self.text}[{', '.join(map(_index, parts))}]")

    def __repr__(self) -> str:
        return f"<Source {self.text}>"


def _index(part: Any) -> str:
    if not isinstance(part, slice):
        return str(part)
    ends = [part.start, part.stop, *([part.step] if part.step is not None else [])]
    return ":".join("" if end is None else str(end) for end in ends)


class GraphBuilder:
    """A graph that grows. ``keys`` are those of a graph file: rate, duration, robot, clock, ...

    Args:
        folder: where files and modules that it names are searched for; by default the current one.
        name: what reports and recordings call it.
    """

    def __init__(self, *, name: str = "graph", folder: str | Path = ".", **keys: Any) -> None:
        self.name = name
        self.folder = Path(folder)
        self._keys = dict(keys)
        self._blocks: dict[str, dict[str, Any]] = {}

    def add(
        self,
        name: str,
        use: str | type[Block],
        inputs: Mapping[str, Any] | None = None,
        *,
        rate: Any = None,
        offset: int | None = None,
        on: str | None = None,
        background: Mapping[str, Any] | None = None,
        **parameters: Any,
    ) -> Source:
        """Add a block, or with a file's name a sub-graph. Returns the source of its outputs.

        Raises:
            AloftError: there is a block of that name.
        """
        if name in self._blocks:
            raise AloftError(f"there are two blocks {name!r}")
        block: dict[str, Any] = {"use": use if isinstance(use, str) else block_name(use)}
        if parameters:
            block["with"] = _plain(parameters)
        block["in"] = _plain(inputs or {})
        given = {"rate": rate, "offset": offset, "on": on, "background": background}
        block |= {key: _plain(value) for key, value in given.items() if value is not None}
        self._blocks[name] = block
        return Source(name)

    def wire(
        self,
        target: str,
        source: Any,
        *,
        delay: int = 0,
        initial: Mapping[str, Any] | None = None,
        allow: str | None = None,
    ) -> None:
        """Wire an input, ``block.input``. A source may be whatever a graph file allows.

        Raises:
            AloftError: there is no such block, or the input is wired already.
        """
        name, _, port = target.rpartition(".")
        if name not in self._blocks:
            near = nearest(name, self._blocks)
            hint = f"; the nearest is {near[0]}" if near else ""
            raise AloftError(f"there is no block {name!r}{hint}")
        wires = self._blocks[name]["in"]
        if port in wires:
            raise AloftError(f"{target} is wired already")
        if not delay and allow is None:
            wires[port] = _plain(source)
            return
        wire = {"from": _plain(source), "delay": delay, "initial": initial, "allow": allow}
        wires[port] = {key: _plain(value) for key, value in wire.items() if value}

    def yaml(self) -> str:
        """Return the graph as the text of a file."""
        lines = [f"{key}: {text_of(_plain(value))}" for key, value in self._keys.items()]
        lines.append("blocks:" if self._blocks else "blocks: {}")
        for name, block in self._blocks.items():
            lines.append(f"  {name}:")
            lines += [f"    {key}: {text_of(value)}" for key, value in block.items() if value != {}]
        return "\n".join(lines) + "\n"

    def write(self, path: str | Path) -> None:
        """Write the graph as a file."""
        Path(path).write_text(self.yaml(), encoding="utf-8")

    def build(self, overrides: Mapping[str, Any] | Sequence[str] = ()) -> Graph:
        """Return the checked graph.

        Raises:
            LoadError: the graph may not run. Places in the report are those of ``yaml``.
        """
        return load(self.yaml(), overrides, path=self.folder / f"{self.name}.yaml")

    def __repr__(self) -> str:
        return f"<GraphBuilder {self.name!r}: {len(self._blocks)} blocks>"


def _plain(value: Any) -> Any:
    """Convert sources to texts and arrays to lists."""
    if isinstance(value, Source):
        return value.text
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return value
