"""Reads the value of an input: its source, its delay, and its leave to read simulation truth."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from ..language.stages import Position
from .nodes import Entry, ListNode, MapNode, Node, ScalarNode, kind, text_of
from .problems import Code, Problems, nearest
from .written import WIRE_KEYS, unknown_key, wrong_kind

_SOURCE = re.compile(r"[A-Za-z][A-Za-z0-9_]*(?:/[A-Za-z][A-Za-z0-9_]*)*\.[A-Za-z_][A-Za-z0-9_]*$")
_EXAMPLE = "block.port, or {from: block.port, delay: 1}"


@dataclass(frozen=True)
class Link:
    """One end of a wire as it is written; ``instance`` is set for a sub-graph's own input.

    ``source`` is the absolute ``block.port``, or the input's name where ``instance`` is set.
    """

    where: Position
    source: str = ""
    instance: str | None = None
    delay: int = 0
    initial: MapNode | None = None
    truth: bool = False
    constant: MapNode | None = None


def read_link(
    node: Node, prefix: str, instance: str | None, at: str, problems: Problems
) -> Link | None:
    """The link that an input's value writes; ``None`` after a problem.

    Block paths get ``prefix`` in front; ``inputs.name`` is an input of the sub-graph ``instance``.
    """
    if isinstance(node, ScalarNode):
        return _read_source(node, prefix, instance, at, problems)
    if not isinstance(node, MapNode):
        wrong_kind(node, f"the source of {at}", _EXAMPLE, problems, at=at)
        return None
    keys = {entry.key: entry for entry in node if not entry.key.startswith("_")}
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
    if not isinstance(source, ScalarNode):
        wrong_kind(source, "'from'", "block.port", problems, at=at)
        return None
    link = _read_source(source, prefix, instance, at, problems)
    delay = _read_delay(keys.get("delay"), at, problems)
    initial = _read_initial(keys, at, problems)
    truth = _read_allow(keys.get("allow"), at, problems)
    if link is None:
        return None
    return Link(source.where, link.source, link.instance, delay, initial, truth)


def _read_source(
    node: ScalarNode, prefix: str, instance: str | None, at: str, problems: Problems
) -> Link | None:
    text = node.value
    if not isinstance(text, str) or not _SOURCE.match(text):
        problems.add(
            Code.WRONG_KIND,
            f"the source of {at} cannot be {kind(node)}",
            node.where,
            at=at,
            expected=_EXAMPLE,
            found=text_of(text),
        )
        return None
    block, _, port = text.rpartition(".")
    if block == "inputs":
        if instance is not None:
            return Link(node.where, port, instance)
        problems.add(
            Code.UNKNOWN_SOURCE,
            f"{text!r} stands for an input of a sub-graph, and this file is not one",
            node.where,
            at=at,
            expected="block.port",
            found=text,
        )
        return None
    return Link(node.where, prefix + text)


def _read_constant(
    node: MapNode, keys: Mapping[str, Entry], at: str, problems: Problems
) -> Link | None:
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
    return Link(node.where, constant=value)


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
