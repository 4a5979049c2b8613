"""Reads the ranges of tuned parameters, and draws values from them.

::

    landing.w_k: [0, 0.5]                   # one number, uniform
    landing.w_l: [[0, 0.1], [0, 0.1]]       # a vector, each number for itself
    wbc.thrust.torso_weight: {from: 1.0e-3, to: 10, log: true}
    landing.law: {choices: [paper, deviation]}
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..runtime.loading.problems import Code, Problems
from ..runtime.loading.reading.nodes import (
    Entry,
    ListNode,
    MapNode,
    Node,
    ScalarNode,
    plain,
    text_of,
)
from ..runtime.loading.reading.written import unknown_key
from .quantities import in_unit, quantity, written
from .study import Range

EXPECTED = "[low, high], [[low, high], ...], {from:, to:, log: true} or {choices: [...]}"


def read_range(entry: Entry, problems: Problems) -> Range | None:
    """The range of one parameter; ``None`` if it is wrong, which is noted as a problem."""
    node = entry.value
    if isinstance(node, MapNode):
        choices = node.get("choices")
        legal = ("choices",) if choices else ("from", "to", "log")
        for item in node:
            if item.key not in legal:
                unknown_key(item, ("from", "to", "log", "choices"), "of a range", problems)
                return None
        if choices is not None:
            if isinstance(choices.value, ListNode) and choices.value.items:
                return Range(entry.key, entry.key_where, choices=tuple(plain(choices.value)))
            return _refuse(entry, node, problems)
        low, high = node.get("from"), node.get("to")
        log = node.get("log")
        if low is None or high is None or (log and not isinstance(plain(log.value), bool)):
            return _refuse(entry, node, problems)
        scalar = not isinstance(low.value, ListNode)
        lows = [plain(low.value)] if scalar else plain(low.value)
        highs = [plain(high.value)] if scalar else plain(high.value)
        return _bounds(entry, lows, highs, scalar, bool(log and plain(log.value)), problems)
    if not isinstance(node, ListNode) or len(node.items) < 1:
        return _refuse(entry, node, problems)
    if all(isinstance(item, ListNode) and len(item.items) == 2 for item in node.items):
        pairs = plain(node)
        return _bounds(entry, [p[0] for p in pairs], [p[1] for p in pairs], False, False, problems)
    if len(node.items) == 2 and all(isinstance(item, ScalarNode) for item in node.items):
        low_value, high_value = plain(node)
        return _bounds(entry, [low_value], [high_value], True, False, problems)
    return _refuse(entry, node, problems)


def _bounds(
    entry: Entry, lows: Any, highs: Any, scalar: bool, log: bool, problems: Problems
) -> Range | None:
    if not isinstance(highs, list) or len(lows) != len(highs) or not lows:
        return _refuse(entry, entry.value, problems)
    unit = next((found[1] for v in (*lows, *highs) if (found := quantity(v)) and found[1]), "")
    bounds = []
    for low_value, high_value in zip(lows, highs, strict=True):
        low, high = in_unit(low_value, unit), in_unit(high_value, unit)
        if low is None or high is None or not low <= high or (log and low <= 0):
            return _refuse(entry, entry.value, problems, log)
        bounds.append((low, high))
    return Range(entry.key, entry.key_where, tuple(bounds), scalar, unit, log)


def _refuse(entry: Entry, node: Node, problems: Problems, log: bool = False) -> Range | None:
    low = "numbers above zero, low before high" if log else "low before high"
    problems.add(
        Code.BAD_VALUE,
        f"{text_of(plain(node))} is no range for {entry.key}",
        node.where,
        at=entry.key,
        expected=f"{EXPECTED}, {low}",
    )
    return None


def draw(found: Range, generator: np.random.Generator) -> Any:
    """One value from the range, as a parameter takes it."""
    if found.choices:
        return found.choices[int(generator.integers(len(found.choices)))]
    return value_at(found, [float(generator.random()) for _ in found.bounds])


def value_at(found: Range, shares: Sequence[float]) -> Any:
    """The value at a share, from 0 to 1, of each of its numbers' ranges."""
    values = []
    for (low, high), share in zip(found.bounds, shares, strict=True):
        if found.log:
            number = math.exp(math.log(low) + share * (math.log(high) - math.log(low)))
        else:
            number = low + share * (high - low)
        # four digits: what was found can be read, copied and said
        values.append(written(min(max(float(f"{number:.4g}"), low), high), found.unit))
    return values[0] if found.scalar else values


def corners(found: Range) -> tuple[Any, ...]:
    """The values at the ends of the range, with which every graph is checked before tuning."""
    if found.choices:
        return found.choices
    ends = [[written(pair[end], found.unit) for pair in found.bounds] for end in (0, 1)]
    return tuple(end[0] if found.scalar else end for end in ends)
