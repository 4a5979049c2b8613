"""Uses of sub-graphs: their parameters, and their wires, which are followed to the outputs of blocks.

In a sub-graph's file ``$name`` stands for one of its parameters and ``inputs.name`` for one of its inputs.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from ....files.nodes import (
    ListNode,
    MapNode,
    Node,
    ScalarNode,
    changed,
    kind,
    plain,
    text_of,
    texts_of,
)
from ....files.problems import Code, Position, Problems, fix_for_key, listing, nearest
from ...language.flat_graph import FlatBlock, FlatWire, WireElement, WireSlice
from ...language.selection import WHOLE, Selection
from ..reading.written import WrittenGraph
from .written_wires import WrittenWire

UNWIRED = "unwired"
"""The result for a wire that comes from an optional, unwired input of a sub-graph."""


@dataclass
class Instance:
    """One use of a sub-graph. ``broken`` is true if it could not be expanded, which is reported."""

    path: str
    where: Position
    file: str
    links: dict[str, WrittenWire | None]
    inputs: dict[str, MapNode | str | None] = field(default_factory=dict)
    """The declared inputs: ``None`` required, ``"unwired"`` optional, or constant values."""
    outputs: dict[str, WrittenWire | None] = field(default_factory=dict)
    broken: bool = True

    def declare_inputs(
        self, subgraph: WrittenGraph, places: Mapping[str, Position], problems: Problems
    ) -> None:
        """Take the inputs that the sub-graph's file declares, and check the wires against them."""
        for entry in subgraph.inputs:
            value = entry.value
            text = value.value if isinstance(value, ScalarNode) else ""
            if isinstance(value, MapNode):
                self.inputs[entry.key] = value
            elif text is None or text == "required":
                self.inputs[entry.key] = None
            elif text == "optional":
                self.inputs[entry.key] = UNWIRED
            else:
                self.inputs[entry.key] = UNWIRED
                problems.add(
                    Code.WRONG_KIND,
                    f"the default of input {entry.key!r} cannot be {kind(value)}",
                    value.where,
                    at=entry.key,
                    expected="nothing (required), optional, or constant fields {field: 0.0}",
                    found=kind(value),
                )
        misspelt: dict[str, None] = {}
        for name in self.links:
            if name not in self.inputs:
                similar = nearest(name, self.inputs)
                misspelt.update(dict.fromkeys(similar[:1]))
                problems.add(
                    Code.UNKNOWN_INPUT,
                    f"{self.path} has no input {name!r}",
                    places.get(name, self.where),
                    at=f"{self.path}.{name}",
                    expected=listing(self.inputs),
                    found=name,
                    nearest=similar,
                    fix=similar[0] if similar else f"remove {name!r}",
                )
        for entry in subgraph.inputs:
            wired = entry.key in self.links or entry.key in misspelt
            if self.inputs[entry.key] is None and not wired:
                problems.add(
                    Code.UNWIRED_INPUT,
                    f"input {entry.key!r} of {self.path} is not wired",
                    self.where,
                    at=f"{self.path}.{entry.key}",
                    other=entry.key,
                    other_where=entry.key_where,
                    fix=f"in: {{{entry.key}: block.port}}",
                )


class Resolver:
    """Follows links through the inputs and outputs of sub-graphs."""

    def __init__(self, instances: Mapping[str, Instance], problems: Problems) -> None:
        self.instances = instances
        self.problems = problems

    def resolve(self, link: WrittenWire | None, at: str) -> FlatWire | str | None:
        """Return the wire that a link stands for, ``UNWIRED``, or ``None`` after a problem."""
        if link is None:
            return None
        start = link
        seen: dict[str, None] = {}
        total = FlatWire("", start.where)
        selection = WHOLE
        while True:
            if link.constant is not None:
                if total.delay:
                    self._delayed_constant(start, at)
                if selection:
                    return self._of_constant(link.constant, selection, start, at)
                return FlatWire("", start.where, constant=link.constant)
            if link.delay and total.delay:
                self._delayed_twice(link, start, at)
                return None
            if link.delay:
                total = replace(total, delay=link.delay, initial=link.initial)
            if link.truth:
                total = replace(total, truth=True)
            if link.slices:
                return self._resolve_composite(
                    link, replace(total, where=start.where), selection, at
                )
            if link.selection:
                try:
                    selection = selection.of(link.selection)
                except ValueError as error:
                    self._selection(str(error), start, at)
                    return None
            block, _, port = link.source.rpartition(".")
            key = f"{link.instance}<{link.source}" if link.instance else link.source
            if key in seen:
                self._ring(seen, key, start, at)
                return None
            seen[key] = None
            following: WrittenWire | str | None
            if link.instance is not None:
                following = self._input(link, at)
            elif block in self.instances:
                following = self._output(self.instances[block], port, link, at)
            elif selection:
                inner = FlatWire(link.source, start.where, truth=total.truth)
                item = WireElement(start.where, inner, selection)
                return replace(total, slices=(WireSlice("", start.where, (item,)),))
            else:
                return changed(total, source=link.source)
            if following is None or isinstance(following, str):
                return following
            link = following

    def _resolve_composite(
        self, link: WrittenWire, total: FlatWire, selection: Selection, at: str
    ) -> FlatWire | None:
        """Return the wire of a link with parts, of which ``selection`` takes something."""
        slices = link.slices
        if selection.field:
            slices = tuple(
                wire_slice for wire_slice in slices if wire_slice.field == selection.field
            )
            if not slices:
                names = listing(wire_slice.field for wire_slice in link.slices if wire_slice.field)
                self._selection(
                    f"there is no field {selection.field!r}; there is {names}", link, at
                )
                return None
        if selection.indices and (len(slices) > 1 or slices[0].is_list):
            self._selection("elements cannot be selected of several sources", link, at)
            return None
        resolved = []
        for wire_slice in slices:
            items = []
            for each in wire_slice.items:
                if each.literal is not None:
                    items.append(WireElement(each.where, literal=each.literal))
                    continue
                wire = self.resolve(each, at)
                if wire is None:
                    return None
                if isinstance(wire, str):
                    self._selection("a part comes from an input that is not wired", each, at)
                    return None
                items += self._pieces(wire, selection, total)
            resolved.append(
                WireSlice(wire_slice.field, wire_slice.where, tuple(items), wire_slice.is_list)
            )
        if selection.field:
            resolved = [replace(resolved[0], field="")]
        return replace(total, slices=tuple(resolved))

    def _pieces(self, wire: FlatWire, selection: Selection, total: FlatWire) -> list[WireElement]:
        """Return the pieces that a resolved wire adds to a part."""
        rest = Selection("", selection.indices)
        if not wire.slices:
            inner = replace(wire, truth=wire.truth or total.truth)
            return [WireElement(wire.where, inner, rest)]
        return [
            replace(
                item,
                selection=rest.of(item.selection),
                wire=replace(
                    item.wire,
                    truth=item.wire.truth or wire.truth or total.truth,
                    delay=wire.delay or item.wire.delay,
                    initial=wire.initial or item.wire.initial,
                )
                if item.wire is not None
                else None,
            )
            for wire_slice in wire.slices
            for item in wire_slice.items
        ]

    def _of_constant(
        self, constant: MapNode, selection: Selection, start: WrittenWire, at: str
    ) -> FlatWire | None:
        """Return a part of constant values, which is a number again."""
        entry = constant.get(selection.field) if selection.field else None
        if selection.indices or (entry is None and len(constant.entries) != 1):
            self._selection(f"{str(selection)!r} cannot be selected of a constant", start, at)
            return None
        node = (entry or constant.entries[0]).value
        item = WireElement(start.where, literal=node)
        return FlatWire("", start.where, slices=(WireSlice("", start.where, (item,)),))

    def _selection(self, message: str, link: WrittenWire, at: str) -> None:
        self.problems.add(
            Code.SELECTION, f"the wire to {at} cannot be made: {message}", link.where, at=at
        )

    def outputs(self) -> dict[str, dict[str, FlatWire]]:
        """Return, for every sub-graph block that was expanded, the sources of its outputs."""
        found: dict[str, dict[str, FlatWire]] = {}
        for path, instance in self.instances.items():
            if instance.broken:
                continue
            wires = {n: self.resolve(link, f"{path}.{n}") for n, link in instance.outputs.items()}
            found[path] = {n: wire for n, wire in wires.items() if isinstance(wire, FlatWire)}
        return found

    def inputs(self) -> dict[str, dict[str, str]]:
        """Return, for every sub-graph block, the output ``block.port`` that each of its inputs is
        wired to; those that are put together, selected or constant are left out."""
        found: dict[str, dict[str, str]] = {}
        for path, instance in self.instances.items():
            wires = {n: self.resolve(link, f"{path}.{n}") for n, link in instance.links.items()}
            found[path] = {
                name: wire.source
                for name, wire in wires.items()
                if isinstance(wire, FlatWire) and wire.source
            }
        return found

    def _input(self, link: WrittenWire, at: str) -> WrittenWire | str | None:
        assert link.instance is not None
        instance = self.instances[link.instance]
        if link.source not in instance.inputs:
            similar = nearest(link.source, instance.inputs)
            self.problems.add(
                Code.UNKNOWN_SOURCE,
                f"this sub-graph has no input {link.source!r}",
                link.where,
                at=at,
                expected=listing(f"inputs.{name}" for name in instance.inputs),
                found=f"inputs.{link.source}",
                nearest=tuple(f"inputs.{name}" for name in similar),
                fix=f"inputs.{similar[0]}" if similar else f"inputs: {{{link.source}: }}",
            )
            return None
        if link.source in instance.links:
            return instance.links[link.source]
        default = instance.inputs[link.source]
        if isinstance(default, MapNode):
            return WrittenWire(default.where, constant=default)
        return default

    def _output(
        self, instance: Instance, port: str, link: WrittenWire, at: str
    ) -> WrittenWire | None:
        if instance.broken:
            return None
        if port not in instance.outputs:
            similar = nearest(port, instance.outputs)
            self.problems.add(
                Code.UNKNOWN_SOURCE,
                f"{instance.path} ({instance.file}) has no output {port!r}",
                link.where,
                at=at,
                other=instance.path,
                other_where=instance.where,
                expected=listing(f"{instance.path}.{name}" for name in instance.outputs),
                found=link.source,
                nearest=tuple(f"{instance.path}.{name}" for name in similar),
                fix=f"{instance.path}.{similar[0]}" if similar else "",
            )
            return None
        return instance.outputs[port]

    def _ring(self, seen: Mapping[str, None], key: str, start: WrittenWire, at: str) -> None:
        names = [name.replace("<", ".inputs.") for name in seen]
        ring = names[list(seen).index(key) :]
        self.problems.add(
            Code.LOOP,
            f"the wires to {at} run in a ring that holds no block",
            start.where,
            at=at,
            found=" -> ".join([*ring, ring[0]]),
        )

    def _delayed_twice(self, link: WrittenWire, start: WrittenWire, at: str) -> None:
        self.problems.add(
            Code.DELAY,
            f"the wire to {at} is delayed inside and outside of a sub-graph",
            start.where,
            at=at,
            other="the other delay",
            other_where=link.where,
            fix="give the delay in one of the two places",
        )

    def _delayed_constant(self, start: WrittenWire, at: str) -> None:
        self.problems.add(
            Code.DELAY,
            f"the wire to {at} delays a constant",
            start.where,
            at=at,
            fix="remove 'delay'",
        )


def parameter_values(
    block: FlatBlock, subgraph: WrittenGraph, problems: Problems
) -> dict[str, Node] | None:
    """Return the values of a sub-graph's parameters for one use; ``None`` if one is missing."""
    declared = {entry.key: entry for entry in subgraph.parameters}
    misspelt: dict[str, None] = {}
    for entry in block.parameters:
        if entry.key not in declared:
            similar = nearest(entry.key, declared)
            misspelt.update(dict.fromkeys(similar[:1]))
            problems.add(
                Code.UNKNOWN_PARAMETER,
                f"{subgraph.file} has no parameter {entry.key!r}",
                entry.key_where,
                at=f"{block.path}.{entry.key}",
                expected=listing(declared),
                found=entry.key,
                nearest=similar,
                fix=fix_for_key(entry.key, text_of(plain(entry.value)), entry.key_where, similar[0])
                if similar
                else f"remove {entry.key!r}",
            )
    values: dict[str, Node] = {}
    complete = True
    for name, entry in declared.items():
        given = block.parameters.get(name)
        default = entry.value
        if given is not None:
            values[name] = given.value
        elif isinstance(default, ScalarNode) and default.value is None:
            complete = False
            if name in misspelt:
                continue  # one mistake, one problem
            problems.add(
                Code.MISSING_PARAMETER,
                f"{block.path} does not give the parameter {name!r}",
                block.parameters.where,
                at=f"{block.path}.{name}",
                other=name,
                other_where=entry.key_where,
                fix=f"with: {{{name}: ...}}",
            )
        else:
            values[name] = default
    return values if complete else None


_INPUT = re.compile(r"inputs\.([A-Za-z_][A-Za-z0-9_]*)(?:$|[.[])")


@dataclass(frozen=True)
class Bindings:
    """The values of a sub-graph's parameters; ``values`` is ``None`` outside of a sub-graph."""

    values: Mapping[str, Node] | None
    problems: Problems

    def substitute(self, node: Node) -> Node:
        """Return the tree with every ``$name`` replaced; ``$$text`` is the text ``$text``."""
        if isinstance(node, ScalarNode):
            text = node.value
            if not isinstance(text, str) or not text.startswith("$"):
                return node
            if text.startswith("$$"):
                return replace(node, value=text[1:])
            return self._value(text[1:], node)
        if isinstance(node, ListNode):
            items = tuple(self.substitute(item) for item in node.items)
            same = all(new is old for new, old in zip(items, node.items, strict=True))
            return node if same else replace(node, items=items)
        values = [self.substitute(entry.value) for entry in node.entries]
        if all(new is e.value for new, e in zip(values, node.entries, strict=True)):
            return node
        entries = (replace(e, value=new) for new, e in zip(values, node.entries, strict=True))
        return replace(node, entries=tuple(entries))

    def _value(self, name: str, node: ScalarNode) -> Node:
        if self.values is None:
            self.problems.add(
                Code.UNKNOWN_REFERENCE,
                f"${name} stands for a parameter of a sub-graph, and this file is not one",
                node.where,
                found=f"${name}",
                fix=f"write the value, or $${name} for the text",
            )
            return node
        if name in self.values:
            return self.values[name]
        similar = nearest(name, self.values)
        self.problems.add(
            Code.UNKNOWN_REFERENCE,
            f"${name} is no parameter of this sub-graph",
            node.where,
            expected=listing(self.values),
            found=f"${name}",
            nearest=tuple(f"${match}" for match in similar),
            fix=f"${similar[0]}" if similar else f"parameters: {{{name}: ...}}",
        )
        return node


def report_unused(
    subgraph: WrittenGraph, files: Iterable[WrittenGraph], problems: Problems
) -> None:
    """Report parameters and inputs of a sub-graph that nothing in its ``files`` refers to."""
    texts: dict[str, None] = {}
    for file in files:
        for entry in file.tree:
            if entry.key not in ("parameters", "inputs"):
                texts.update(dict.fromkeys(texts_of(entry.value)))
    referred = {match[1] for match in map(_INPUT.match, texts) if match}
    for entry in subgraph.parameters:
        if f"${entry.key}" not in texts:
            problems.add(
                Code.UNUSED_PARAMETER,
                f"nothing in this sub-graph uses its parameter {entry.key!r}",
                entry.key_where,
                at=entry.key,
                fix=f"use it as ${entry.key}, or remove it",
            )
    for entry in subgraph.inputs:
        if entry.key not in referred:
            problems.add(
                Code.UNUSED_INPUT,
                f"nothing in this sub-graph reads its input {entry.key!r}",
                entry.key_where,
                at=entry.key,
                fix=f"use it as inputs.{entry.key}, or remove it",
            )
