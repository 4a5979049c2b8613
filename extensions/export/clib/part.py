"""The part of a graph that becomes a library: its blocks with their calls, and what is outside."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from ....mathematics.compiling.fingerprint import numba_functions
from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.compiling.numba_calls import name_of
from ....runtime.language.block import Block, Output
from ....runtime.language.errors import AloftError
from ....runtime.language.parameters import Parameters, is_live
from ....runtime.language.stages import BlockSpec, CheckedGraph
from ....runtime.running.memory import BoundGraph
from .cut import Cut, Terminal, cut


class NeedsPython(AloftError):
    """Blocks of a part that need Python; ``reasons`` names each with its place."""

    def __init__(self, reasons: Sequence[str]) -> None:
        count = "1 block needs" if len(reasons) == 1 else f"{len(reasons)} blocks need"
        super().__init__("\n  ".join((f"{count} Python, so there is no library:", *reasons)))
        self.reasons = tuple(reasons)


class NumberParameter(NamedTuple):
    """One number of a live parameter: its name in C, its place in its array, and its bounds."""

    name: str
    block: str
    parameter: str
    element: int
    unit: str
    text: str
    at_least: float | None
    above: float | None
    at_most: float | None
    below: float | None


@dataclass(frozen=True)
class SubGraph:
    """A part of a graph, bound to memory of its own.

    Attributes:
        cut: the terminals and the blocks as they are written.
        graph: the blocks inside, and in the place of those that they read stand-ins without steps.
        bound: the graph with its memory, its blocks set up and started.
        blocks: the paths of the blocks inside, in the order of execution.
        parameters: the live parameters that a library can change.
        fixed: live parameters that it cannot, because Python computes what follows from them.
    """

    cut: Cut
    graph: CheckedGraph
    bound: BoundGraph
    blocks: tuple[str, ...]
    parameters: tuple[NumberParameter, ...]
    fixed: tuple[str, ...]


def take_part(
    path: str,
    part: str = "",
    overrides: Sequence[str] = (),
    outputs: Sequence[str] = (),
    delays: str = "inside",
) -> SubGraph:
    """Return the part of a graph that a library shall compute.

    Args:
        path: the graph file.
        part: the path of a sub-graph or of a block; empty for the whole graph without its robot.
        overrides: parameters to change.
        outputs: what the outputs are, ``block.port``; by default as ``cut`` says.
        delays: the side of those of wires into it, ``inside`` or ``outside``.

    Raises:
        LoadError: the graph may not run.
        NeedsPython: blocks in it need Python.
        AloftError: there is no such part.
    """
    found = cut(path, part, overrides, outputs, alone=True, delays=delays)
    own = {block.path for block in found.inside}
    specs = {
        spec.path: spec
        for spec in found.graph.blocks
        if spec.path in own or ("~" in spec.path and spec.path.rpartition("/")[0] in own)
    }
    outside = _outside(specs, found.graph)
    order = tuple(each for each in found.graph.order if each in specs)
    blocks = (*outside, *specs.values())
    graph = replace(
        found.graph, blocks=blocks, order=(*(each.path for each in outside), *order), ticks=None
    )
    bound = BoundGraph(graph)
    for each in order:
        bound.blocks[each].start()
    problems = [
        f"{spec.where or found.graph.file}: block '{each}' ({spec.block_type.__name__}) {reason}"
        for each, spec in specs.items()
        for reason in needs_python(bound.blocks[each])
    ]
    if problems:
        raise NeedsPython(problems)
    live = [item for each in order for item in _parameters(bound.blocks[each])]
    return SubGraph(
        found, graph, bound, order,
        tuple(each for each in live if isinstance(each, NumberParameter)),
        tuple(each for each in live if isinstance(each, str)),
    )  # fmt: skip


def _outside(specs: dict[str, BlockSpec], graph: CheckedGraph) -> list[BlockSpec]:
    """Return stand-ins for the blocks that are read and are not inside; they only have memory."""
    read: dict[str, dict[str, None]] = {}
    for spec in specs.values():
        for wire in spec.wires.values():
            if wire.source_block not in specs:
                read.setdefault(wire.source_block, {})[wire.source_port] = None
    made = []
    for path, ports in read.items():
        spec = graph.block(path)
        body: dict[str, Any] = {"__doc__": "What is outside.", "emit": _nothing, "update": _nothing}
        for name in ports:
            port = spec.block_type.outputs[name]
            body[name] = Output(port.signal, text=port.text)
        kind = type(spec.block_type.__name__, (Block,), body)
        made.append(replace(spec, block_type=kind, params=Parameters(), wires={}))
    return made


def _nothing(self: Block) -> None:
    """Leave the outputs to their writer outside."""


def needs_python(block: Block) -> Iterator[str]:
    """Yield the reasons why a block cannot be a part of a library."""
    kind = type(block)
    steps = ("emit", "update") if kind.is_moore() else ("step",)
    for step in steps:
        calls = block.update_calls if step == "update" else block.kernel_calls
        if step in kind.overridden_steps or (not calls and not _is_empty(kind, step)):
            yield f"has {'an' if step[0] in 'eu' else 'a'} {step} in plain Python"
            continue
        for call in calls:
            if not isinstance(call, KernelCall):
                function: Any = call.run
                name = getattr(getattr(function, "func", function), "__qualname__", "a function")
                yield f"calls {name}, which is plain Python"
                continue
            for called in numba_functions(call.kernel):
                yield f"calls {name_of(called)}, a function of Numba, which needs its runtime"


def _is_empty(kind: type[Block], step: str) -> bool:
    """Check whether a step is a function that does nothing, such as the update of a source."""
    code = getattr(getattr(kind, step), "__code__", None)
    return code is not None and code.co_code == _nothing.__code__.co_code


def read_by_prepare(block: Block) -> frozenset[str]:
    """Return the parameters from which Python computes constants: those that ``prepare`` reads."""
    if type(block).prepare is Block.prepare:
        return frozenset()
    given = block.params
    names = frozenset(type(given).model_fields)
    read: set[str] = set()

    class Watched(type(given)):  # type: ignore[misc]  # its base is known at run time alone
        def __getattribute__(self, name: str) -> Any:
            if name in names:
                read.add(name)
            elif name in ("__dict__", "model_dump", "__iter__", "model_copy"):
                read.update(names)  # whatever it takes of them
            return super().__getattribute__(name)

    watched = given.model_copy()
    object.__setattr__(watched, "__class__", Watched)
    block.params = watched
    try:
        block.prepare()
    finally:
        block.params = given
    return frozenset(read)


def _parameters(block: Block) -> Iterator[NumberParameter | str]:
    """Yield the live parameters of a block, number by number; as a text those that stay as they are."""
    prepared = read_by_prepare(block)
    for name, info in type(block.params).model_fields.items():
        if not is_live(info):
            continue
        full = f"{block.context.path}.{name}"
        array = block.parameter_arrays.get(name)
        if name in prepared or array is None or array.dtype.kind not in "fib":
            yield full
            continue
        bounds = {
            key: float(value)
            for each in info.metadata
            for key in ("ge", "gt", "le", "lt")
            if (value := getattr(each, key, None)) is not None
        }
        extra = info.json_schema_extra if isinstance(info.json_schema_extra, dict) else {}
        for element in range(array.size):
            yield NumberParameter(
                f"{full}[{element}]" if array.ndim else full, block.context.path, name, element,
                str(extra.get("unit", "")) or block.params.own_unit(name), info.description or "",
                *(bounds.get(key) for key in ("ge", "gt", "le", "lt")),
            )  # fmt: skip


def terminal_groups(terminals: Sequence[Terminal]) -> dict[str, list[tuple[str, Terminal]]]:
    """Return the fields of each port, by its name: the name of the field, and the terminal."""
    groups: dict[str, list[tuple[str, Terminal]]] = {}
    for each in terminals:
        field = each.source.rpartition(".")[2]
        port = each.name.removesuffix(f".{field}") if each.name.endswith(f".{field}") else each.name
        groups.setdefault(port, []).append((field, each))
    return groups
