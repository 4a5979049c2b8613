"""The stages a graph goes through, each an immutable type that can be printed and tested alone.

written (what the user wrote, with the place of every key) -> flat (includes and sub-graphs
expanded, overrides applied) -> checked (this module's ``CheckedGraph``: types, units, frames, rates
and order are known to be right) -> bound (``memory.BoundGraph``: buffers and block instances).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from ...robots.description import RobotDescription
from .block import Block
from .parameters import Parameters


@dataclass(frozen=True, order=True)
class Position:
    """A place in a file; lines and columns count from one. Printed as ``file:line:col``.

    Line zero stands for the file as a whole, or for an override.
    """

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}" if self.line else self.file


class HasSource:
    """What every stage's wire has: the output it comes from, ``source``, as ``block.port``."""

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
class Wire(HasSource):
    """One wire: the ``source`` output and the ``target`` input, both as ``block.port``.

    ``delay`` counts periods of the source's block. A delayed wire has been replaced by a delay
    block in a checked graph, so there it only serves printing.
    """

    source: str
    target: str
    delay: int = 0
    initial: Mapping[str, Any] = field(default_factory=dict)
    truth_allowed: bool = False
    where: Position | None = None


@dataclass(frozen=True)
class BlockSpec:
    """One block of a checked graph: everything needed to construct and bind it."""

    path: str
    block_type: type[Block]
    params: Parameters
    wires: Mapping[str, Wire]
    dimensions: Mapping[str, int] = field(default_factory=dict)
    period_ticks: int = 1
    offset_ticks: int = 0
    where: Position | None = None
    folder: Path = Path()
    """Where the file lies that the block is written in; files it names are relative to it."""


@dataclass(frozen=True)
class ClockSpec:
    """How a run is paced: ``free`` (as fast as possible), ``paced`` (wall time) or ``robot``
    (the robot says when); and what an overrun of a paced run does."""

    kind: Literal["free", "paced", "robot"] = "free"
    overrun: Literal["skip", "stop"] = "skip"
    stop_after: int = 1
    """With ``stop``: how many overruns in a row end the run."""


@dataclass(frozen=True)
class CheckedGraph:
    """A graph that may run: blocks in file order and the order they execute in."""

    name: str
    base_rate: float
    """The base rate [Hz]; one tick is its inverse."""
    blocks: tuple[BlockSpec, ...]
    order: tuple[str, ...]
    """Paths of all blocks, in the order of execution within a tick."""
    ticks: int | None = None
    """How long the graph runs by itself; ``None``: until stopped."""
    robot: RobotDescription | None = None
    clock: ClockSpec = ClockSpec()
    file: str = ""
    """The graph file, as it was given; what the graph names is relative to where it lies."""
    text: str = ""
    """The flattened graph as YAML: what ran, after includes and overrides."""
    overrides: Mapping[str, Any] = field(default_factory=dict)

    @property
    def base_period(self) -> float:
        """The seconds one tick takes."""
        return 1.0 / self.base_rate

    def block(self, path: str) -> BlockSpec:
        """The block at that path. Raises ``KeyError``."""
        for spec in self.blocks:
            if spec.path == path:
                return spec
        raise KeyError(path)
