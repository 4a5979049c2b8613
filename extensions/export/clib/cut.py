"""Cuts a sub-graph out of a graph: its text with what is outside as blocks, and its terminals."""

from __future__ import annotations

import json
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from difflib import get_close_matches
from math import prod
from typing import Any

import numpy as np

from ....runtime.language.errors import AloftError
from ....runtime.language.flat_graph import FlatBlock, FlatGraph, FlatWire
from ....runtime.language.quantities import Quantity
from ....runtime.language.signals import Field
from ....runtime.language.stages import BlockSpec, CheckedGraph
from ....runtime.language.units import parse_unit
from ....runtime.loading.checked import checked_file
from .input_delays import InputDelay, input_delays, said_of, without_delays

_USUAL = ("1", "m", "m/s", "m/s^2", "rad", "rad/s", "N", "N m", "kg", "s", "N/m", "W", "V", "A")
"""Units by the names that people know; a unit may have been multiplied up to a longer text."""


@dataclass(frozen=True)
class Terminal:
    """An input or an output of the part: one field of a signal of the graph in it.

    ``source`` is ``block.port.field`` there. ``unit`` is ``None`` where it is not checked, and where ``units`` has
    one for each element.
    ``depends`` has the names of the inputs on which an output depends within a tick.
    """

    name: str
    source: str
    shape: tuple[int, ...]
    dtype: str
    unit: str | None
    text: str
    start: Any = 0
    depends: tuple[str, ...] = ()
    frame: str | None = None
    units: tuple[str, ...] = ()

    def plain(self) -> dict[str, Any]:
        """Return the terminal as plain data."""
        return asdict(self)


@dataclass(frozen=True)
class Cut:
    """A sub-graph that can run alone: its graph, what stands for the blocks outside it, its terminals, and its
    blocks as they were.

    ``outside`` has the lines of ``blocks`` for those outside.
    """

    flat: FlatGraph
    outside: str
    inputs: tuple[Terminal, ...]
    outputs: tuple[Terminal, ...]
    graph: CheckedGraph
    inside: tuple[FlatBlock, ...]
    delays: tuple[InputDelay, ...] = ()

    @property
    def text(self) -> str:
        """The sub-graph as the text of a graph file."""
        return self.flat.text + self.outside


def cut(
    path: str,
    part: str = "",
    overrides: Sequence[str] = (),
    outputs: Sequence[str] = (),
    *,
    alone: bool = False,
    delays: str = "inside",
) -> Cut:
    """Cut a part out of a graph.

    Args:
        path: the graph file.
        part: the path of a sub-graph, or of a block; empty for the whole graph, whose inputs are
            its blocks ``blocks.External``.
        overrides: parameters to change.
        outputs: what the outputs are, ``block.port``; none: those that the sub-graph declares, or
            those of the whole graph that no block reads.
        alone: whether only blocks are taken on which an output depends, and no robot. Of a whole
            graph a robot is never taken, unless ``outputs`` has one of its own; the outputs are then by
            default what its robots read.
        delays: whether those of wires into the part are ``inside``, so that the caller gives the newest values,
            or ``outside``, so that it gives them late.

    Raises:
        LoadError: the graph may not run.
        AloftError: there is no such part, or it cannot be cut out; the message says why.
    """
    graph = checked_file(path, overrides)
    flat = graph.resolved
    assert flat is not None
    specs = {spec.path: spec for spec in graph.blocks}
    inside = [b for b in flat.blocks if not part or f"{b.path}/".startswith(f"{part}/")]
    if not inside:
        names = [*flat.subgraphs, *specs]
        near = get_close_matches(part, names, 1, 0.4)
        there = f"the nearest is {near[0]}" if near else f"there is {', '.join(names[:12])}"
        raise AloftError(f"{path} has no sub-graph {part!r}; {there}")
    external = {b.path: specs[b.path] for b in inside if b.use == "blocks.External"}
    asked = [name.rpartition(".")[0] for name in outputs]
    robots = [
        path
        for path in specs
        if specs[path].block_type.outside != "no" and (alone or not part) and path not in asked
    ]
    inside = [b for b in inside if b.path not in external and b.path not in robots]
    if not outputs and not part and robots:
        outputs = _read_by(robots, specs, [b.path for b in inside])
    chosen = _outputs(flat, part, graph, outputs, [b.path for b in inside])
    if alone:
        ends = [source.rpartition(".")[0] for source in chosen.values()]
        needed = _ancestors(ends, specs, {*robots, *external})
        inside = [b for b in inside if b.path in needed]
    late = input_delays(inside, graph, delays)
    if delays == "outside":
        inside, graph = without_delays(inside, graph, late)
        specs = {spec.path: spec for spec in graph.blocks}
    read = _read_from_outside(inside, specs)
    for block in external:
        read.setdefault(block, {})["y"] = None
    titles = _input_names(flat, part, read, external)
    stubs, inputs = _stubs(read, titles, specs, external)
    inputs = [replace(each, text=each.text + said_of(each.source, late)) for each in inputs]
    results = []
    for name, source in chosen.items():
        block, _, port = source.rpartition(".")
        depends = _depends(block, specs, [b.path for b in inside])
        before = tuple(each.name for each in inputs if _block_of(each.source) in depends)
        found = filter(_has_elements, _terminals(name, specs[block], port, None))
        results += [replace(each, depends=before) for each in found]
    _check_names([*inputs, *results])
    blocks = tuple(replace(b, machine=None) for b in inside)
    without = replace(flat, blocks=blocks, duration=None, clock=None, machines=None, links=None)
    lines = [
        f"  {path}: {{use: export.Outside, with: {{ports: {json.dumps(ports)}}}}}\n"
        for path, ports in stubs.items()
    ]
    return Cut(without, "".join(lines), tuple(inputs), tuple(results), graph, blocks, late)


Read = dict[str, dict[str, "dict[str, None] | None"]]
"""Fields that are read, by block and port outside; ``None`` for all of them."""


def _read_from_outside(inside: Sequence[FlatBlock], specs: Mapping[str, BlockSpec]) -> Read:
    own = {block.path for block in inside}
    found: Read = {}
    for block in inside:
        for name, wire in block.wires.items():
            for each in wire.inner():
                if each.source_block in own:
                    continue
                ports = found.setdefault(each.source_block, {})
                wanted = specs[block.path].block_type.inputs[name].signal.fields
                before = ports.get(each.source_port, {})
                ports[each.source_port] = (
                    None if wire.slices or before is None else {**before, **dict.fromkeys(wanted)}
                )
    return found


def _input_names(flat: FlatGraph, part: str, read: Read, external: Iterable[str]) -> dict[str, str]:
    """Return the name of each input of the FMU by its source: that of the sub-graph's input, if it has one for it, else
    that of the source.
    """
    names = {
        f"{block}.{port}": _structured(block if block in external else f"{block}.{port}")
        for block, ports in read.items()
        for port in ports
    }
    declared = flat.subgraph_inputs.get(part, {})
    for name, source in list(declared.items())[::-1]:  # of two names for one source the first
        if source in names:
            names[source] = name
    return names


def _stubs(
    read: Read,
    names: Mapping[str, str],
    specs: Mapping[str, BlockSpec],
    external: Mapping[str, BlockSpec],
) -> tuple[dict[str, Any], list[Terminal]]:
    stubs: dict[str, Any] = {}
    inputs: list[Terminal] = []
    for block, ports in read.items():
        for port, fields in ports.items():
            found = _terminals(names[f"{block}.{port}"], specs[block], port, fields)
            if block in external:
                params: Any = external[block].params
                found = [replace(each, start=params.start_value().tolist()) for each in found]
            inputs += filter(_has_elements, found)
            signal = specs[block].block_type.outputs[port].signal
            stubs.setdefault(block, {})[port] = {
                (field := each.source.rpartition(".")[2]): {
                    # a size of zero can only be said by the name of a dimension
                    "shape": list(
                        each.shape if _has_elements(each) else signal.fields[field].shape
                    ),
                    "dtype": each.dtype,
                    "unit": each.unit,
                    "frame": _quantity(specs[block], port, field).frame,
                    "start": each.start,
                    **(
                        {"quaternion": True}
                        if _quantity(specs[block], port, field).quaternion
                        else {}
                    ),
                }
                for each in found
            }
    return stubs, inputs


def _terminals(
    name: str, spec: BlockSpec, port: str, wanted: Mapping[str, None] | None
) -> list[Terminal]:
    """Return one terminal for each field of an output; ``name`` alone if the only field is ``value``."""
    fields: Mapping[str, Field] = spec.block_type.outputs[port].signal.fields
    plain = list(fields) == ["value"]
    return [
        Terminal(
            name if plain else f"{name}.{field_name}",
            f"{spec.path}.{port}.{field_name}",
            field.resolve(spec.dimensions),
            field.dtype_name,
            _unit_text(_quantity(spec, port, field_name)),
            field.text or spec.block_type.outputs[port].text,
            frame=_quantity(spec, port, field_name).frame,
            start=_start(_quantity(spec, port, field_name), field.resolve(spec.dimensions)),
            units=tuple(
                _unit_text(Quantity(unit)) or ""
                for unit in _quantity(spec, port, field_name).elements
            ),
        )
        for field_name, field in fields.items()
        if wanted is None or field_name in wanted
    ]


def _start(quantity: Quantity, shape: tuple[int, ...]) -> Any:
    """Return what is there before the first value: zero, and of quaternions no turn."""
    return np.broadcast_to((0.0, 0.0, 0.0, 1.0), shape).tolist() if quantity.quaternion else 0


def _has_elements(terminal: Terminal) -> bool:
    """Check whether a terminal has elements; a robot without feet, say, has no switches."""
    return prod(terminal.shape) > 0


def _quantity(spec: BlockSpec, port: str, name: str) -> Quantity:
    """Return the unit and frame of a field as the graph has settled them."""
    field: Field = spec.block_type.outputs[port].signal.fields[name]
    return spec.quantities.get(f"{port}.{name}") or Quantity(
        field.unit, field.frame, quaternion=field.quaternion
    )


def _unit_text(quantity: Quantity) -> str | None:
    """Return the text of a unit, if it can be read back."""
    if quantity.unit is None:
        return None
    for text in _USUAL:
        if parse_unit(text).matches(quantity.unit):
            return text
    text = str(quantity.unit)
    try:
        return text if parse_unit(text).matches(quantity.unit) else None
    except AloftError:
        return None


def _outputs(
    flat: FlatGraph, part: str, graph: CheckedGraph, asked: Sequence[str], inside: Sequence[str]
) -> dict[str, str]:
    """Return the outputs ``block.port`` by the names that they have in the FMU."""
    ports = [f"{s.path}.{port}" for s in graph.blocks for port in s.block_type.outputs]
    if asked:
        for name in asked:
            if name not in ports or name.rpartition(".")[0] not in inside:
                own = [each for each in ports if each.rpartition(".")[0] in inside]
                near = get_close_matches(name, own, 1, 0.0)
                raise AloftError(
                    f"there is no output {name!r} inside; the nearest is {near[0] if near else '-'}"
                )
        return {_structured(name.removeprefix(f"{part}/")): name for name in asked}
    if part in flat.subgraphs:
        declared = flat.subgraphs[part]
        return {name: _whole(name, wire, inside) for name, wire in declared.items()}
    if part:
        return {port: f"{part}.{port}" for port in graph.block(part).block_type.outputs}
    used = {w.source for b in flat.blocks for wire in b.wires.values() for w in wire.inner()}
    ends = [p for p in ports if p not in used and p.rpartition(".")[0] in inside]
    if not ends:
        raise AloftError("every output of the graph is read by a block; name some with --output")
    return {_structured(name): name for name in ends}


def _read_by(
    robots: Iterable[str], specs: Mapping[str, BlockSpec], inside: Sequence[str]
) -> list[str]:
    """Return the outputs inside that robots read, of blocks that act on no true state."""
    wires = [wire for path in robots for wire in specs[path].wires.values()]
    return list(
        dict.fromkeys(
            wire.source
            for wire in wires
            if wire.source_block in inside
            and not any(
                port.reads_truth for port in specs[wire.source_block].block_type.inputs.values()
            )
        )
    )


def _ancestors(
    blocks: Iterable[str], specs: Mapping[str, BlockSpec], outside: Container[str]
) -> dict[str, None]:
    """Return the blocks and all on which they depend, in this tick or through earlier ones, but not through what is
    outside.
    """
    found: dict[str, None] = {}
    pending = list(blocks)
    while pending:
        path = pending.pop()
        if path not in found and path not in outside:
            found[path] = None
            pending += [wire.source_block for wire in specs[path].wires.values()]
    return found


def _whole(name: str, wire: FlatWire, inside: Iterable[str]) -> str:
    if wire.slices or wire.constant is not None or wire.delay or wire.source_block not in inside:
        raise AloftError(
            f"the output {name!r} of the sub-graph is not one whole output of a block in it; "
            "name outputs of blocks with --output block.port"
        )
    return wire.source


def _depends(
    block: str, specs: Mapping[str, BlockSpec], inside: Iterable[str]
) -> Mapping[str, None]:
    """Return the blocks on whose outputs of the same tick those of ``block`` depend."""
    own = dict.fromkeys(inside)
    found: dict[str, None] = {}
    pending = [block]
    while pending:
        path = pending.pop()
        if path in found:
            continue
        found[path] = None
        put_between = "~" in path and path.rpartition("/")[0] in own  # by loading: a delay, a part
        if (path in own or put_between) and not specs[path].block_type.is_moore():
            pending += [wire.source_block for wire in specs[path].wires.values()]
    return found


def _block_of(source: str) -> str:
    return source.rpartition(".")[0].rpartition(".")[0]


def _structured(name: str) -> str:
    """Return a name as FMI's structured naming has it."""
    return name.replace("/", ".")


def _check_names(terminals: Iterable[Terminal]) -> None:
    seen: dict[str, str] = {}
    for each in terminals:
        if each.name in seen:
            raise AloftError(
                f"{seen[each.name]} and {each.source} would both be called {each.name!r} in the FMU"
            )
        seen[each.name] = each.source


def start_of(terminal: Terminal) -> Iterator[float]:
    """Yield the start values of an input, flat."""
    size = int(np.prod(terminal.shape))
    values = np.ravel(np.asarray(terminal.start))
    yield from (np.broadcast_to(values, (size,)) if len(values) == 1 else values).tolist()
