"""Reads the axes of a study's grid.

::

    grid:
      force: {push.force: [40 N, 70 N], shown: [0.4 N s, 0.7 N s]}      # one parameter, its values
      direction: {push.angle: {from: 0 deg, to: 345 deg, step: 15 deg}}  # evenly spaced
      size: {plan.rise: [5 cm, 9 cm], landing.retraction: [0.2, 0.3]}    # several, side by side
      limits: {cases: {with: {}, without: {wbc.limits: none}}}           # named cases
"""

from __future__ import annotations

import math
import re

from ..files.nodes import Entry, ListNode, MapNode, Node, ScalarNode, kind, plain, text_of
from ..files.problems import Code, Problems, listing
from ..runtime.loading.reading.written import unknown_key, wrong_kind
from .quantities import column_name, in_unit, quantity, written
from .study import Axis, Case, Coordinate

RESERVED = (
    "task", "arm", "seed", "tuning_seed", "success", "reason", "error", "run_hash", "wall_time_s",
)  # fmt: skip
"""Columns of the table that are no axes."""
MOST_CASES = 10_000
_NAME = re.compile(r"[a-z][a-z0-9_]*$")
_SPACING = ("from", "to", "step")


def read_axes(node: MapNode, problems: Problems) -> tuple[Axis, ...]:
    """Read all axes in order. A wrong axis is noted as a problem and left out."""
    axes = []
    owners: dict[str, str] = {}
    for entry in node:
        if entry.key.startswith("_"):
            continue
        if entry.key in RESERVED or not _NAME.match(entry.key):
            problems.add(
                Code.BAD_VALUE,
                f"{entry.key!r} cannot name an axis",
                entry.key_where,
                expected="small letters, digits and _; not " + listing(RESERVED),
                found=entry.key,
            )
            continue
        axis = _read_axis(entry, problems)
        if axis is None:
            continue
        axes.append(axis)
        for key in dict.fromkeys(item.key for case in axis.cases for item in case.sets):
            other = owners.setdefault(key, axis.name)
            if other != axis.name:
                problems.add(
                    Code.DUPLICATE_KEY,
                    f"{key} is set by two axes, {other!r} and {axis.name!r}",
                    entry.key_where,
                    at=axis.name,
                    fix="let one axis set it, in named cases perhaps: cases: {name: {...}}",
                )
    return tuple(axes)


def _read_axis(entry: Entry, problems: Problems) -> Axis | None:
    name, node = entry.key, entry.value
    if not isinstance(node, MapNode):
        wrong_kind(node, f"axis {name!r}", f"{name}: {{block.parameter: [...]}}", problems, at=name)
        return None
    cases = node.get("cases")
    if cases is not None:
        for other in node:
            if other is not cases:
                unknown_key(other, ("cases",), f"of an axis with cases ({name!r})", problems)
        return _named(entry, cases, problems)
    return _listed(entry, node, problems)


def _named(entry: Entry, cases: Entry, problems: Problems) -> Axis | None:
    if not isinstance(cases.value, MapNode) or not cases.value.entries:
        wrong_kind(
            cases.value, "'cases'", "a mapping: {name: {block.parameter: value}}", problems,
            at=entry.key,
        )  # fmt: skip
        return None
    found = []
    for case in cases.value:
        sets = read_sets(case, problems)
        if sets is not None:
            found.append(Case(case.key, case.key, sets))
    return Axis(entry.key, entry.key, "", tuple(found), entry.key_where)


def read_sets(entry: Entry, problems: Problems) -> tuple[Entry, ...] | None:
    """Read the overrides in a mapping; there are none in an empty one."""
    if isinstance(entry.value, ScalarNode) and entry.value.value is None:
        return ()
    if not isinstance(entry.value, MapNode):
        wrong_kind(
            entry.value, repr(entry.key), "a mapping: {block.parameter: value}", problems,
            at=entry.key,
        )  # fmt: skip
        return None
    return tuple(e for e in entry.value.entries if not e.key.startswith("_"))


def _listed(entry: Entry, node: MapNode, problems: Problems) -> Axis | None:
    """Read an axis of parameters with lists of values, which go side by side."""
    name = entry.key
    shown: list[Node] = []
    lists: list[tuple[Entry, list[Node]]] = []
    sizes: list[tuple[Entry, int]] = []
    for item in node:
        values = _values(item, problems)
        if values is None:
            return None
        if item.key == "shown":
            shown = values
        else:
            lists.append((item, values))
        sizes.append((item, len(values)))
    if not lists:
        problems.add(
            Code.MISSING_KEY,
            f"axis {name!r} sets no parameter",
            entry.key_where,
            at=name,
            expected="block.parameter: [values], or cases",
            fix=f"{name}: {{block.parameter: [...]}}",
        )
        return None
    count = len(lists[0][1])
    for item, size in sizes:
        if size != count:
            problems.add(
                Code.BAD_VALUE,
                f"the values of axis {name!r} do not go side by side",
                item.key_where,
                at=f"{name}.{item.key}",
                expected=f"{count} values, as {lists[0][0].key} has",
                found=f"{size} values",
            )
            return None
    return _make(entry, lists, shown or lists[0][1], problems)


def _make(
    entry: Entry, lists: list[tuple[Entry, list[Node]]], shown: list[Node], problems: Problems
) -> Axis | None:
    name = entry.key
    first = quantity(plain(shown[0]))
    unit = first[1] if first else ""
    numbers = [in_unit(plain(node), unit) for node in shown]
    numeric = all(number is not None for number in numbers)
    cases: dict[str, Case] = {}
    for place, node in enumerate(shown):
        value = plain(node)
        coordinate: Coordinate = value if isinstance(value, bool) else text_of(value)
        label = str(coordinate).lower() if isinstance(value, bool) else text_of(value)
        if numeric:
            coordinate = number = float(f"{numbers[place] or 0.0:.15g}")
            label = str(written(number, unit))
        sets = tuple(Entry(item.key, item.key_where, values[place]) for item, values in lists)
        if label in cases:
            problems.add(
                Code.DUPLICATE_KEY, f"{label} is there twice on axis {name!r}", node.where, at=name
            )
        cases[label] = Case(label, coordinate, sets)
    column = column_name(name, unit if numeric else "")
    return Axis(name, column, unit if numeric else "", tuple(cases.values()), entry.key_where)


def _values(entry: Entry, problems: Problems) -> list[Node] | None:
    """Read a list, or evenly spaced quantities."""
    node = entry.value
    if isinstance(node, ListNode) and node.items:
        return list(node.items)
    if isinstance(node, MapNode) and set(node.keys()) & set(_SPACING):
        return _spaced(entry, node, problems)
    wrong_kind(
        node, repr(entry.key), "a list of values, or {from: 0 deg, to: 345 deg, step: 15 deg}",
        problems, at=entry.key,
    )  # fmt: skip
    return None


def _spaced(entry: Entry, node: MapNode, problems: Problems) -> list[Node] | None:
    before = len(problems)
    for item in node:
        if item.key not in _SPACING:
            unknown_key(item, _SPACING, "of evenly spaced values", problems)
    numbers: dict[str, float] = {}
    unit = ""
    for key in _SPACING:
        found = node.get(key)
        if found is None:
            problems.add(
                Code.MISSING_KEY, f"evenly spaced values need {key!r}", entry.key_where,
                at=entry.key, expected="from, to and step",
            )  # fmt: skip
            continue
        unit = unit or (quantity(plain(found.value)) or (0.0, ""))[1]
        number = in_unit(plain(found.value), unit)
        if number is None or not math.isfinite(number):
            expected = f"a number in {unit}" if unit else "a number"
            problems.add(
                Code.BAD_VALUE, f"{key!r} cannot be {kind(found.value)}", found.value.where,
                at=entry.key, expected=expected,
            )  # fmt: skip
        else:
            numbers[key] = number
    if len(problems) > before:
        return None
    start, end, step = (numbers[key] for key in _SPACING)
    count = math.floor((end - start) / step + 1e-9) + 1 if step else 0
    if not 0 < count <= MOST_CASES:
        problems.add(
            Code.BAD_VALUE, f"{step:g} does not lead from {start:g} to {end:g}", node.where,
            at=entry.key, expected="a step in that direction", found=text_of(plain(node)),
        )  # fmt: skip
        return None
    return [ScalarNode(written(start + k * step, unit), node.where) for k in range(count)]
