"""The key ``links``: how machines keep together, for all links and for those of single blocks."""

from pathlib import Path

import pytest

from aloft.runtime.language.stages import LEASE, PATIENCE, LinkPolicy, LinkSettings
from aloft.runtime.loading import LoadError, checked_text

PATH = Path("graph.yaml")
GRAPH = """
rate: 100 Hz
clock: {kind: paced}
machines: {onboard: tcp/127.0.0.1:7450, ground: tcp/127.0.0.1:7451}
blocks:
  one: {use: blocks.Constant, with: {value: [1.0]}}
  two: {use: blocks.Gain, in: {u: one.y}, on: ground}
"""


def settings(text: str, overrides: tuple[str, ...] = ()) -> LinkSettings:
    return checked_text(GRAPH + text, PATH, overrides).links


def test_lockstep_is_the_default() -> None:
    assert settings("") == LinkSettings("lockstep", LinkPolicy(None, "stop"), {})


def test_policies() -> None:
    found = settings("links: {mode: free, max_age: 10 ms, late: hold, of: {one: {max_age: 0.004}}}")
    assert found.mode == "free" and found.policy == LinkPolicy(0.01, "hold")
    assert found.policy_of("one") == LinkPolicy(0.004, "hold")
    assert found.policy_of("two") == LinkPolicy(0.01, "hold")


def test_overrides_and_the_flat_text() -> None:
    overrides = ("links.mode=free", "links.max_age=20 ms", "links.late=safe")
    graph = checked_text(GRAPH, PATH, overrides)
    assert graph.links == LinkSettings("free", LinkPolicy(0.02, "safe"))
    assert checked_text(graph.text, PATH).links == graph.links


def test_what_is_watched() -> None:
    found = settings("links: {watchdog: 20 ms, of: {one: {watch: false}}}")
    assert found.watchdog == 0.02 and not found.policy_of("one").watch
    assert found.policy_of("two").watch and settings("").watchdog is None
    for text, expected in [
        ("links: {watchdog: never}", "links.watchdog cannot be the text 'never'"),
        ("links: {of: {one: {watch: 1}}}", "links.of.one.watch cannot be the number 1"),
    ]:
        with pytest.raises(LoadError) as caught:
            settings(text)
        assert expected in caught.value.report.problems[0].message


def test_lease_and_patience() -> None:
    found = settings("")
    assert (found.lease, found.patience) == (LEASE, PATIENCE) == (3.0, 30.0)
    found = settings("links: {lease: 500 ms, patience: 2 s}")
    assert (found.lease, found.patience) == (0.5, 2.0)
    for text, message, expected, found_text, fix in [
        (
            "links: {lease: 50 ms}",
            "between two signs of life",
            "at least 0.1 s",
            "0.05 s",
            "lease: 0.1 s",
        ),
        (
            "links: {patience: 1 s}",
            "stop waiting for a machine before",
            "at least 3 s",
            "1 s",
            "patience: 3 s",
        ),
        (
            "links: {lease: 60 s}",
            "stop waiting for a machine before",
            "at least 60 s",
            "30 s",
            "patience: 60 s",
        ),
    ]:
        with pytest.raises(LoadError) as caught:
            settings(text)
        (problem,) = caught.value.report.problems
        assert message in problem.message
        assert (problem.expected, problem.found, problem.fix) == (expected, found_text, fix)
