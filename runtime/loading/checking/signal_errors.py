"""Puts the faults of a graph on their wires.

Each becomes a block ``faults/NAME`` between the block that writes and those that read, so that everything behind it, from the
checks of wires to the recording, sees a block like any other.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....files.nodes import Entry, ListNode, MapNode, Node, ScalarNode, kind, plain, text_of
from ....files.problems import Code, Position, Problems, listing, nearest
from ...language.errors import UnitError
from ...language.flat_graph import FlatBlock, FlatGraph, FlatWire, WireElement, WireSlice
from ...language.selection import Selection, read_selection, select
from ...language.signal_error import (
    CONDITION,
    FOLDER,
    HOLDING,
    OPTIONS,
    SIGNS,
    EventCondition,
    SignalError,
    SignalErrorParameters,
    chirp_lines,
    signal_error_type,
)
from ...language.signals import Field, Signal
from ...language.units import parse_quantity
from .block_check import BlockDraft
from .inserted import selected_signal
from .parameters import check_parameters
from .settings import Settings

COMMON = ("on", "kind", "when", "start", "start_spread", "duration", "seed")
"""The keys of every fault."""


def insert_signal_errors(
    graph: FlatGraph, drafts: dict[str, BlockDraft], settings: Settings, problems: Problems
) -> dict[str, BlockDraft]:
    """Return the drafts with a block for every fault, and the wires of its readers moved to it."""
    latest: dict[str, str] = {}
    for entry in graph.faults or ():
        if isinstance(entry.value, MapNode):
            made = _SignalErrorReader(
                graph, drafts, settings, problems, entry, entry.value, latest
            ).read()
            if made is not None:
                drafts = {**drafts, made.flat.path: made}
        else:
            problems.add(
                Code.WRONG_KIND,
                f"the fault {entry.key!r} cannot be {kind(entry.value)}",
                entry.value.where,
                at=f"faults.{entry.key}",
                expected="keys such as on, kind and start",
                fix=f"{entry.key}: {{on: robot.imu.angular_velocity[1], kind: stuck}}",
            )
    return drafts


class _SignalErrorReader:
    def __init__(
        self, graph: FlatGraph, drafts: Mapping[str, BlockDraft], settings: Settings,
        problems: Problems, entry: Entry, node: MapNode, latest: dict[str, str],
    ) -> None:  # fmt: skip
        self.graph, self.drafts, self.settings, self.problems = graph, drafts, settings, problems
        self.name, self.where, self.node = entry.key, entry.key_where, node
        self.at = f"faults.{entry.key}"
        self.latest = latest
        self.path = f"{FOLDER}{entry.key}"

    def read(self) -> BlockDraft | None:
        """Read the fault's block; ``None`` after a problem."""
        before = len(self.problems)
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.name) or self.path in self.drafts:
            self._report(f"{self.name!r} cannot name a fault", self.where, found=self.name,
                         expected="a letter, then letters, digits and '_', as no block is called")  # fmt: skip
        kind_of = self._kind()
        texts = self._targets()
        if kind_of is None or not texts:
            return None
        found = [self._place(text, where) for text, where in texts]
        places = [each for each in found if each is not None]
        if len(places) < len(texts):
            return None
        port, source = places[0][0], places[0][1]
        if any(each[0] != port for each in places):
            self._report(f"{self.at} is on several signals", texts[0][1],
                         expected="parts of one signal; for each further one a fault of its own",
                         found=listing(text for text, _ in texts))  # fmt: skip
            return None
        draft, output = source
        elements = self._elements(draft, output, places, kind_of, texts)
        if elements is None:
            return None
        params = self._parameters(kind_of, [output.fields[name] for name in elements])
        if params is None or len(self.problems) > before:
            return None
        return self._draft(port, source, elements, params, listing(text for text, _ in texts))

    def _kind(self) -> str | None:
        """Read the kind, and check that its keys go with it."""
        entry = self.node.get("kind")
        value = plain(entry.value) if entry is not None else None
        if value not in OPTIONS:
            near = nearest(str(value), OPTIONS) if value is not None else ()
            self._report(
                f"{value!r} is no kind of fault" if entry is not None else "the fault has no kind",
                self.node.where if entry is None else entry.value.where,
                expected=listing(OPTIONS), found="nothing" if entry is None else text_of(value),
                nearest=near, fix=f"kind: {(*near, 'stuck')[0]}",
                code=Code.MISSING_KEY if entry is None else Code.BAD_VALUE,
            )  # fmt: skip
            return None
        options = OPTIONS[value]
        for each in self.node:
            if each.key not in COMMON and each.key not in options and not each.key.startswith("_"):
                legal = (*COMMON, *options)
                self._report(f"{each.key!r} is not a key of a fault that is {value}", each.key_where,
                             expected=listing(legal), found=each.key, code=Code.UNKNOWN_KEY,
                             nearest=nearest(each.key, legal), fix=f"remove {each.key!r}")  # fmt: skip
        for key, needed in options.items():
            if needed and self.node.get(key) is None:
                self._report(f"a fault that is {value} needs {key!r}", self.node.where, expected=key,
                             code=Code.MISSING_KEY, found="nothing", fix=f"{key}: ...")  # fmt: skip
        return str(value)

    def _targets(self) -> list[tuple[str, Position]]:
        """Return the texts of ``on`` with their places."""
        entry = self.node.get("on")
        if entry is None:
            self._report("the fault does not say where it is", self.node.where, found="nothing",
                         expected="a key 'on' with an output or an input of a block", code=Code.MISSING_KEY,
                         fix="on: robot.imu.angular_velocity[1]")  # fmt: skip
            return []
        items: tuple[Node, ...] = entry.value.items if isinstance(entry.value, ListNode) else (entry.value,)  # fmt: skip
        texts = [(str(item.value), item.where) for item in items if isinstance(item, ScalarNode)]
        return texts if len(texts) == len(items) else []

    def _place(
        self, text: str, where: Position
    ) -> tuple[str, tuple[BlockDraft, type[Signal]], Selection] | None:
        """Find the ``block.port`` of a target, its writer with its signal, and the selection."""
        read = read_selection(text)
        if read is None:
            self._report(f"{text!r} is neither an output nor an input", where, found=text,
                         expected="block.port, block.port.field or block.port.field[2]")  # fmt: skip
            return None
        port, selection = read
        path, _, name = port.rpartition(".")
        draft = self.drafts.get(path)
        if draft is None or (name not in draft.outputs and name not in draft.inputs):
            if draft is not None and draft.block_type is None:
                return None  # reported at that block
            known = [f"{path}.{n}" for n in (*draft.outputs, *draft.inputs)] if draft else [
                p for p, d in self.drafts.items() if not d.stands_for]  # fmt: skip
            near = nearest(port if draft else path, known)
            self._report(f"{self.at} is on {port}, which is neither an output nor an input", where,
                         expected=listing(known), found=text, nearest=near, code=Code.UNKNOWN_SOURCE,
                         fix=f"on: {near[0]}" if near else "")  # fmt: skip
            return None
        if name in draft.outputs:
            if draft.outputs[name].truth:
                self._report(f"{self.at} is on {port}, which only a simulator knows", where,
                             expected="a signal that a robot has", found="simulation truth",
                             code=Code.TRUTH)  # fmt: skip
                return None
            return port, (draft, draft.outputs[name].signal), selection
        wire = draft.flat.wires.get(name)
        if wire is None or wire.constant is not None or wire.slices:
            what = "not wired" if wire is None else "a constant" if wire.constant is not None else "composed of parts"  # fmt: skip
            self._report(f"{self.at} is on the input {port}, which is {what}", where, found=what,
                         expected="an input that is wired to one output, or an output")  # fmt: skip
            return None
        source = self.drafts.get(wire.source_block)
        if source is None or wire.source_port not in source.outputs:
            return None  # reported at the wire
        return port, (source, source.outputs[wire.source_port].signal), selection

    def _elements(
        self, draft: BlockDraft, signal: type[Signal],
        places: list[tuple[str, tuple[BlockDraft, type[Signal]], Selection]],
        kind_of: str, texts: list[tuple[str, Position]],
    ) -> dict[str, NDArray[np.int64]] | None:  # fmt: skip
        """Find the places that change, by field."""
        found: dict[str, NDArray[np.int64]] = {}
        names = _element_names(self.settings)
        for (_, _, selection), (text, where) in zip(places, texts, strict=True):
            fields = [selection.field] if selection.field else list(signal.fields)
            numbers = kind_of not in HOLDING or self.node.get("value") is not None
            if numbers and len(fields) > 1:
                self._report(f"{self.at} is {kind_of}, and {text} has several fields", where,
                             expected=listing(f"{text}.{f}" for f in signal.fields), found=text,
                             fix=f"on: {text}.{fields[0]}")  # fmt: skip
                return None
            for name in fields:
                if name not in signal.fields:
                    near = nearest(name, signal.fields)
                    self._report(f"{signal.__name__} has no field {name!r}", where, found=name,
                                 expected=listing(signal.fields), nearest=near,
                                 fix=text.replace(f".{name}", f".{near[0]}") if near else "")  # fmt: skip
                    return None
                field = signal.fields[name]
                if (
                    kind_of not in HOLDING
                    and kind_of != "flipped"
                    and field.dtype_name != "float64"
                ):
                    self._report(f"{text} is {field.dtype_name}, which cannot be {kind_of}", where,
                                 expected="a kind of " + listing((*HOLDING, "flipped")), found=kind_of,
                                 code=Code.DTYPE, fix="kind: stuck")  # fmt: skip
                    return None
                shape = draft.shape(field)
                if shape is None:
                    return None  # a dimension that is not known, which is reported
                rows = names.get(str(field.shape[0]), ()) if field.shape else ()
                try:
                    chosen = select(Selection("", selection.indices), shape, rows).reshape(-1)
                except ValueError as error:
                    self._report(f"{text}: {error}", where, found=text,
                                 expected=f"elements of {field.describe()} = {list(shape)}")  # fmt: skip
                    return None
                found[name] = np.unique(np.concatenate([found.get(name, chosen[:0]), chosen]))
        return found

    def _parameters(self, kind_of: str, fields: list[Field]) -> SignalErrorParameters | None:
        """Read the parameters, in which a value with a unit is a number in that of the field."""
        entries = []
        for entry in self.node:
            if entry.key in ("on", "when") or entry.key.startswith("_"):
                continue
            node = entry.value
            if entry.key == "value" and isinstance(node, ScalarNode):
                unit = fields[0].unit.text if fields[0].unit is not None else ""
                boolean = fields[0].dtype_name == "bool"
                try:
                    value = parse_quantity(node.value, unit) if isinstance(node.value, str) else node.value  # fmt: skip
                except UnitError as error:
                    self._report(f"{self.at}.value: {error}", node.where, found=text_of(node.value),
                                 expected=f"a number in {unit or '1'}", code=Code.UNIT)  # fmt: skip
                    return None
                if isinstance(value, bool) and boolean:
                    value = float(value)
                whole = fields[0].dtype_name != "float64"
                if whole and isinstance(value, float) and value != (int(value) if not boolean else value in (0.0, 1.0) and value):  # fmt: skip
                    self._report(f"{self.at}.value cannot be {value:g}", node.where, found=f"{value:g}",
                                 expected="true or false" if boolean else "a whole number")  # fmt: skip
                    return None
                node = ScalarNode(value, node.where)
            entries.append(replace(entry, value=node))
        flat = FlatBlock(self.at, self.where, "", self.where, self.graph.folder,
                         MapNode(tuple(entries), self.node.where))  # fmt: skip
        params = check_parameters(flat, SignalError, self.problems, self.settings.robot)
        if not isinstance(params, SignalErrorParameters):
            return None
        widest = (
            8 * np.dtype(fields[0].dtype_name).itemsize if fields[0].dtype_name != "bool" else 1
        )
        if kind_of == "chirp" and not len(chirp_lines(params.low, params.high, params.time)):
            self._report(f"{self.at} has no frequency: none from low to high is a multiple of 1 / time",
                         self.node.where, found=f"{params.low:g} to {params.high:g} Hz",
                         expected=f"a range with a multiple of {1.0 / params.time:g} Hz")  # fmt: skip
            return None
        if kind_of == "flipped" and params.bit >= widest:
            self._report(f"{self.at}.bit cannot be {params.bit}", self.node.where,
                         expected=f"0 to {widest - 1}, for {fields[0].dtype_name}", found=str(params.bit))  # fmt: skip
            return None
        return params

    def _draft(
        self, port: str, source: tuple[BlockDraft, type[Signal]],
        elements: dict[str, NDArray[np.int64]], params: SignalErrorParameters, target: str,
    ) -> BlockDraft | None:  # fmt: skip
        draft, signal = source
        path, _, name = port.rpartition(".")
        owner = self.drafts[path]
        is_output = name in owner.outputs
        wire = None if is_output else owner.flat.wires[name]
        written = self.latest.get(port, port) if wire is None else wire.source
        event = self._event()
        if event is False:
            return None
        compared, event_signal, event_wire, truth = event if event else (None, None, None, False)
        delay = 1
        if params.kind == "delayed" and self.settings.base_rate is not None:
            period = draft.period_ticks / self.settings.base_rate
            delay = round(params.delay / period)
            if delay < 1:
                self._report(f"{self.at}.delay is below half a period of {port}", self.node.where,
                             expected=f"{1e3 * period:g} ms or more", found=f"{1e3 * params.delay:g} ms")  # fmt: skip
                return None
        if params.kind == "chirp" and self.settings.base_rate is not None:
            highest = 0.5 * self.settings.base_rate / draft.period_ticks
            if params.high >= highest:
                self._report(f"{self.at}.high cannot be {params.high:g} Hz", self.node.where,
                             expected=f"below {highest:g} Hz, half the rate at which {port} is written",
                             found=f"{params.high:g} Hz")  # fmt: skip
                return None
        block_type = signal_error_type(
            signal, target, elements, params, delay, compared, event_signal, reads_truth=truth
        )
        wires = {"u": FlatWire(written, self.where)}
        if event_wire is not None:
            wires["trigger"] = event_wire
        flat = FlatBlock(self.path, self.where, "", self.where, self.graph.folder, MapNode((), self.where),
                         wires, machine=draft.flat.machine)  # fmt: skip
        made = BlockDraft(flat, block_type, params, draft.dimensions, complete=True)
        made.period_ticks, made.offset_ticks = draft.period_ticks, draft.offset_ticks
        changed = f"{self.path}.y"
        for other in self.drafts.values():
            if wire is not None:
                if other is owner:
                    moved = replace(wire, source=changed, shown=wire.shown or wire.source)
                    other.flat = replace(other.flat, wires={**other.flat.wires, name: moved})
            else:
                other.flat = replace(other.flat, wires={
                    n: w if n == "trigger" and other.flat.path.startswith(FOLDER) else _moved(w, written, changed)
                    for n, w in other.flat.wires.items()
                })  # fmt: skip
        if wire is None:
            self.latest[port] = changed
        return made

    def _event(self) -> Any:
        """Read the comparison of ``when``, its signal and wire, and whether it is truth; ``None``
        without one, and false after a problem."""
        entry = self.node.get("when")
        if entry is None:
            return None
        text = str(plain(entry.value))
        match = CONDITION.match(text)
        read = read_selection(match["name"]) if match else None
        if match is None or read is None:
            self._report(f"{text!r} is no condition", entry.value.where, found=text,
                         expected="block.port.field == value, with " + listing(SIGNS))  # fmt: skip
            return False
        port, selection = read
        path, _, name = port.rpartition(".")
        draft = self.drafts.get(path)
        output = draft.outputs.get(name) if draft is not None else None
        fields = output.signal.fields if output is not None else {}
        field_name = selection.field or (next(iter(fields)) if len(fields) == 1 else name)
        if draft is None or output is None or field_name not in fields:
            known = [f"{port}.{f}" for f in fields] or [f"{p}.{o}" for p, d in self.drafts.items() for o in d.outputs]  # fmt: skip
            near = nearest(match["name"], known)
            self._report(f"{self.at} waits for {match['name']}, which is no field of an output",
                         entry.value.where, expected=listing(known), found=match["name"], nearest=near,
                         code=Code.UNKNOWN_SOURCE, fix=f"when: {near[0]} {match['sign']} ..." if near else "")  # fmt: skip
            return False
        field = fields[field_name]
        shape = draft.shape(field)
        if shape is None:
            return False
        number = _number(match["value"], field)
        try:
            rows = _element_names(self.settings).get(str(field.shape[0]), ()) if field.shape else ()
            one = select(Selection("", selection.indices), shape, rows).size == 1
        except ValueError as error:
            self._report(f"{match['name']}: {error}", entry.value.where, found=match["name"],
                         expected=f"an element of {field.describe()} = {list(shape)}")  # fmt: skip
            return False
        if number is None or not one:
            values = listing(each.name for each in field.values) if field.values else "a number"
            self._report(f"{text!r} compares no number", entry.value.where, found=text,
                         expected=f"one element and {values}")  # fmt: skip
            return False
        where = entry.value.where
        element = WireElement(where, FlatWire(port, where, truth=output.truth), Selection(field_name, selection.indices))  # fmt: skip
        wire = FlatWire(
            "", where, delay=1, slices=(WireSlice("", where, (element,)),), truth=output.truth
        )
        signal = selected_signal("Event", {field_name: ((), field.dtype_name)})
        return EventCondition(SIGNS.index(match["sign"]), number), signal, wire, output.truth

    def _report(self, message: str, where: Position, code: Code = Code.BAD_VALUE, **details: Any) -> None:  # fmt: skip
        self.problems.add(code, message, where, at=self.at, **details)


def _moved(wire: FlatWire, source: str, target: str) -> FlatWire:
    """Return the wire, or its parts, from another output where it came from ``source``."""
    if wire.slices:
        slices = tuple(
            replace(wire_slice, items=tuple(
                item if item.wire is None else replace(item, wire=_moved(item.wire, source, target))
                for item in wire_slice.items
            ))
            for wire_slice in wire.slices
        )  # fmt: skip
        return replace(wire, slices=slices)
    if wire.constant is not None or wire.source != source:
        return wire
    return replace(wire, source=target, shown=wire.shown or source)


def _element_names(settings: Settings) -> Mapping[str, tuple[str, ...]]:
    """Return the names of elements by their dimension."""
    return {} if settings.robot is None else settings.robot.element_names


def _number(text: str, field: Field) -> float | None:
    """Read a number, a truth value, a name of the field's values, or a quantity in its unit."""
    words = {"true": 1.0, "false": 0.0}
    if field.values is not None:
        words |= {each.name.lower(): float(each.value) for each in field.values}
    if text.lower() in words:
        return words[text.lower()]
    try:
        return float(text)
    except ValueError:
        pass
    try:
        return parse_quantity(text, field.unit.text if field.unit is not None else "")
    except UnitError:
        return None
