"""Reads the value of an input: its source, its delay, and its leave to read simulation truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from difflib import get_close_matches

from ....files.nodes import Entry, ListNode, MapNode, Node, ScalarNode, kind, text_of
from ....files.problems import Code, Position, Problems, nearest
from ...language.flat_graph import WireSlice
from ...language.selection import WHOLE, Selection, read_selection
from ...language.units import QUANTITY
from ..reading.graph_file import SOURCE_KEYS, WIRE_KEYS
from ..reading.written import unknown_key, wrong_kind

_EXAMPLE = "block.port, block.port.field[2], or {from: block.port, delay: 1}"
_ITEM_EXAMPLE = "block.port, block.port.field[2], or a number"


@dataclass(frozen=True)
class WrittenWire:
    """One end of a wire as it is written; ``instance`` is set for a sub-graph's own input.

    ``source`` is the absolute ``block.port``, or the input's name where ``instance`` is set. A wire
    that is put together from several sources has ``slices`` instead, and a number is a ``literal``.
    """

    where: Position
    source: str = ""
    instance: str | None = None
    delay: int = 0
    initial: MapNode | None = None
    truth: bool = False
    constant: MapNode | None = None
    selection: Selection = WHOLE
    literal: Node | None = None
    slices: tuple[WireSlice[WrittenWire], ...] = ()


def read_wire(
    node: Node, prefix: str, instance: str | None, at: str, problems: Problems
) -> WrittenWire | None:
    """Read the link in an input's value; ``None`` after a problem.

    Block paths get ``prefix`` in front; ``inputs.name`` is an input of the sub-graph ``instance``.
    """
    if not isinstance(node, MapNode):
        return _read_expression(node, prefix, instance, at, problems)
    keys = {entry.key: entry for entry in node if not entry.key.startswith("_")}
    if _is_by_field(keys):
        return _read_fields(node, keys, prefix, instance, at, problems)
    meant = [
        unknown_key(entry, WIRE_KEYS, f"of the wire to {at}", problems)
        for entry in keys.values()
        if entry.key not in WIRE_KEYS
    ]
    if "value" in keys:
        return _read_constant(node, keys, at, problems)
    if "from" not in keys and "from" in meant:
        return None
    if "from" not in keys:
        problems.add(
            Code.MISSING_KEY,
            f"the wire to {at} does not say where it comes from",
            node.where,
            at=at,
            expected="a key 'from'",
            fix="from: block.port",
        )
        return None
    source = keys["from"].value
    if isinstance(source, MapNode):
        inner = {entry.key: entry for entry in source if not entry.key.startswith("_")}
        link = _read_fields(source, inner, prefix, instance, at, problems)
    else:
        link = _read_expression(source, prefix, instance, at, problems)
    delay = _read_delay(keys.get("delay"), at, problems)
    initial = _read_initial(keys, at, problems)
    truth = _read_allow(keys.get("allow"), at, problems)
    if link is None:
        return None
    return replace(link, where=source.where, delay=delay, initial=initial, truth=truth)


def _is_by_field(keys: Mapping[str, Entry]) -> bool:
    """Return whether a mapping gives a source for every field: ``{value: e.y.value[2]}``."""
    if not keys or any(key in SOURCE_KEYS for key in keys):
        return False
    if any(isinstance(entry.value, MapNode) for entry in keys.values()):
        return False
    return not any(get_close_matches(key, SOURCE_KEYS, cutoff=0.74) for key in keys)


def _read_fields(
    node: MapNode,
    keys: Mapping[str, Entry],
    prefix: str,
    instance: str | None,
    at: str,
    problems: Problems,
) -> WrittenWire | None:
    slices = []
    for key, entry in keys.items():
        value = entry.value
        if isinstance(value, MapNode):
            wrong_kind(value, f"field {key!r} of {at}", _ITEM_EXAMPLE, problems, at=at)
            return None
        if is_name(value):  # of a value of an enumeration, if the field has any
            literal = WrittenWire(value.where, literal=value)
            slices.append(WireSlice(key, entry.key_where, (literal,)))
            continue
        wire_slice = _read_slice(key, value, prefix, instance, at, problems)
        if wire_slice is None:
            return None
        slices.append(replace(wire_slice, where=entry.key_where))
    return WrittenWire(node.where, slices=tuple(slices))


def _read_expression(
    node: ScalarNode | ListNode, prefix: str, instance: str | None, at: str, problems: Problems
) -> WrittenWire | None:
    """Read a source, a number, or a list of these."""
    if isinstance(node, ScalarNode) and not is_number(node):
        return _read_source(node, prefix, instance, at, problems)
    wire_slice = _read_slice("", node, prefix, instance, at, problems)
    return WrittenWire(node.where, slices=(wire_slice,)) if wire_slice is not None else None


def _read_slice(
    field: str,
    node: ScalarNode | ListNode,
    prefix: str,
    instance: str | None,
    at: str,
    problems: Problems,
) -> WireSlice[WrittenWire] | None:
    if _all_numbers(node):
        return WireSlice(field, node.where, (WrittenWire(node.where, literal=node),))
    if isinstance(node, ScalarNode):
        link = _read_source(node, prefix, instance, at, problems)
        return WireSlice(field, node.where, (link,)) if link is not None else None
    items = []
    for item in node.items:
        if not isinstance(item, ScalarNode):
            wrong_kind(item, f"an item of the list for {at}", _ITEM_EXAMPLE, problems, at=at)
            return None
        if is_number(item):
            items.append(WrittenWire(item.where, literal=item))
            continue
        link = _read_source(item, prefix, instance, at, problems)
        if link is None:
            return None
        items.append(link)
    return WireSlice(field, node.where, tuple(items), is_list=True)


def is_number(node: ScalarNode) -> bool:
    """Return whether a value is a number, a truth value, or a number with a unit such as ``3
    mm``."""
    if not isinstance(node.value, str):
        return node.value is not None
    return QUANTITY.match(node.value) is not None


def is_name(node: Node) -> bool:
    """Return whether a value is a word without a dot, which is no source."""
    value = node.value if isinstance(node, ScalarNode) else None
    return isinstance(value, str) and value.isidentifier() and QUANTITY.match(value) is None


def _all_numbers(node: Node) -> bool:
    if isinstance(node, ScalarNode):
        return is_number(node)
    return isinstance(node, ListNode) and bool(node.items) and all(map(_all_numbers, node.items))


def _read_source(
    node: ScalarNode, prefix: str, instance: str | None, at: str, problems: Problems
) -> WrittenWire | None:
    text = node.value
    found = read_selection(text) if isinstance(text, str) else None
    if found is None:
        problems.add(
            Code.WRONG_KIND,
            f"the source of {at} cannot be {kind(node)}",
            node.where,
            at=at,
            expected=_EXAMPLE,
            found=text_of(text),
        )
        return None
    text, selection = found
    block, _, port = text.rpartition(".")
    if block == "inputs":
        if instance is not None:
            return WrittenWire(node.where, port, instance, selection=selection)
        problems.add(
            Code.UNKNOWN_SOURCE,
            f"{text!r} stands for an input of a sub-graph, and this file is not one",
            node.where,
            at=at,
            expected="block.port",
            found=text,
        )
        return None
    return WrittenWire(node.where, prefix + text, selection=selection)


def _read_constant(
    node: MapNode, keys: Mapping[str, Entry], at: str, problems: Problems
) -> WrittenWire | None:
    value = keys["value"].value
    for other in [key for key in keys if key != "value" and key in WIRE_KEYS]:
        problems.add(
            Code.MISPLACED_KEY,
            f"the wire to {at} has a constant 'value', so {other!r} means nothing",
            keys[other].key_where,
            at=at,
            fix=f"remove {other!r} or 'value'",
        )
    if not isinstance(value, MapNode):
        wrong_kind(value, "'value'", "fields and numbers: {value: {field: 0.0}}", problems, at=at)
        return None
    return WrittenWire(node.where, constant=value)


def _read_delay(entry: Entry | None, at: str, problems: Problems) -> int:
    if entry is None:
        return 0
    node = entry.value
    value = node.value if isinstance(node, ScalarNode) else None
    if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= 100_000:
        return value
    problems.add(
        Code.DELAY,
        f"the delay of the wire to {at} is not a whole number from 1 to 100000",
        node.where,
        at=at,
        expected="periods of the source's block, at least 1",
        found=kind(node),
        fix="remove 'delay'" if value == 0 else "delay: 1",
    )
    return 0


def _read_initial(keys: Mapping[str, Entry], at: str, problems: Problems) -> MapNode | None:
    entry = keys.get("initial")
    if entry is None:
        return None
    if not isinstance(entry.value, MapNode):
        wrong_kind(entry.value, "'initial'", "fields and numbers: {field: 0.0}", problems, at=at)
        return None
    if "delay" not in keys:
        problems.add(
            Code.INITIAL,
            f"the wire to {at} has no delay, so it has no initial value",
            entry.key_where,
            at=at,
            fix="add delay: 1, or remove 'initial'",
        )
    return entry.value


def _read_allow(entry: Entry | None, at: str, problems: Problems) -> bool:
    if entry is None:
        return False
    items = entry.value.items if isinstance(entry.value, ListNode) else (entry.value,)
    for item in items:
        if isinstance(item, ScalarNode) and item.value == "truth":
            continue
        value = item.value if isinstance(item, ScalarNode) else None
        problems.add(
            Code.BAD_VALUE,
            f"the wire to {at} can allow nothing but 'truth'",
            item.where,
            at=at,
            expected="truth",
            found=kind(item),
            nearest=nearest(value, ["truth"]) if isinstance(value, str) else (),
            fix="allow: truth",
        )
    return True
