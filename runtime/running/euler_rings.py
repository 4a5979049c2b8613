"""Finds rings of ``blocks.Integrator`` that grow only because forward Euler adds energy.

Two of them in a ring are an oscillator, such as a mass on a spring. In continuous time it may be stable
and as a graph not: each tick turns a pole s into 1 + T s, which lies outside of the unit circle where
|s| T is larger than the damping allows. Such a graph runs to its end, and nothing else would say it.
"""

from __future__ import annotations

import cmath
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import exp, log, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..language.errors import AloftError
from ..language.kernel_block import KernelBlock
from ..language.stages import BlockSpec, CheckedGraph
from .memory import BoundGraph

INTEGRATOR = "Integrator"
"""The class of ``blocks.general`` that integrates by forward Euler."""
MOST_BLOCKS = 40
"""Larger rings are passed over: those of a robot's whole controller, which no pair of integrators decides."""
STEP = 1e-4
"""Change of a state by which the ring is linearised, relative to its size or to one."""
SMALL = 1e-5
"""Growth in a tick that is no growth: two poles at one split by the root of the rounding."""
FIRST_TICKS = 3
"""Ticks before the one that is linearised, in which filters and derivatives find their first inputs."""


def growing_rings(graph: CheckedGraph) -> list[str]:
    """Return a warning for every ring that is stable in continuous time and grows as a graph."""
    found = []
    for ring in _rings(graph):
        integrators = [spec.path for spec in ring if _is_integrator(spec)]
        if len(integrators) < 2 or not _can_be_linearised(ring):
            continue
        period = graph.base_period * ring[0].period_ticks
        try:
            poles = np.linalg.eigvals(_one_tick(graph, ring))
        except (AloftError, ArithmeticError, ValueError, np.linalg.LinAlgError):
            continue  # the graph's own run will say what is wrong with it
        growing = [z for z in poles.tolist() if abs(z) > 1.0 + SMALL]
        if growing and all(((z - 1.0) / period).real <= SMALL / period for z in growing):
            worst = max(growing, key=abs)
            found.append(_text(ring, integrators, worst, period))
    return found


def _text(
    ring: Sequence[BlockSpec], integrators: Sequence[str], pole: complex, period: float
) -> str:
    growth = exp(min(log(abs(pole)) / period, 100.0)) - 1.0
    frequency = abs(cmath.phase(pole)) / (2.0 * pi * period)
    where = ring[0].where
    place = f"{where}: " if where is not None else ""
    return (
        f"{place}the ring {', '.join(spec.path for spec in ring)} is stable in continuous time, and grows by "
        f"{100.0 * growth:.3g} % a second at {frequency:.3g} Hz, because blocks.Integrator is forward Euler; "
        f"put blocks.DoubleIntegrator in the place of {' and '.join(integrators[:2])}, or raise the rate"
    )


def _is_integrator(spec: BlockSpec) -> bool:
    kind = spec.block_type
    return kind.__name__ == INTEGRATOR and kind.__module__.endswith(
        "general.integrators_and_delays"
    )


def _can_be_linearised(ring: Sequence[BlockSpec]) -> bool:
    """Return whether all blocks are small, compute in kernels alone, and run in the same ticks."""
    clocks = {(spec.period_ticks, spec.offset_ticks) for spec in ring}
    pure = all(
        (spec.block_type.named_steps and not spec.block_type.overridden_steps)
        or issubclass(spec.block_type, KernelBlock)
        for spec in ring
    )
    return pure and len(clocks) == 1 and len(ring) <= MOST_BLOCKS


def _rings(graph: CheckedGraph) -> Iterator[list[BlockSpec]]:
    """Yield the strongly connected parts of the wires that have more than one block (Tarjan)."""
    sources = {
        spec.path: [wire.source.rpartition(".")[0] for wire in spec.wires.values()]
        for spec in graph.blocks
    }
    place = {spec.path: spec for spec in graph.blocks}
    number: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    for root in place:
        if root in number:
            continue
        walk = [(root, iter(sources[root]))]
        number[root] = low[root] = len(number)
        stack.append(root)
        while walk:
            path, rest = walk[-1]
            following = next((each for each in rest if each in place), None)
            if following is None:
                walk.pop()
                if walk:
                    low[walk[-1][0]] = min(low[walk[-1][0]], low[path])
                if low[path] == number[path]:
                    begin = stack.index(path)
                    part, stack[begin:] = stack[begin:], []
                    for each in part:
                        low[each] = len(place)  # out of the stack: no ring leads back to it
                    if len(part) > 1:
                        inside = set(part)
                        yield [spec for spec in graph.blocks if spec.path in inside]
            elif following not in number:
                number[following] = low[following] = len(number)
                stack.append(following)
                walk.append((following, iter(sources[following])))
            elif following in stack:
                low[path] = min(low[path], number[following])


def _one_tick(graph: CheckedGraph, ring: Sequence[BlockSpec]) -> NDArray[np.float64]:
    """Return the matrix by which a tick changes the ring's states near those at the start; what comes
    from outside the ring is zero."""
    inside = {spec.path for spec in ring}
    cut = [
        replace(spec, wires={
            name: wire for name, wire in spec.wires.items() if wire.source.rpartition(".")[0] in inside
        })
        for spec in ring
    ]  # fmt: skip
    order = tuple(path for path in graph.order if path in inside)
    bound = BoundGraph(replace(graph, blocks=tuple(cut), order=order, robot=None))
    states = _states(bound, cut)
    for _ in range(FIRST_TICKS):
        _run(bound.blocks, order)
        bound.clock.tick += ring[0].period_ticks
    begin = bound.snapshot()
    start = np.concatenate([state.reshape(-1) for state in states])
    columns = []
    for number in range(len(start)):
        ends = []
        step = STEP * max(1.0, abs(float(start[number])))
        for sign in (1.0, -1.0):
            bound.restore(begin)
            _write(states, number, float(start[number]) + sign * step)
            _run(bound.blocks, order)
            ends.append(np.concatenate([state.reshape(-1) for state in states]))
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    return np.stack(columns, axis=1)


def _states(bound: BoundGraph, ring: Sequence[BlockSpec]) -> list[NDArray[np.float64]]:
    """Return views of all states of the ring that are floating-point numbers."""
    found = []
    for spec in ring:
        for name, state in spec.block_type.states.items():
            for field_name, field in state.signal.fields.items():
                if field.dtype_name == "float64":
                    found.append(bound.memory.state.field(f"{spec.path}.{name}.{field_name}"))
    return found


def _write(states: Sequence[NDArray[np.float64]], number: int, value: float) -> None:
    for state in states:
        if number < state.size:
            state.reshape(-1)[number] = value
            return
        number -= state.size


def _run(blocks: Mapping[str, Any], order: Sequence[str]) -> None:
    """Run all blocks once: Moore blocks write first and update last."""
    for path in order:
        block = blocks[path]
        if type(block).is_moore():
            block.emit()
        else:
            block.step()
    for path in order:
        if type(blocks[path]).is_moore():
            blocks[path].update()
