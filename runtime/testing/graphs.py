"""Makes checked graphs in Python, for tests of the code that runs graphs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ...robots.description import RobotDescription
from ..language.block import Block
from ..language.delay import delay_block_type
from ..language.schedule import ScheduleBlock, order_blocks
from ..language.signals import Signal
from ..language.stages import BlockSpec, CheckedGraph, ClockSpec, Wire


@dataclass(frozen=True)
class BlockUse:
    """A block in a graph: its class, parameters, the source of each input, period and offset."""

    block_type: type[Block]
    params: Mapping[str, Any] = field(default_factory=dict)
    wires: Mapping[str, str | Wire] = field(default_factory=dict)
    period_ticks: int = 1
    offset_ticks: int = 0


def checked_graph(
    blocks: Mapping[str, BlockUse],
    *,
    rate: float = 500.0,
    ticks: int | None = None,
    robot: RobotDescription | None = None,
    dimensions: Mapping[str, int] | None = None,
    clock: ClockSpec | None = None,
    name: str = "test",
) -> CheckedGraph:
    """Make a graph from blocks by path; neither the blocks nor their wires are checked.

    A wire is the source's ``block.port``, or a ``Wire`` with a ``delay``, which becomes a delay
    block called ``block/input_delay`` that runs in the same ticks as the source.

    Raises:
        LoopError: the blocks have no order.
    """
    specs: list[BlockSpec] = []
    for path, use in blocks.items():
        wires: dict[str, Wire] = {}
        for port, wire in use.wires.items():
            target = f"{path}.{port}"
            if isinstance(wire, str):
                wire = Wire(wire, target)
            if wire.delay:
                delay = _delay_spec(f"{path}/{port}_delay", wire, blocks, robot, dimensions)
                specs.append(delay)
                wire = Wire(f"{delay.path}.y", target)
            wires[port] = wire
        specs.append(_spec(path, use, wires, robot, dimensions))
    order = order_blocks(
        ScheduleBlock(
            spec.path,
            spec.block_type.is_moore(),
            {port: wire.source for port, wire in spec.wires.items()},
        )
        for spec in specs
    )
    return CheckedGraph(name, rate, tuple(specs), order, ticks, robot, clock or ClockSpec())


def _spec(
    path: str,
    use: BlockUse,
    wires: Mapping[str, Wire],
    robot: RobotDescription | None,
    dimensions: Mapping[str, int] | None,
) -> BlockSpec:
    params = use.block_type.Params.model_validate(dict(use.params))
    use = replace(use, block_type=use.block_type.specialize(params, Path(), robot))
    sizes = {
        **(robot.dimensions if robot else {}),
        **(dimensions or {}),
        **use.block_type.dimensions(params, robot),
    }
    return BlockSpec(path, use.block_type, params, wires, sizes, use.period_ticks, use.offset_ticks)


def _delay_spec(
    path: str,
    wire: Wire,
    blocks: Mapping[str, BlockUse],
    robot: RobotDescription | None,
    dimensions: Mapping[str, int] | None,
) -> BlockSpec:
    source = blocks[wire.source_block]
    signal: type[Signal] = source.block_type.outputs[wire.source_port].signal
    sizes = _spec(wire.source_block, source, {}, robot, dimensions).dimensions
    kind = delay_block_type(signal, wire.delay)
    return BlockSpec(
        path,
        kind,
        kind.Params.model_validate({"initial": dict(wire.initial)}),
        {"u": Wire(wire.source, f"{path}.u")},
        sizes,
        source.period_ticks,
        source.offset_ticks,
    )
