"""Reads how the machines that share a graph keep together: the graph's key ``links``."""

from __future__ import annotations

from collections.abc import Iterable

from ....files.nodes import Entry, MapNode
from ....files.problems import Code, Position, Problems, listing, nearest
from ...language.flat_graph import FlatGraph
from ...language.stages import LEASE, PATIENCE, CheckedGraph, LinkPolicy, LinkSettings
from ...placement.age import worst_age
from ...placement.placed import PlacementError, command_sources, silence_limit
from ..reading.graph_file import LinkKeys, Links, keys_of, read_section

LEAST_LEASE = 0.1
"""The shortest lease [s]: a transport gives several signs of life in it."""


def read_link_settings(graph: FlatGraph, clock: str, problems: Problems) -> LinkSettings:
    """Read the settings of links; what is wrong is reported to ``problems``.

    Args:
        graph: the graph.
        clock: the kind of the graph's clock.
    """
    if graph.links is None:
        return LinkSettings()
    given = read_section(graph.links, "links", Links, problems)
    common = {key: given[key] for key in keys_of(LinkKeys) if key in given}
    policy, mode = LinkPolicy(**common), given.get("mode", "lockstep")
    paths = [block.path for block in graph.blocks]
    of = {path: LinkPolicy(**{**common, **own}) for path, own in given.get("of", {}).items()}
    for entry in _entries(graph.links, "of"):
        if entry.key not in paths:
            _report_unknown_block(entry, paths, problems)
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
    for entry in _entries(graph.links, "paths"):
        if entry.key.count("->") != 1:
            problems.add(
                Code.AGE,
                f"{entry.key!r} is no path",
                entry.key_where,
                at="links.paths",
                expected="block.output -> block.input",
                found=entry.key,
            )
    lease, patience = given.get("lease", LEASE), given.get("patience", PATIENCE)
    if lease < LEAST_LEASE or patience < lease:
        key, least = ("lease", LEAST_LEASE) if lease < LEAST_LEASE else ("patience", lease)
        written = graph.links.get(key) or graph.links.get("lease")
        problems.add(
            Code.MACHINE,
            "a machine would be taken for gone between two signs of life"
            if key == "lease"
            else "a part would stop waiting for a machine before that is taken for gone",
            graph.links.where if written is None else written.value.where,
            at=f"links.{key}",
            expected=f"at least {least:g} s",
            found=f"{given.get(key, patience):g} s",
            fix=f"{key}: {least:g} s",
        )
    paths, watchdog = given.get("paths", {}), given.get("watchdog")
    return LinkSettings(mode, policy, of, paths, watchdog, lease, patience)


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
    for item in _entries(graph.links, "paths") if graph.links is not None else ():
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


def _entries(links: MapNode, key: str) -> Iterable[Entry]:
    """Return the entries of a mapping inside ``links``."""
    entry = links.get(key)
    return entry.value if entry is not None and isinstance(entry.value, MapNode) else ()


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
