"""The stages a graph goes through; each is an immutable type that can be printed and tested alone.

They are: written (what the user wrote, with the place of every key) -> flat (includes and
sub-graphs expanded, overrides applied) -> checked (this module's ``CheckedGraph``: types, units,
frames, rates and order are known to be right) -> placed (``placement.PlacedGraph``: one part for
each machine, and the links between them; only where a graph is spread over machines) -> bound
(``memory.BoundGraph``: buffers and instances of blocks).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from ...files.problems import Position
from ...robots.description import RobotDescription
from .block import Block
from .flat_graph import FlatGraph, HasSource
from .parameters import Parameters
from .quantities import Quantity


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
    """Folder of the file that the block is written in; files it names are relative to it."""
    quantities: Mapping[str, Quantity] = field(default_factory=dict)
    """Unit and frame of every field that carries what is wired, by ``port.field``."""
    machine: str = ""
    """The machine that the block runs on; empty in a graph that names no machines."""

    def carries_quaternion(self, name: str) -> bool:
        """Return whether the field ``port.field`` carries a quaternion in this graph."""
        return name in self.quantities and self.quantities[name].quaternion


@dataclass(frozen=True)
class MachineSpec:
    """A machine that runs a part of a graph, and the endpoint at which the others reach it, such as
    ``tcp/127.0.0.1:7450``."""

    name: str
    endpoint: str
    where: Position | None = None


WATCHDOG = 0.015
"""The default of ``LinkSettings.watchdog`` [s]. What damps the actuators looks every millisecond, so
they are in damping within 20 ms."""

LEASE = 3.0
"""The default of ``LinkSettings.lease`` [s]. On a machine with ten busy processes for two processors a part is silent for
up to a second; what a robot needs sooner is not of this kind, but the watch of commands."""
PATIENCE = 30.0
"""The default of ``LinkSettings.patience`` [s]."""

LinkMode = Literal["lockstep", "free"]
WhenLate = Literal["hold", "safe", "stop"]
ClockKind = Literal["free", "paced", "robot"]
Overrun = Literal["skip", "stop"]


@dataclass(frozen=True)
class LinkPolicy:
    """Policy of the reader of a free-running link when no message has come for ``max_age`` [s].

    ``hold`` keeps the last values, ``safe`` reads zeros, and ``stop`` ends the run.
    """

    max_age: float | None = None
    late: WhenLate = "stop"
    watch: bool = True
    """True if the silence of the link counts where it brings commands to actuators."""


@dataclass(frozen=True)
class LinkSettings:
    """Settings by which parts on several machines keep together.

    In ``lockstep`` each waits for the messages of its tick; ``free`` parts keep their own time and
    read the latest message. ``of`` has the policies of the links of single blocks.
    """

    mode: LinkMode = "lockstep"
    policy: LinkPolicy = LinkPolicy()
    of: Mapping[str, LinkPolicy] = field(default_factory=dict)
    paths: Mapping[str, float] = field(default_factory=dict)
    """The largest age [s] that is allowed on paths, ``block.output -> block.input``."""
    watchdog: float | None = None
    """Longest silence allowed to a link that brings commands to actuators [s]; by default
    ``WATCHDOG`` for real actuators, and any time for simulated ones."""
    lease: float = LEASE
    """Silence after which the other machines take a part for gone [s]."""
    patience: float = PATIENCE
    """The longest time for which a part in lockstep waits for a message [s]."""

    def policy_of(self, source: str) -> LinkPolicy:
        """Return the policy of the links that carry the outputs of the block ``source``."""
        return self.of.get(source, self.policy)


@dataclass(frozen=True)
class ClockSpec:
    """Pacing of a run: ``free`` (as fast as possible), ``paced`` (by wall time) or ``robot`` (the
    robot's data start a tick), and the response to an overrun of a paced run."""

    kind: ClockKind = "free"
    overrun: Overrun = "skip"
    stop_after: int = 1
    """The number of late ticks in a row that end the run, if the overrun policy is ``stop``."""
    late_after: float = 0.1
    """The share of a period after its deadline at which a tick that begins is late."""
    late_share: float | None = None
    """The largest share of late ticks with which a run is a success; ``None``: any."""
    hangs_after: float = 10.0
    """The time [s] after which a call of a block is taken to hang, which ends the run."""


@dataclass(frozen=True)
class RecordingSpec:
    """Settings of the recorder."""

    ring_bytes: int = 1 << 26
    """Bytes of the ring between run and recorder, at most, but that it always holds four keyframes."""


@dataclass(frozen=True)
class CheckedGraph:
    """A graph that may run: its blocks in file order, and the order in which they execute."""

    name: str
    base_rate: float
    """The base rate [Hz]; one tick is its inverse."""
    blocks: tuple[BlockSpec, ...]
    order: tuple[str, ...]
    """Paths of all blocks, in the order of execution within a tick."""
    ticks: int | None = None
    """The duration of a run in ticks; ``None`` if it runs until it is stopped."""
    robot: RobotDescription | None = None
    clock: ClockSpec = ClockSpec()
    recording: RecordingSpec = RecordingSpec()
    file: str = ""
    """The graph file, as it was given; files that the graph names are relative to its folder."""
    overrides: Mapping[str, Any] = field(default_factory=dict)
    flat: FlatGraph | None = None
    """The stage before, from which the graph is checked again with other parameters; ``None`` where the graph
    was put together in Python."""
    resolved: FlatGraph | None = None
    """The same with the values in place of references to what other blocks tell."""
    unchecked: tuple[str, ...] = ()
    """Wires on which the reader has a unit and the source does not say its own, one text each."""
    machines: tuple[MachineSpec, ...] = ()
    """The machines that the graph may be spread over; the first runs what is placed nowhere."""
    links: LinkSettings = LinkSettings()

    @cached_property
    def text(self) -> str:
        """The resolved graph as YAML, for recordings; empty where it was put together in Python."""
        return "" if self.resolved is None else self.resolved.text

    @property
    def base_period(self) -> float:
        """The duration of one tick [s]."""
        return 1.0 / self.base_rate

    def block(self, path: str) -> BlockSpec:
        """Return the block at that path. Raises ``KeyError``."""
        return self._by_path[path]

    @cached_property
    def _by_path(self) -> Mapping[str, BlockSpec]:
        return {spec.path: spec for spec in self.blocks}
