"""Reads how the machines that share a graph keep together: the graph's key ``links``."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from ....files.nodes import Entry, MapNode, kind, plain
from ....files.problems import Code, Position, Problems, listing, nearest
from ...language.stages import CheckedGraph, LinkPolicy, LinkSettings
from ...placement.age import worst_age
from ...placement.placed import PlacementError, command_sources, silence_limit
from ..flattening.flat import FlatGraph
from ..reading.written import read_quantity, unknown_key, wrong_kind

POLICY_KEYS = ("max_age", "late", "watch")
LINK_KEYS = ("mode", *POLICY_KEYS, "of", "paths", "watchdog")
_WORDS = {"mode": ("lockstep", "free"), "late": ("hold", "safe", "stop")}


def read_link_settings(graph: FlatGraph, clock: str, problems: Problems) -> LinkSettings:
    """The settings of links; what is wrong is reported to ``problems``.

    Args:
        graph: the graph.
        clock: the kind of the graph's clock.
    """
    if graph.links is None:
        return LinkSettings()
    found = _read(graph.links, "links", LINK_KEYS, problems)
    policy = LinkPolicy(**{key: found[key] for key in POLICY_KEYS if key in found})
    mode = found.get("mode", "lockstep")
    of: dict[str, LinkPolicy] = {}
    given = graph.links.get("of")
    if given is not None and not isinstance(given.value, MapNode):
        wrong_kind(given.value, "'of'", "a mapping from blocks to settings", problems, at="links")
    elif given is not None and isinstance(given.value, MapNode):
        paths = [block.path for block in graph.blocks]
        for entry in given.value:
            if entry.key not in paths:
                _report_unknown_block(entry, paths, problems)
            elif not isinstance(entry.value, MapNode):
                expected = "max_age and late of this block's links"
                wrong_kind(entry.value, f"links.of.{entry.key}", expected, problems)
            else:
                own = _read(entry.value, f"links.of.{entry.key}", POLICY_KEYS, problems)
                of[entry.key] = LinkPolicy(**{**vars(policy), **own})
    free = graph.links.get("mode")
    if mode == "free" and free is not None:
        if clock == "free":
            problems.add(
                Code.MACHINE,
                "parts that run free need a clock of their own, and this graph runs as fast as it can",
                free.value.where,
                at="links.mode",
                expected="clock: {kind: paced}, or a robot that drives the clock",
                found="clock: {kind: free}",
                fix="clock: {kind: paced}",
            )
        if policy.max_age is None:
            problems.add(
                Code.MISSING_KEY,
                "parts that run free must know how old a message may be",
                free.key_where,
                at="links.max_age",
                expected="the age at which 'late' takes effect",
                fix="max_age: 10 ms",
            )
    allowed = _read_paths(graph.links, problems)
    return LinkSettings(mode, policy, of, allowed, found.get("watchdog"))


def check_watchdog(checked: CheckedGraph, graph: FlatGraph, problems: Problems) -> None:
    """Report links that bring commands so rarely that their silence could not be noticed in time."""
    for machine in checked.machines:
        limit = silence_limit(checked, machine.name)
        if limit is None:
            continue
        for source in command_sources(checked, machine.name):
            spec = checked.block(source)
            period = spec.period_ticks * checked.base_period
            if 2.0 * period <= limit * (1.0 + 1e-9):
                continue
            entry = graph.links.get("watchdog") if graph.links is not None else None
            problems.add(
                Code.AGE,
                f"{source} brings commands to {machine.name} every {period * 1e3:.6g} ms, so one "
                f"message that is lost would count as silence",
                entry.value.where
                if entry is not None
                else spec.where or Position(graph.file, 1, 1),
                at="links.watchdog",
                expected=f"at least {2e3 * period:.6g} ms, or a link that is not watched",
                found=f"{limit * 1e3:.6g} ms",
                fix=f"links: {{watchdog: {2e3 * period:.6g} ms}}, or links: {{of: {{{source}: "
                "{watch: false}}}",
            )


def check_paths(checked: CheckedGraph, graph: FlatGraph, problems: Problems) -> None:
    """Report paths whose worst age, computed from the whole graph, exceeds what they allow."""
    entry = graph.links.get("paths") if graph.links is not None else None
    for item in entry.value if entry is not None and isinstance(entry.value, MapNode) else ():
        limit = checked.links.paths[item.key]
        source, _, target = (part.strip() for part in item.key.partition("->"))
        try:
            age = worst_age(checked, source, target)
        except PlacementError as error:
            problems.add(Code.AGE, str(error), item.key_where, at=item.key)
            continue
        if age is not None and age <= limit * (1.0 + 1e-9):
            continue
        problems.add(
            Code.AGE,
            f"{target} does not depend on {source}, or a free-running link between has no max_age"
            if age is None
            else f"the newest {source} at {target} can be {age * 1e3:.6g} ms old",
            item.key_where,
            at=item.key,
            expected=f"at most {limit * 1e3:.6g} ms",
            found="no bound" if age is None else f"{age * 1e3:.6g} ms",
        )


def _read_paths(links: MapNode, problems: Problems) -> dict[str, float]:
    """The allowed ages by path."""
    entry = links.get("paths")
    if entry is None:
        return {}
    if not isinstance(entry.value, MapNode):
        example = "{robot.imu -> robot.command: 4 ms}"
        wrong_kind(entry.value, "'paths'", example, problems, at="links.paths")
        return {}
    found: dict[str, float] = {}
    for item in entry.value:
        if item.key.count("->") != 1:
            problems.add(
                Code.AGE,
                f"{item.key!r} is no path",
                item.key_where,
                at="links.paths",
                expected="block.output -> block.input",
                found=item.key,
            )
            continue
        age = read_quantity(item.value, f"links.paths.{item.key}", "s", problems)
        if age is not None:
            found[item.key] = age
    return found


def _read(node: MapNode, at: str, keys: tuple[str, ...], problems: Problems) -> dict[str, Any]:
    """The values of a mapping, without ``of``."""
    found: dict[str, Any] = {}
    for entry in node:
        if entry.key not in keys:
            unknown_key(entry, keys, f"of {at!r}", problems)
        elif entry.key == "max_age":
            age = read_quantity(entry.value, f"{at}.max_age", "s", problems)
            if age is not None:
                found["max_age"] = age
        elif entry.key == "watchdog":
            limit = read_quantity(entry.value, f"{at}.watchdog", "s", problems)
            if limit is not None:
                found["watchdog"] = limit
        elif entry.key == "watch":
            if isinstance(plain(entry.value), bool):
                found["watch"] = plain(entry.value)
            else:
                wrong_kind(entry.value, f"{at}.watch", "true or false", problems)
        elif entry.key in _WORDS:
            value = plain(entry.value)
            if value in _WORDS[entry.key]:
                found[entry.key] = value
            else:
                _report_word(entry, at, _WORDS[entry.key], problems)
    return found


def _report_word(entry: Entry, at: str, words: Iterable[str], problems: Problems) -> None:
    value = plain(entry.value)
    similar = nearest(value, words) if isinstance(value, str) else ()
    problems.add(
        Code.BAD_VALUE,
        f"{at}.{entry.key} cannot be {kind(entry.value)}",
        entry.value.where,
        at=f"{at}.{entry.key}",
        expected=listing(words),
        found=kind(entry.value),
        nearest=similar,
        fix=f"{entry.key}: {similar[0]}" if similar else "",
    )


def _report_unknown_block(entry: Entry, paths: list[str], problems: Problems) -> None:
    similar = nearest(entry.key, paths)
    problems.add(
        Code.MACHINE,
        f"'links' names {entry.key!r}, which is no block of this graph",
        entry.key_where,
        at=f"links.of.{entry.key}",
        expected=listing(paths),
        found=entry.key,
        nearest=similar,
        fix=similar[0] if similar else "",
    )
