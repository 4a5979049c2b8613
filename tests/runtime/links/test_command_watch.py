"""Links that bring commands to actuators are watched: silence on one of them ends in damping."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import pytest

from aloft.files.problems import Code
from aloft.runtime.language.stages import WATCHDOG, CheckedGraph, LinkPolicy, LinkSettings
from aloft.runtime.links.command_watch import CommandWatch
from aloft.runtime.links.part import BoundPart
from aloft.runtime.loading import LoadError, checked_file
from aloft.runtime.placement.placed import (
    MachineLink,
    command_sources,
    silence_limit,
    split_over_machines,
)
from aloft.runtime.testing.spread import run_spread
from aloft.runtime.transports.hub import Hub

from .example_graphs import Counter, ring
from .test_free_running import Quiet, free

MS = 1_000_000


def watched(
    watchdog: float | None = 0.1,
    mode: str = "free",
    of: dict[str, LinkPolicy] | None = None,
) -> CheckedGraph:
    """The ring, with a long ``max_age`` and policy hold: only the watchdog can end it."""
    graph = free(LinkPolicy(30.0, "hold"), ticks=1500)
    return replace(
        graph, links=LinkSettings(mode, LinkPolicy(30.0, "hold"), of or {}, {}, watchdog)
    )  # type: ignore[arg-type]


@dataclass
class Box:
    link: MachineLink
    received_at: int = 0


class Time:
    now = 1000 * MS

    def __call__(self) -> int:
        return self.now


def test_the_links_that_bring_commands_are_found_through_blocks_of_the_machine() -> None:
    graph = ring()
    assert command_sources(graph, "onboard") == ("last",)
    assert command_sources(graph, "near") == ()  # nothing moves there
    # a block between the link and the robot changes nothing
    moved = tuple(
        replace(spec, machine="onboard") if spec.path == "last" else spec for spec in graph.blocks
    )
    assert command_sources(replace(graph, blocks=moved), "onboard") == ("first",)
    links = LinkSettings(of={"last": LinkPolicy(watch=False)})
    assert command_sources(replace(graph, links=links), "onboard") == ()


def test_simulated_actuators_are_watched_where_the_graph_says_so_and_real_ones_always(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph = ring()
    assert silence_limit(graph, "onboard") is None and silence_limit(graph, "near") is None
    assert silence_limit(watched(0.1), "onboard") == 0.1
    monkeypatch.setattr(Counter, "outside", "real")
    assert silence_limit(graph, "onboard") == WATCHDOG == 0.015
    assert silence_limit(watched(0.1), "onboard") == 0.1
    assert silence_limit(graph, "near") is None


def test_silence_counts_from_the_first_look_and_for_the_most_silent_link() -> None:
    placed = split_over_machines(watched(0.02))
    time = Time()
    (link,) = placed.received_by("onboard")
    box = Box(link)
    watch = CommandWatch(placed, "onboard", [box], time)
    assert watch.links == ("last@far -> onboard",)
    time.now += 5000 * MS  # a long start is no silence
    assert not watch.complaint()
    time.now += 20 * MS
    assert not watch.complaint()
    time.now += 1
    assert watch.complaint() == (
        "link last@far -> onboard brings commands and was silent for 20.0 ms, at most 20 ms are "
        "allowed (links.watchdog)"
    )
    box.received_at = time.now
    assert watch.heard() == time.now and not watch.complaint()


def test_a_part_without_watched_links_is_never_silent() -> None:
    placed = split_over_machines(watched(0.02))
    part = BoundPart(placed, "near", Hub().transport())
    assert part.watch.links == () and part.watch.heard() == 0 and not part.watch.complaint()
    assert part.clock.commands_heard() == 0 and part.clock.command_limit == 0.0
    part = BoundPart(placed, "onboard", Hub().transport())
    assert part.clock.commands_heard() > 0 and part.clock.command_limit == 0.02


@pytest.mark.parametrize("repeated", [False, True])
def test_a_link_that_goes_quiet_ends_in_damping_whatever_late_says(repeated: bool) -> None:
    Counter.LOG.clear()
    interfere = Repeating("data/far/onboard/last", 30) if repeated else Quiet(
        "data/far/onboard/last", 30
    )  # fmt: skip
    run = run_spread(watched(0.2), interfere=interfere)
    result = run.results["onboard"]
    assert "link last@far -> onboard brings commands and was silent for " in result.reason
    assert result.ticks < 1000
    assert ["robot starts", *["robot rests"] * 5, "robot closes"] == Counter.LOG


class Repeating:
    """Sends the last message of one link again and again from the n-th on: it is no sign of life."""

    def __init__(self, key: str, after: int) -> None:
        self.key, self.left, self.last = key, after, b""

    def __call__(self, key: str, data: bytes) -> Iterable[bytes]:
        if key != self.key:
            return (data,)
        self.left -= 1
        if self.left > 0:
            self.last = data
        return (self.last,)


def test_in_lockstep_messages_count_when_they_come() -> None:
    run = run_spread(replace(ring(ticks=20), links=LinkSettings(watchdog=60.0)))
    part = run.parts["onboard"]
    assert part.watch.links and all(box.received_at > 0 for box in part.receivers)
    assert run.ticks == 20


def test_a_link_too_slow_to_be_watched_is_refused_at_load() -> None:
    two = "graphs/machines/jump_two.yaml"
    assert checked_file(two, ["links.watchdog=4 ms"]).links.watchdog == 0.004
    with pytest.raises(LoadError) as caught:
        checked_file(two, ["links.watchdog=3 ms", "links.of.legs.watch=false"])
    problems = caught.value.report.problems
    assert [p.message for p in problems if p.message.startswith(("wbc ", "legs "))] == [
        "wbc brings commands to onboard every 2 ms, so one message that is lost would count as silence"
    ]
    assert problems[0].code is Code.AGE and problems[0].expected == (
        "at least 4 ms, or a link that is not watched"
    )
