"""The memory of a graph: one buffer for all signals (the bus) and one for all declared state.

Ports are views of these buffers and are bound once. Therefore recording a tick, taking a snapshot,
hashing a run and comparing two runs each take one memory copy. Views of inputs are read-only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.kernel_call import KernelCall, collect_calls
from ...robots.description import RobotDescription
from ..language.block import Block, Clock, Context
from ..language.collector import collector_paused
from ..language.errors import DeclarationError
from ..language.layout import Layout, PortLayout
from ..language.signals import Signal
from ..language.stages import BlockSpec, CheckedGraph
from ..language.steps import bind_steps
from .failures import blame
from .finite import FiniteCheck
from .kernel_checks import check_kernels
from .live_parameters import LiveParameters
from .region import allocate
from .snapshot import Snapshot


class Memory:
    """The bus and the state of some blocks.

    The bus holds all outputs in file order and, after them, one constant for every unwired input:
    its declared default, with zero for the fields that the default does not name, and the identity for
    quaternions.

    Raises:
        RunError: a block cannot say how large its state is, or there is not enough memory.
    """

    def __init__(self, blocks: Iterable[BlockSpec], robot: RobotDescription | None = None) -> None:
        specs = tuple(blocks)
        outputs, constants, states, own = [], [], [], []
        for spec in specs:
            for name, output in spec.block_type.outputs.items():
                fields = output.signal.fields
                four = tuple(f for f in fields if spec.carries_quaternion(f"{name}.{f}"))
                port_name = f"{spec.path}.{name}"
                outputs.append(PortLayout(port_name, output.signal, spec.dimensions, four))
            for name, port in spec.block_type.inputs.items():
                if name not in spec.wires:
                    constants.append(
                        PortLayout(f"{spec.path}.{name}", port.signal, spec.dimensions)
                    )
            kind = spec.block_type
            inner = {"constants": kind.Constants, "scratch": kind.Scratch}
            if kind.states or any(inner.values()):
                with blame(spec, "state_dimensions"):
                    further = spec.block_type.state_dimensions(spec.params, robot)
                sizes = {**spec.dimensions, **further}
                for name, state in spec.block_type.states.items():
                    states.append(PortLayout(f"{spec.path}.{name}", state.signal, sizes))
                for name, signal in inner.items():
                    if signal is not None:
                        own.append(PortLayout(f"{spec.path}.{name}", signal, sizes))
        self.bus = allocate(Layout.of([*outputs, *constants]), "signals")
        self.state = allocate(Layout.of(states), "states")
        self.own = allocate(Layout.of(own), "constants")
        """Constants and scratch: they follow from parameters and inputs, so no snapshot has them."""
        for spec in specs:
            for name, port in spec.block_type.inputs.items():
                if name not in spec.wires:
                    self._write_defaults(f"{spec.path}.{name}", port.signal, port.default or {})

    def _write_defaults(self, port: str, signal: type[Signal], defaults: Mapping[str, Any]) -> None:
        for name, value in defaults.items():
            if name not in signal.fields:
                raise DeclarationError(
                    f"default of {port}: {signal.__name__} has no field {name!r}; "
                    f"it has {', '.join(signal.fields)}"
                )
            view = self.bus.field(f"{port}.{name}")
            if np.shape(value) not in ((), view.shape):
                raise DeclarationError(
                    f"default of {port}.{name} has shape {np.shape(value)}, expected {view.shape}"
                )
            view[...] = value

    def bind(self, block: Block, spec: BlockSpec) -> None:
        """Give a block its ports and state as attributes; inputs cannot be written."""
        # setattr, because after any use of __dict__ CPython's attribute access stays slower
        for name, port in spec.block_type.inputs.items():
            wire = spec.wires.get(name)
            source = wire.source if wire is not None else ""
            full_name = f"{spec.path}.{name}"
            signal = self.bus.signal(port.signal, full_name, writable=False, source=source)
            setattr(block, name, signal)
        for name, output in spec.block_type.outputs.items():
            setattr(block, name, self.bus.signal(output.signal, f"{spec.path}.{name}"))
        for name, state in spec.block_type.states.items():
            setattr(block, name, self.state.signal(state.signal, f"{spec.path}.{name}"))
        kind = spec.block_type
        if kind.Constants is not None:
            block.constants = self.own.signal(kind.Constants, f"{spec.path}.constants")
        if kind.Scratch is not None:
            block.scratch = self.own.signal(kind.Scratch, f"{spec.path}.scratch")

    def set_up(self, block: Block, spec: BlockSpec) -> None:
        """Bind a block and let it set itself up; then its step can run."""
        self.bind(block, spec)
        block.setup()
        block.prepare()
        bind_steps(block)

    def snapshot(self, tick: int) -> Snapshot:
        """Return a copy of both buffers."""
        return Snapshot(tick, self.bus.buffer.tobytes(), self.state.buffer.tobytes())

    def restore(self, snapshot: Snapshot) -> None:
        """Set both buffers to the snapshot's.

        Raises:
            ValueError: the snapshot's sizes show that it is of another graph.
        """
        for region, data in ((self.bus, snapshot.bus), (self.state, snapshot.state)):
            if len(data) != region.buffer.size:
                raise ValueError(
                    f"the snapshot has {len(data)} bytes where this graph has {region.buffer.size}"
                )
            region.buffer[:] = np.frombuffer(data, np.uint8)


class BoundGraph:
    """A checked graph with its memory and its block instances, set up and ready to start.

    Args:
        graph: the graph.
        clock: its clock; by default a new one.

    Raises:
        RunError: a block's constructor or ``setup`` failed; it names the block.
    """

    clock_type: type[Clock] = Clock
    machine = ""
    """Machine whose part of a graph this is; empty for a whole graph."""

    @collector_paused()
    def __init__(self, graph: CheckedGraph, clock: Clock | None = None) -> None:
        self.graph = graph
        self.clock = clock or self.clock_type(graph.base_period)
        self.memory = Memory(graph.blocks, graph.robot)
        self.running: NDArray[np.int64] = np.full(1, -1)
        """The place in the order of the block that runs in a chain, (1,); see ``chain``."""
        self.blocks: dict[str, Block] = {}
        with collect_calls() as calls:
            for spec in graph.blocks:
                self.blocks[spec.path] = self._set_up(spec)
            self.finite_check = FiniteCheck(self.memory.bus)
        self.kernel_calls: Sequence[KernelCall] = tuple(calls)
        """The calls of kernels that the blocks made in ``setup``, and those of the finite check."""
        self.parameters = LiveParameters(self.blocks)
        check_kernels(graph, self.blocks)

    def _set_up(self, spec: BlockSpec) -> Block:
        context = Context(
            path=spec.path,
            clock=self.clock,
            period_ticks=spec.period_ticks,
            offset_ticks=spec.offset_ticks,
            dimensions=spec.dimensions,
            robot=self.graph.robot,
            wired=tuple(spec.wires),
            folder=spec.folder,
            graph_folder=Path(self.graph.file).parent,
        )
        with blame(spec, "setup"):
            block = spec.block_type(spec.params, context)
            self.memory.set_up(block, spec)
        return block

    def snapshot(self) -> Snapshot:
        """Return the whole state of the graph now, after every block's ``save_state``."""
        for block in self.blocks.values():
            block.save_state()
        return self.memory.snapshot(self.clock.tick)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot and call every block's ``load_state``; the graph may run on from there.

        Raises:
            ValueError: the snapshot's sizes show that it is of another graph.
        """
        self.memory.restore(snapshot)
        self.clock.tick = snapshot.tick
        self.clock.stop_reason = None
        self.clock.stopped_by = ""
        for block in self.blocks.values():
            block.load_state()
