"""Shows a graph as a table of its blocks and wires, or as a Mermaid diagram."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import cycle
from typing import Any

from ..background.background_block import BackgroundBlock
from ..language.delay import WireDelay
from ..language.quantities import Quantity
from ..language.registry import block_name
from ..language.signal_error import SignalError, SignalErrorParameters
from ..language.stages import BlockSpec, CheckedGraph, Wire
from .checking.inserted import ConstantSignal, Gather

_COLOURS = ("#cfe2f3", "#fce5cd", "#d9ead3", "#ead1dc", "#fff2cc", "#d9d2e9")
"""The colours of the machines in a diagram."""


INSERTED = (WireDelay, ConstantSignal, Gather)
"""The blocks that loading inserts and diagrams leave out."""


@dataclass(frozen=True)
class InputRow:
    """One input: its source, and delays and changes of rate between the source and the input."""

    name: str
    source: str
    """``block.port``, or ``default`` or ``constant``."""
    signal: str
    fields: tuple[str, ...]
    """The fields that are read, with their types: ``position: float64[10] rad``."""
    delay: int = 0
    transition: str = ""
    """``holds ...`` behind a slower source, ``samples ...`` behind a faster one."""
    truth: bool = False
    sources: tuple[str, ...] = ()
    """All outputs that are read, each as ``block.port``."""
    transitions: tuple[str, ...] = ()
    """Of each of them the change of rate, empty where there is none."""

    def transition_of(self, source: str) -> str:
        """Return the change of rate between one of the sources and the input."""
        found = dict(zip(self.sources, self.transitions, strict=False))
        return found.get(source, self.transition)

    def text(self) -> str:
        """Return the input in one line."""
        notes = [self.signal]
        if self.delay:
            notes.append(f"delay {self.delay}")
        if self.transition:
            notes.append(self.transition)
        if self.truth:
            notes.append("simulation truth")
        return f"{self.name} <- {self.source} ({', '.join(notes)})"


@dataclass(frozen=True)
class BlockRow:
    """One block, at its place in the order of execution."""

    order: int
    path: str
    use: str
    rate_hz: float
    offset_ticks: int
    machine: str
    """``Moore``: outputs follow from state alone; ``Mealy``: from inputs too."""
    inputs: tuple[InputRow, ...]
    outputs: tuple[str, ...]
    """The outputs with their signals: ``imu: ImuReading``."""
    on: str = ""
    """The machine that runs the block, in a graph that names machines."""
    background: str = ""
    """After how long outputs appear, of a block that works in the background: ``60 ms``."""


def table(graph: CheckedGraph) -> tuple[BlockRow, ...]:
    """All blocks of a graph in their order of execution, also those that loading has inserted."""
    specs = {spec.path: spec for spec in graph.blocks}
    return tuple(
        _row(graph, specs, number, specs[path]) for number, path in enumerate(graph.order, 1)
    )


def table_json(graph: CheckedGraph) -> dict[str, Any]:
    """Return the table as plain data."""
    return {
        "name": graph.name,
        "base_rate_hz": graph.base_rate,
        "ticks": graph.ticks,
        "robot": graph.robot.name if graph.robot else None,
        "clock": asdict(graph.clock),
        "blocks": [asdict(row) for row in table(graph)],
    }


def _row(
    graph: CheckedGraph, specs: dict[str, BlockSpec], number: int, spec: BlockSpec
) -> BlockRow:
    block_type = spec.block_type
    return BlockRow(
        number,
        spec.path,
        _use(spec),
        graph.base_rate / spec.period_ticks,
        spec.offset_ticks,
        "Moore" if block_type.is_moore() else "Mealy",
        tuple(_input(graph, specs, spec, name) for name in block_type.inputs),
        tuple(f"{name}: {port.signal.__name__}" for name, port in block_type.outputs.items()),
        spec.machine,
        _latency(graph, spec),
    )


def _latency(graph: CheckedGraph, spec: BlockSpec) -> str:
    if not issubclass(spec.block_type, BackgroundBlock):
        return ""
    ticks = spec.block_type.delay_runs * spec.period_ticks
    return f"{ticks * graph.base_period * 1e3:.9g} ms"


def _use(spec: BlockSpec) -> str:
    block_type = spec.block_type
    if issubclass(block_type, SignalError) and isinstance(spec.params, SignalErrorParameters):
        return f"{spec.params.kind}: {block_type.target}"
    for inserted, word in ((WireDelay, "delay"), (ConstantSignal, "constant"), (Gather, "parts")):
        if issubclass(block_type, inserted):
            return word
    return block_name(block_type)


def _input(
    graph: CheckedGraph, specs: dict[str, BlockSpec], spec: BlockSpec, name: str
) -> InputRow:
    signal = spec.block_type.inputs[name].signal
    fields = tuple(_field(spec, name, item) for item in signal.fields)
    wire = spec.wires.get(name)
    if wire is None:
        return InputRow(name, "default", signal.__name__, fields)
    origin = _origin(specs, wire)
    source = specs[origin.rpartition(".")[0]]
    if issubclass(source.block_type, ConstantSignal):
        return InputRow(name, "constant", signal.__name__, fields)
    origins: tuple[str, ...] = (origin,)
    wire_text = origin
    if issubclass(source.block_type, Gather):
        origins = tuple(dict.fromkeys(_origin(specs, wire) for wire in source.wires.values()))
        wire_text = source.block_type.wire_text
    ends = [specs[each.rpartition(".")[0]] for each in origins]
    changes = tuple(_transition(graph, end, spec) for end in ends)
    ports = zip(ends, origins, strict=True)
    return InputRow(
        name,
        wire_text,
        signal.__name__,
        fields,
        wire.delay,
        ", ".join(filter(None, dict.fromkeys(changes))),
        any(end.block_type.outputs[each.rpartition(".")[2]].truth for end, each in ports),
        origins,
        changes,
    )


def _field(spec: BlockSpec, port: str, name: str) -> str:
    field = spec.block_type.inputs[port].signal.fields[name]
    shape = field.resolve(spec.dimensions)
    numbers = f"[{', '.join(map(str, shape))}]" if shape else ""
    quantity = spec.quantities.get(f"{port}.{name}", Quantity(field.unit, field.frame))
    unit = f" {quantity.unit_text}" if quantity.unit_text else ""
    if field.inferred and not unit:
        unit = " unit not checked"
    frame = f" in {quantity.frame}" if quantity.frame else ""
    return f"{name}: {field.dtype_name}{numbers}{unit}{frame}"


def _origin(specs: dict[str, BlockSpec], wire: Wire) -> str:
    """Return the output a wire comes from, seen through the delay block that loading has
    inserted."""
    source = specs[wire.source_block]
    if wire.delay and issubclass(source.block_type, WireDelay):
        return source.wires["u"].source
    return wire.source


def _transition(graph: CheckedGraph, source: BlockSpec, reader: BlockSpec) -> str:
    if source.period_ticks == reader.period_ticks:
        if source.offset_ticks == reader.offset_ticks:
            return ""
        return f"offset {source.offset_ticks} to {reader.offset_ticks}"
    word = "holds" if source.period_ticks > reader.period_ticks else "samples"
    return f"{word} {_hertz(graph, source)}"


def _hertz(graph: CheckedGraph, spec: BlockSpec) -> str:
    return f"{graph.base_rate / spec.period_ticks:g} Hz"


def mermaid(graph: CheckedGraph) -> str:
    """Draw the graph as a Mermaid flowchart.

    Blocks on one machine have one colour. Rounded blocks are Moore machines. A dotted arrow is a
    delayed wire, a thick one joins blocks of different rates; every arrow shows the input that it
    feeds, the signal, and what happens on the way.
    """
    shown = [s for s in graph.blocks if not issubclass(s.block_type, INSERTED)]
    names = {spec.path: f"b{number}" for number, spec in enumerate(shown)}
    lines = ["flowchart LR"]
    lines += _nodes(graph, shown, names, "", 1)
    for row in table(graph):
        if row.path not in names:
            continue
        for item in row.inputs:
            for origin in item.sources:
                block, _, port = origin.rpartition(".")
                if block not in names:
                    continue
                label = f"{port} to {item.name}<br/>{item.signal}"
                arrow = "-->"
                if change := item.transition_of(origin):
                    label, arrow = f"{label}<br/>{change}", "==>"
                if item.delay:
                    label, arrow = f"{label}<br/>delay {item.delay}", "-.->"
                lines.append(f'  {names[block]} {arrow}|"{label}"| {names[row.path]}')
    for machine, colour in zip(graph.machines, cycle(_COLOURS), strict=False):
        lines.append(f"  classDef on_{machine.name} fill:{colour},color:#000")
    lines += [f"  class {names[spec.path]} on_{spec.machine}" for spec in shown if spec.machine]
    return "\n".join(lines) + "\n"


def _nodes(
    graph: CheckedGraph, specs: list[BlockSpec], names: dict[str, str], prefix: str, depth: int
) -> list[str]:
    """Return the nodes below a path, with a box around every sub-graph."""
    lines: list[str] = []
    boxes: dict[str, list[BlockSpec]] = {}
    indent = "  " * depth
    for spec in specs:
        first, slash, _ = spec.path.removeprefix(prefix).partition("/")
        if slash:
            boxes.setdefault(first, []).append(spec)
            continue
        label = f"{first}<br/>{_use(spec)}<br/>{_hertz(graph, spec)}"
        latency = _latency(graph, spec)
        label += f"<br/>in the background, {latency}" if latency else ""
        label += f"<br/>on {spec.machine}" if spec.machine else ""
        left, right = ('(["', '"])') if spec.block_type.is_moore() else ('["', '"]')
        lines.append(f"{indent}{names[spec.path]}{left}{label}{right}")
    for first, inside in boxes.items():
        path = f"{prefix}{first}"
        lines.append(f'{indent}subgraph {path.replace("/", "_")}_box ["{path}"]')
        lines += _nodes(graph, inside, names, f"{path}/", depth + 1)
        lines.append(f"{indent}end")
    return lines
