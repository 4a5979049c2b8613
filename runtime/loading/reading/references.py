"""References inside a sub-graph's file: ``$name`` to a parameter, ``inputs.name`` to an input."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from ..problems import Code, Problems, listing, nearest
from .nodes import ListNode, Node, ScalarNode, texts_of
from .written import WrittenGraph

_INPUT = re.compile(r"inputs\.([A-Za-z_][A-Za-z0-9_]*)(?:$|[.[])")


@dataclass(frozen=True)
class Bindings:
    """The values of a sub-graph's parameters; ``values`` is ``None`` outside of a sub-graph."""

    values: Mapping[str, Node] | None
    problems: Problems

    def substitute(self, node: Node) -> Node:
        """The tree with every ``$name`` replaced; ``$$text`` is the text ``$text``."""
        if isinstance(node, ScalarNode):
            text = node.value
            if not isinstance(text, str) or not text.startswith("$"):
                return node
            if text.startswith("$$"):
                return replace(node, value=text[1:])
            return self._value(text[1:], node)
        if isinstance(node, ListNode):
            return replace(node, items=tuple(self.substitute(item) for item in node.items))
        entries = tuple(replace(e, value=self.substitute(e.value)) for e in node.entries)
        return replace(node, entries=entries)

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
