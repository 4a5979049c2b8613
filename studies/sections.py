"""Reads the sections of a study that refer to its axes: goals, tune, falsify and plots."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from ..files.nodes import Entry, ListNode, MapNode, Node, ScalarNode, kind, plain, text_of
from ..files.problems import Code, Problems, listing, nearest
from ..runtime.language.errors import AloftError
from ..runtime.loading.reading.written import unknown_key, wrong_kind
from .axes import read_sets
from .batch.seeds import parse_seeds
from .quantities import in_unit
from .study import (
    FIRST_REPORT_SEED,
    Axis,
    CellFilter,
    Falsification,
    Goal,
    MarginTerm,
    Plot,
    Range,
    Tuning,
)

GOAL_KEYS = ("rate", "where")
TUNE_KEYS = ("seeds", "draws", "seed", "ranges", "where", "set", "least", "race")
FALSIFY_KEYS = ("seeds", "draws", "seed", "ranges", "where", "set", "margin", "smallest")
PLOT_KEYS = {
    "polar": ("kind", "title", "angle", "radius", "level", "lines", "where"),
    "lines": ("kind", "title", "x", "y", "lines", "panels", "where"),
    "dots": ("kind", "title", "y", "where"),
}
_FILE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*$")


@dataclass(frozen=True)
class Labels:
    """The labels of every axis, ``task`` and ``arm`` among them; the grid's axes also by value."""

    by_axis: Mapping[str, tuple[str, ...]]
    axes: Mapping[str, Axis]

    def read_filter(self, entry: Entry | None, problems: Problems) -> CellFilter:
        """Read ``where``: for some axes one value or a list of them."""
        if entry is None:
            return CellFilter()
        if not isinstance(entry.value, MapNode):
            wrong_kind(entry.value, "'where'", "a mapping: {axis: value or [values]}", problems)
            return CellFilter()
        found: dict[str, tuple[str, ...]] = {}
        for item in entry.value:
            if item.key not in self.by_axis:
                unknown_key(item, self.by_axis, "of 'where': no axis", problems)
                continue
            many = isinstance(item.value, ListNode)
            nodes = item.value.items if isinstance(item.value, ListNode) else (item.value,)
            labels = [self._label(item.key, node, problems) for node in nodes]
            if many and not nodes:
                wrong_kind(item.value, repr(item.key), "at least one value", problems)
            found[item.key] = tuple(label for label in labels if label is not None)
        return CellFilter(found)

    def _label(self, axis: str, node: Node, problems: Problems) -> str | None:
        value = plain(node)
        text = value if isinstance(value, str) else text_of(value)
        if text in self.by_axis[axis]:
            return str(text)
        known = self.axes.get(axis)
        number = in_unit(value, known.unit) if known else None
        if known is not None and number is not None:
            for case in known.cases:
                same = isinstance(case.value, float) and math.isclose(
                    case.value, number, rel_tol=1e-9, abs_tol=1e-12
                )
                if same:
                    return case.label
        near = nearest(str(text), self.by_axis[axis])
        problems.add(
            Code.BAD_VALUE,
            f"axis {axis!r} has no {text}",
            node.where,
            at=axis,
            expected=listing(self.by_axis[axis]),
            found=str(text),
            nearest=near,
            fix=near[0] if near else "",
        )
        return None

    def read_axis(
        self, entry: Entry | None, legal: Iterable[str], problems: Problems, default: str = ""
    ) -> str:
        """Read the name of one of the ``legal`` axes."""
        if entry is None:
            return default
        name, names = plain(entry.value), tuple(legal)
        if isinstance(name, str) and name in names:
            return name
        near = nearest(str(name), names)
        problems.add(
            Code.UNKNOWN_REFERENCE,
            f"{entry.key!r} cannot be {kind(entry.value)}",
            entry.value.where,
            expected=listing(names),
            found=str(name),
            nearest=near,
            fix=f"{entry.key}: {near[0]}" if near else "",
        )
        return default


def read_goals(node: Node, labels: Labels, problems: Problems) -> tuple[Goal, ...]:
    """Read one success rate for all cells, or a list of goals. If several fit a cell, the last one
    counts."""
    if isinstance(node, ScalarNode):
        rate = _share(node, "goals", problems)
        return (Goal(rate),) if rate is not None else ()
    items = node.items if isinstance(node, ListNode) else (node,)
    goals = []
    for item in items:
        if not isinstance(item, MapNode):
            wrong_kind(item, "a goal", "{rate: 0.95, where: {axis: value}}", problems)
            continue
        for entry in item:
            if entry.key not in GOAL_KEYS:
                unknown_key(entry, GOAL_KEYS, "of a goal", problems)
        found = item.get("rate")
        if found is None:
            problems.add(
                Code.MISSING_KEY, "the goal has no rate", item.where, expected="rate",
                fix="rate: 0.95",
            )  # fmt: skip
            continue
        rate = _share(found.value, "rate", problems)
        where = labels.read_filter(item.get("where"), problems)
        if rate is not None:
            goals.append(Goal(rate, where))
    return tuple(goals)


def _share(node: Node, what: str, problems: Problems) -> float | None:
    number = in_unit(plain(node), "1")
    if number is not None and 0.0 <= number <= 1.0:
        return number
    problems.add(
        Code.BAD_VALUE, f"{what} cannot be {kind(node)}", node.where, at=what,
        expected="a share from 0 to 1, such as 0.95", found=text_of(plain(node)),
    )  # fmt: skip
    return None


def read_seeds(node: Node, what: str, problems: Problems) -> tuple[int, ...]:
    """Read ``2000:2040`` (2040 not among them), a list of numbers, or one."""
    value = plain(node)
    text = ",".join(map(str, value)) if isinstance(value, list) else str(value)
    try:
        if isinstance(value, (bool, float)) or value is None or isinstance(node, MapNode):
            raise AloftError(f"{what} cannot be {kind(node)}")
        return tuple(parse_seeds(text))
    except AloftError as error:
        problems.add(
            Code.BAD_VALUE, str(error), node.where, at=what,
            expected="2000:2040, [1, 5, 7] or 3", found=text,
        )  # fmt: skip
        return ()


def read_tuning(node: MapNode, labels: Labels, problems: Problems) -> Tuning | None:
    """Read the section ``tune``, except its ranges."""
    search = _read_search(node, "tune", TUNE_KEYS, labels, problems)
    given, least_of = node.get("seeds"), node.get("least")
    if given is None:
        problems.add(
            Code.MISSING_KEY, "'tune' does not say its seeds", node.where, expected="seeds",
            fix="seeds: 0:4",
        )  # fmt: skip
    else:
        kept = [seed for seed in search.seeds if seed >= FIRST_REPORT_SEED]
        if kept:
            problems.add(
                Code.BAD_VALUE,
                f"seeds from {FIRST_REPORT_SEED} on are for reports and cannot be tuned on",
                given.value.where,
                at="tune.seeds",
                expected=f"seeds from 0 to {FIRST_REPORT_SEED - 1}",
                found=listing(map(str, kept)),
                fix="seeds: 0:4",
            )
    race = node.get("race")
    races = plain(race.value) if race else False
    if race and not isinstance(races, bool):
        wrong_kind(race.value, "'race'", "true or false", problems)
    return Tuning(
        search.seeds, search.draws, search.seed, search.cells, search.sets,
        str(plain(least_of.value)) if least_of else "", races is True,
    )  # fmt: skip


class _Search(NamedTuple):
    """The common part of ``tune`` and ``falsify``: everything but the ranges."""

    seeds: tuple[int, ...]
    draws: int
    seed: int
    cells: CellFilter
    sets: tuple[Entry, ...]


def _read_search(
    node: MapNode, section: str, keys: tuple[str, ...], labels: Labels, problems: Problems
) -> _Search:
    for entry in node:
        if entry.key not in keys:
            unknown_key(entry, keys, f"of '{section}'", problems)
    if node.get("draws") is None:
        problems.add(
            Code.MISSING_KEY, f"'{section}' does not say its draws", node.where, expected="draws",
            fix="draws: 50",
        )  # fmt: skip
    given, sets = node.get("seeds"), node.get("set")
    seeds = read_seeds(given.value, f"{section}.seeds", problems) if given else ()
    numbers = {"draws": 1, "seed": 0}
    for key, least in numbers.items():
        entry_of = node.get(key)
        value = plain(entry_of.value) if entry_of else least
        if not isinstance(value, int) or isinstance(value, bool) or value < least:
            assert entry_of is not None
            problems.add(
                Code.BAD_VALUE, f"{key} cannot be {kind(entry_of.value)}", entry_of.value.where,
                at=f"{section}.{key}", expected=f"a whole number from {least}", found=text_of(value),
            )  # fmt: skip
        else:
            numbers[key] = value
    return _Search(
        seeds,
        numbers["draws"],
        numbers["seed"],
        labels.read_filter(node.get("where"), problems),
        (read_sets(sets, problems) or ()) if sets else (),
    )


def read_falsification(
    node: MapNode, ranges: tuple[Range, ...], labels: Labels, problems: Problems
) -> Falsification:
    """Read the section ``falsify``, whose ranges have been read."""
    search = _read_search(node, "falsify", FALSIFY_KEYS, labels, problems)
    smallest = node.get("smallest")
    legal = tuple(each.key for each in ranges if each.scalar and not each.choices)
    return Falsification(
        search.draws,
        ranges,
        _read_margin(node, problems),
        search.seeds,
        search.seed,
        search.cells,
        search.sets,
        labels.read_axis(smallest, legal, problems),
    )


def _read_margin(node: MapNode, problems: Problems) -> tuple[MarginTerm, ...]:
    """Read ``margin: {metric: [best, limit]}``."""
    entry = node.get("margin")
    example = "margin: {peak_tilt_deg: [0, 45]}"
    if entry is None:
        problems.add(
            Code.MISSING_KEY, "'falsify' does not say how near a run is to failing", node.where,
            expected="margin: for metrics of a run the best value and the limit", fix=example,
        )  # fmt: skip
        return ()
    if not isinstance(entry.value, MapNode) or not entry.value.entries:
        wrong_kind(entry.value, "'margin'", "{metric: [best value, limit]}", problems)
        return ()
    found = []
    for item in entry.value:
        ends = plain(item.value)
        numbers = ends if isinstance(ends, list) and len(ends) == 2 else (None, None)
        best, limit = (in_unit(each, "") for each in numbers)
        if best is None or limit is None or best == limit:
            problems.add(
                Code.BAD_VALUE, f"the margin of {item.key} cannot be {text_of(ends)}",
                item.value.where, at="falsify.margin", fix=example, found=text_of(ends),
                expected="two different numbers, the best value and the limit",
            )  # fmt: skip
            continue
        found.append(MarginTerm(item.key, best, limit))
    return tuple(found)


def read_plots(node: MapNode, labels: Labels, problems: Problems) -> tuple[Plot, ...]:
    """Read the pictures, by the name of their files."""
    plots = []
    for entry in node:
        if entry.key.startswith("_"):
            continue
        plot = _read_plot(entry, labels, problems)
        if plot is not None:
            plots.append(plot)
    return tuple(plots)


def _read_plot(entry: Entry, labels: Labels, problems: Problems) -> Plot | None:
    if not isinstance(entry.value, MapNode) or not _FILE_NAME.match(entry.key):
        wrong_kind(
            entry.value, f"plot {entry.key!r}", "file_name: {kind: lines, x: axis}", problems
        )
        return None
    node = entry.value
    kind_entry = node.get("kind")
    kinds = tuple(PLOT_KEYS)
    if kind_entry is None:
        problems.add(
            Code.MISSING_KEY, f"plot {entry.key!r} does not say its kind", entry.key_where,
            expected=listing(kinds), fix="kind: lines",
        )  # fmt: skip
        return None
    chosen = labels.read_axis(kind_entry, kinds, problems)
    if not chosen:
        return None
    for item in node:
        if item.key not in PLOT_KEYS[chosen]:
            unknown_key(item, PLOT_KEYS[chosen], f"of a plot of kind {chosen}", problems)
    for needed in {"polar": ("angle", "radius"), "lines": ("x",)}.get(chosen, ()):
        if node.get(needed) is None:
            problems.add(
                Code.MISSING_KEY, f"plot {entry.key!r} does not say its {needed}",
                entry.key_where, expected=f"an axis: {listing(labels.axes)}",
            )  # fmt: skip
            return None
    numeric = [
        n for n, a in labels.axes.items() if all(isinstance(c.value, float) for c in a.cases)
    ]
    level, title, y = node.get("level"), node.get("title"), node.get("y")
    share = _share(level.value, "level", problems) if level else None
    return Plot(
        entry.key,
        chosen,
        str(plain(title.value)) if title else "",
        labels.read_axis(node.get("x"), numeric, problems),
        str(plain(y.value)) if y else "rate",
        labels.read_axis(node.get("lines"), labels.by_axis, problems, "arm"),
        labels.read_axis(node.get("panels"), labels.by_axis, problems),
        labels.read_axis(node.get("angle"), numeric, problems),
        labels.read_axis(node.get("radius"), numeric, problems),
        0.95 if share is None else share,
        labels.read_filter(node.get("where"), problems),
    )
