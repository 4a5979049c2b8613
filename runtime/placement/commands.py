"""Which links bring commands to actuators, and how long they may be silent."""

from __future__ import annotations

from ..language.block import Block
from ..language.stages import WATCHDOG, BlockSpec, CheckedGraph


def moves_actuators(spec: BlockSpec) -> bool:
    """Whether a block has something to do to come to rest."""
    return spec.block_type.stop_cycle is not Block.stop_cycle


def silence_limit(graph: CheckedGraph, machine: str) -> float | None:
    """How long the links that bring commands to a machine may be silent [s]; ``None`` where they
    are not watched, because all actuators are simulated and the graph gives no time."""
    moving = [s for s in graph.blocks if s.machine == machine and moves_actuators(s)]
    if not moving:
        return None
    if graph.links.watchdog is not None:
        return graph.links.watchdog
    return WATCHDOG if any(spec.block_type.outside == "real" for spec in moving) else None


def command_sources(graph: CheckedGraph, machine: str) -> tuple[str, ...]:
    """The blocks of other machines on whose outputs the actuators of a machine depend, through
    whatever blocks of that machine, in the order in which they are found; without those whose
    links are not to be watched."""
    specs = {spec.path: spec for spec in graph.blocks}
    pending = [s for s in graph.blocks if s.machine == machine and moves_actuators(s)]
    seen = dict.fromkeys(spec.path for spec in pending)
    sources: dict[str, None] = {}
    while pending:
        for wire in pending.pop().wires.values():
            source = specs[wire.source_block]
            if source.machine != machine:
                if graph.links.policy_of(source.path).watch:
                    sources[source.path] = None
            elif source.path not in seen:
                seen[source.path] = None
                pending.append(source)
    return tuple(sources)
