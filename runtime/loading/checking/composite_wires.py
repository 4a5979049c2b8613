"""Puts together wires that select fields and elements or join several sources.

Each becomes a wire from a block that loading inserts beside the reader, called ``reader/input~parts``,
so that all later checks see wires from output to input only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ....files.nodes import Entry, MapNode, text_of
from ....files.problems import Code, Problems, listing, nearest
from ....robots.description import RobotDescription
from ...language.flat_graph import (
    FlatBlock,
    FlatGraph,
    FlatWire,
    WireElement,
    WireSlice,
    plain_slice,
)
from ...language.parameters import Parameters
from ...language.quantities import UNCHECKED, quantity_of
from ...language.selection import Selection, runs, select
from ...language.signals import Field, Signal
from ..flattening.written_wires import is_name
from .block_check import BlockDraft
from .inserted import GatherPiece, gather_block_type, read_values, selected_signal
from .wire_check import WireCheck


def resolve_composite_wires(
    graph: FlatGraph,
    drafts: Mapping[str, BlockDraft],
    robot: RobotDescription | None,
    problems: Problems,
) -> dict[str, BlockDraft]:
    """Return the drafts with an inserted block in front of every input that is put together."""
    found: dict[str, BlockDraft] = {}
    check = WireCheck(graph, drafts, problems)
    names = robot.element_names if robot is not None else {}
    for path, draft in drafts.items():
        wires = dict(draft.flat.wires)
        excused = list(draft.flat.excused)
        for name, wire in draft.flat.wires.items():
            port = draft.inputs.get(name)
            if port is not None and not wire.slices and wire.constant is None:
                wire = _one_field_for_another(draft, port.signal, wire, drafts)
            if not wire.slices or port is None:
                continue
            composer = _WireComposer(draft, name, wire, drafts, check, names, problems)
            made = composer.compose()
            if isinstance(made, BlockDraft):
                found[made.flat.path] = made
                source = f"{made.flat.path}.y"
                delay = (wire.delay, wire.initial)
                wires[name] = FlatWire(source, wire.where, *delay, shown=composer.wire_text)
            elif isinstance(made, FlatWire):
                wires[name] = made
            else:
                del wires[name]
                excused.append(name)
        if wires != dict(draft.flat.wires):
            draft.flat = replace(draft.flat, wires=wires, excused=tuple(excused))
        found[path] = draft
    return found


def _one_field_for_another(
    reader: BlockDraft, wanted: type[Signal], wire: FlatWire, drafts: Mapping[str, BlockDraft]
) -> FlatWire:
    """Return the wire as one that selects the source's only field, where only that makes it fit: the
    fields have other names, or one is a number and the other a vector of one."""
    source = drafts.get(wire.source_block)
    output = source.outputs.get(wire.source_port) if source is not None else None
    if source is None or output is None or output.absent:
        return wire
    if len(output.signal.fields) != 1 or len(wanted.fields) != 1:
        return wire
    (given,), (asked,) = output.signal.fields.values(), wanted.fields.values()
    shapes = {source.shape(given), reader.shape(asked)}
    alike = len(shapes) == 1 or shapes == {(), (1,)}
    if not alike or None in shapes or (given.name == asked.name and len(shapes) == 1):
        return wire
    if given.dtype_name != asked.dtype_name or given.quaternion != asked.quaternion:
        return wire
    if not source.quantity(output.name, given.name).agrees(quantity_of(asked) or UNCHECKED):
        return wire
    inner = FlatWire(wire.source, wire.where, truth=wire.truth)
    element = WireElement(wire.where, inner)
    return replace(wire, source="", slices=(WireSlice("", wire.where, (element,)),))


@dataclass
class _WireComposer:
    reader: BlockDraft
    name: str
    wire: FlatWire
    drafts: Mapping[str, BlockDraft]
    check: WireCheck
    names: Mapping[str, tuple[str, ...]]
    problems: Problems

    def __post_init__(self) -> None:
        self.at = f"{self.reader.flat.path}.{self.name}"
        self.signal: type[Signal] = self.reader.inputs[self.name].signal
        self.inputs: dict[str, type[Signal]] = {}
        self.wires: dict[str, FlatWire] = {}
        self.pieces: list[GatherPiece] = []
        self.fields: dict[str, tuple[tuple[int, ...], str]] = {}
        self.wire_text = wire_text(replace(self.wire, delay=0, truth=False).plain())

    def compose(self) -> BlockDraft | FlatWire | None:
        """Return the inserted block, or a constant, or ``None`` after a problem."""
        slices = self._by_field()
        if slices is None:
            return None
        items = [item for wire_slice in slices.values() for item in wire_slice.items]
        if all(item.literal is not None for item in items) and not any(
            wire_slice.is_list for wire_slice in slices.values()
        ):
            return self._constant(slices)
        before = len(self.problems)
        for name, wire_slice in slices.items():
            self._gather(name, wire_slice)
        if len(self.problems) > before or len(self.fields) < len(slices):
            return None
        return self._draft()

    def _by_field(self) -> dict[str, WireSlice[WireElement]] | None:
        """Return the parts by the reader's fields."""
        fields = self.signal.fields
        found: dict[str, WireSlice[WireElement]] = {}
        for wire_slice in self.wire.slices:
            name = wire_slice.field
            if not name:
                if len(fields) > 1:
                    example = ", ".join(f"{f}: ..." for f in list(fields)[:2])
                    self._report(
                        f"{self.at} has several fields, and one source is given for it",
                        wire_slice.where,
                        expected=f"{{{example}}}, with a source for each of {listing(fields)}",
                        found=text_of(plain_slice(wire_slice)),
                        fix=f"{self.name}: {{{next(iter(fields))}: {text_of(plain_slice(wire_slice))}, ...}}",
                    )
                    return None
                name = next(iter(fields))
            if name not in fields:
                similar = nearest(name, fields)
                self._report(
                    f"{self.signal.__name__} has no field {name!r}",
                    wire_slice.where,
                    expected=listing(fields),
                    found=name,
                    nearest=similar,
                    fix=f"{similar[0]}: {text_of(plain_slice(wire_slice))}" if similar else "",
                )
                return None
            literal = wire_slice.items[0].literal if wire_slice.items else None
            if literal is not None and is_name(literal) and fields[name].values is None:
                self._report(
                    f"{self.at}: {name} cannot be {text_of(plain_slice(wire_slice))}",
                    literal.where,
                    expected="a source, block.port.field, or a number",
                    found=text_of(plain_slice(wire_slice)),
                )
                return None
            found[name] = wire_slice
        missing = [name for name in fields if name not in found]
        if missing:
            self._report(
                f"{self.at} is given no {listing(missing)}",
                self.wire.where,
                expected=listing(fields),
                found=listing(found),
                fix=f"{missing[0]}: block.port.field",
            )
            return None
        return found

    def _constant(self, slices: Mapping[str, WireSlice[WireElement]]) -> FlatWire | None:
        """Return the wire of numbers alone."""
        if self.wire.delay:
            self._report(
                f"the wire to {self.at} delays a constant", self.wire.where, fix="remove 'delay'"
            )
            return None
        entries = tuple(
            Entry(name, wire_slice.where, wire_slice.items[0].literal)  # type: ignore[arg-type]  # a constant
            for name, wire_slice in slices.items()
        )
        return FlatWire("", self.wire.where, constant=MapNode(entries, self.wire.where))

    def _gather(self, name: str, wire_slice: WireSlice[WireElement]) -> None:
        """Add the pieces of one of the reader's fields."""
        field = self.signal.fields[name]
        shape: tuple[int, ...] = ()
        start = 0
        types: dict[str, WireElement] = {}
        for item in wire_slice.items:
            if item.literal is not None and not wire_slice.is_list:
                filled = self._constant_field(name, field, item)
                if filled is None:
                    return
                numbers, shape = filled
                self.pieces.append(GatherPiece(name, numbers=numbers))
                self.fields[name] = (shape, field.dtype_name)
                return
            if item.literal is not None:
                values = self._numbers(name, field, item)
                if values is None:
                    return
                self.pieces.append(GatherPiece(name, numbers=values, start=start))
                shape, count = (len(values),), len(values)
            else:
                taken = self._source(item)
                if taken is None:
                    return
                port, source, places = taken
                types.setdefault(source.dtype_name, item)
                copies = tuple((a, start + b, n) for a, b, n in runs(places))
                self.pieces.append(GatherPiece(name, port, source.name, copies))
                shape, count = places.shape, int(places.size)
            start += count
        if len(types) > 1:
            (first, a), (second, b) = list(types.items())[:2]
            self._report(
                f"{wire_text(a.plain())} is {first} and {wire_text(b.plain())} is {second}",
                wire_slice.where,
                expected=field.dtype_name,
                found=listing(types),
            )
            return
        wanted = self.reader.shape(field)
        if (
            wire_slice.is_list
            or (shape == () and wanted == (1,))
            or (shape == (1,) and wanted == ())
        ):
            shape = wanted if wanted == () and start == 1 else (start,)
        self.fields[name] = (shape, next(iter(types), field.dtype_name))

    def _constant_field(
        self, name: str, field: Field, item: WireElement
    ) -> tuple[tuple[float, ...], tuple[int, ...]] | None:
        """Return the numbers of a field that is a constant beside wired ones, and its shape: one number is
        that of all elements."""
        assert item.literal is not None
        shape = self.reader.shape(field)
        node = MapNode((Entry(name, item.where, item.literal),), item.where)
        before = len(self.problems)
        values = read_values(node, self.signal, self.reader, self.at, self.problems)
        if len(self.problems) > before or shape is None:
            return None
        filled = np.broadcast_to(np.asarray(values[name], np.float64), shape)
        return tuple(filled.ravel().tolist()), shape

    def _numbers(self, name: str, field: Field, item: WireElement) -> tuple[float, ...] | None:
        """Numbers between sources, as those of a constant."""
        assert item.literal is not None
        alone = type("One", (Signal,), {name: _of_one(field)})
        entry = Entry(name, item.where, item.literal)
        node = MapNode((entry,), item.where)
        before = len(self.problems)
        values = read_values(node, alone, self.reader, self.at, self.problems)
        if len(self.problems) > before:
            return None
        return tuple(np.atleast_1d(np.asarray(values[name], np.float64)).tolist())

    def _source(self, item: WireElement) -> tuple[str, Field, NDArray[np.int64]] | None:
        """Return the inserted block's input for a source, the field, and the places selected in
        it."""
        assert item.wire is not None
        wire = replace(item.wire, where=item.where, shown=wire_text(item.plain()))
        ends = self.check.source(self.at, wire, self.reader, None)
        if ends is None:
            return None
        draft, output = ends
        fields = output.signal.fields
        name = item.selection.field or (next(iter(fields)) if len(fields) == 1 else "")
        if not name and len(self.signal.fields) == 1 and next(iter(self.signal.fields)) in fields:
            name = next(iter(self.signal.fields))
        if name not in fields:
            self._unknown_field(item, name, fields, draft)
            return None
        field = fields[name]
        shape = draft.shape(field)
        if shape is None:
            return None  # a dimension is not known, which is reported
        if 0 in shape:
            self._report(
                f"{wire_text(item.plain())} has no elements with this robot",
                item.where,
                other=wire.source,
                other_where=draft.flat.where,
                expected="at least one number",
                found=f"{field.describe()} = {list(shape)}",
                fix="leave the wire out, or the block that reads it",
            )
            return None
        names = self.names.get(str(field.shape[0]), ()) if field.shape else ()
        try:
            places = select(Selection("", item.selection.indices), shape, names)
        except ValueError as error:
            self._report(
                f"{wire_text(item.plain())}: {error}",
                item.where,
                other=wire.source,
                other_where=draft.flat.where,
                expected=f"elements of {field.describe()} = {list(shape)}",
            )
            return None
        port = f"u{len(self.inputs)}"
        self.inputs[port] = selected_signal("Selected", {name: (shape, field.dtype_name)})
        self.wires[port] = wire
        return port, field, places

    def _unknown_field(
        self, item: WireElement, name: str, fields: Mapping[str, Field], draft: BlockDraft
    ) -> None:
        assert item.wire is not None
        source = item.wire.source
        similar = nearest(name, fields) or (tuple(fields)[:1] if not name else ())
        indices = "".join(f"[{index}]" for index in item.selection.indices)
        self._report(
            f"{source} has no field {name!r}"
            if name
            else f"{source} has several fields, and none is selected",
            item.where,
            other=source,
            other_where=draft.flat.where,
            expected=listing(f"{source}.{each}" for each in fields),
            found=wire_text(item.plain()),
            nearest=tuple(f"{source}.{each}" for each in similar),
            fix=f"{self.name}: {source}.{similar[0]}{indices}" if similar else "",
        )

    def _draft(self) -> BlockDraft | None:
        """Return the inserted block: in the ticks of its reader, or of its sources where it is
        delayed."""
        reader = self.reader
        clock = (reader.period_ticks, reader.offset_ticks)
        if self.wire.delay:
            clocks = [
                (source.period_ticks, source.offset_ticks)
                for source in (self.drafts[wire.source_block] for wire in self.wires.values())
            ]
            if any(a != b for a, b in pairwise(clocks)):
                self._report(
                    f"the wire to {self.at} is delayed by periods of its sources, which differ",
                    self.wire.where,
                    expected="sources of one rate and offset",
                    fix="delay each source by a block blocks.Delay",
                )
                return None
            clock = clocks[0]
        path = f"{reader.flat.path}/{self.name}~parts"
        flat = FlatBlock(
            path,
            self.wire.where,
            "",
            self.wire.where,
            reader.flat.folder,
            MapNode((), self.wire.where),
            self.wires,
        )
        wanted = {name: quantity_of(self.signal.fields[name]) for name in self.fields}
        block_type = gather_block_type(
            tuple(self.pieces),
            self.inputs,
            selected_signal(
                self.signal.__name__,
                self.fields,
                [name for name, field in self.signal.fields.items() if field.quaternion],
            ),
            {
                name: q if q is not None and q.unit is not None else None
                for name, q in wanted.items()
            },
            wire_text=self.wire_text,
            reads_truth=reader.inputs[self.name].reads_truth,
        )
        draft = BlockDraft(flat, block_type, Parameters(), {}, complete=True, stands_for=self.at)
        draft.period_ticks, draft.offset_ticks = clock
        return draft

    def _report(self, message: str, where: object, **details: object) -> None:
        self.problems.add(Code.SELECTION, message, where, **{"at": self.at, **details})  # type: ignore[arg-type]  # texts


def wire_text(plain: object) -> str:
    """Format a wire in one line; the text of one source without the quotes of YAML."""
    return plain if isinstance(plain, str) else text_of(plain)


def _of_one(field: Field) -> Field:
    """Return a field like this one for a single number."""
    unit = None if field.unit is None else field.unit.text
    return Field((), unit=unit, dtype=field.dtype_name, inferred=field.inferred)
